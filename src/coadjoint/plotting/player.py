"""A page that plays tracks in space: one file, with their positions inside, that needs nothing else."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.resources import files
from typing import NamedTuple

import numpy as np

POINTS = 6000
"""The most positions on a page, of all tracks together."""
_PLACE = "/*RUNS*/[]"


class Track(NamedTuple):
    """What a page plays of one body.

    label, colour: of its curve. time: (nodes,) s. place: (nodes, 3) m, north, east, down. forward, starboard:
    (nodes, 3), directions in space. speed: (nodes,) m/s. wanted: the depth that was asked for, (nodes,) m, if any was.
    """

    label: str
    colour: str
    time: np.ndarray
    place: np.ndarray
    forward: np.ndarray
    starboard: np.ndarray
    speed: np.ndarray
    wanted: np.ndarray | None = None


_DIGITS = {"time": 3, "place": 3, "forward": 4, "starboard": 4, "speed": 3, "wanted": 2}


def page(tracks: Sequence[Track], points: np.ndarray) -> str:
    """The HTML of a player for these tracks and for way points (k, 3), m."""
    template = files(str(__package__)).joinpath("player.html").read_text(encoding="utf-8")
    runs = [{name: _rounded(name, value) for name, value in track._asdict().items()} for track in tracks]
    data = json.dumps({"runs": runs, "points": np.round(points, 2).tolist()}, allow_nan=False)
    # "<" cannot end the script from inside a text.
    return template.replace(_PLACE, data.replace("<", "\\u003c"))


def _rounded(name: str, value: np.ndarray | str | None) -> list[float] | str | None:
    return np.round(value, _DIGITS[name]).tolist() if isinstance(value, np.ndarray) else value
