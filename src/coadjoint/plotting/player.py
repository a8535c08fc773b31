"""A page that plays a vehicle's track in space: one file, with its positions inside, that needs nothing else."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from coadjoint.models.underwater.log.log import Log
from coadjoint.plotting.decimation import thin
from coadjoint.plotting.entries import Entry
from coadjoint.plotting.style import COLOURS

POINTS = 6000
"""The most positions on a page, of all vehicles together."""
_PLACE = "/*RUNS*/[]"


def page(runs: Sequence[Entry]) -> str:
    """The HTML of a player for these runs."""
    template = files("coadjoint.plotting").joinpath("player.html").read_text(encoding="utf-8")
    tracks = [_track(run, POINTS // len(runs), alone=len(runs) == 1) for run in runs]
    data = json.dumps({"runs": tracks, "points": _rounded(Log(runs[0].dataset).way_points, 2)}, allow_nan=False)
    # "<" cannot end the script from inside a text.
    return template.replace(_PLACE, data.replace("<", "\\u003c"))


def _track(run: Entry, capacity: int, alone: bool) -> dict[str, Any]:
    """Times, places, what points forward and to starboard, and speeds of a run, a few thousand of each at most."""
    log = Log(run.dataset)
    kept = thin(log.position, log.attitude, capacity=capacity)
    wanted = log.set_points.get("depth")
    return {
        "label": str(run.dataset.attrs.get("system", "vehicle")) if alone else run.label,
        "colour": COLOURS[run.place % len(COLOURS)],
        "time": _rounded(run.time[kept], 3),
        "place": _rounded(log.position[kept], 3),
        "forward": _rounded(log.directions[kept][:, :, 0], 4),
        "starboard": _rounded(log.directions[kept][:, :, 1], 4),
        "speed": _rounded(np.linalg.norm(log.velocity[kept], axis=1), 3),
        "wanted": None if wanted is None or wanted[0].ndim > 1 else _rounded(wanted[0][kept], 2),
    }


def _rounded(values: np.ndarray, digits: int) -> list[Any]:
    return np.round(values, digits).tolist()
