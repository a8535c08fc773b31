"""What a page plays of a vehicle's run."""

from __future__ import annotations

import numpy as np

from coadjoint.plotting.decimation import thin
from coadjoint.plotting.entries import Entry
from coadjoint.plotting.player import Track
from coadjoint.plotting.style import COLOURS
from coadjoint.vehicles.logs.records import VehicleRecords


def track(run: Entry, capacity: int, alone: bool) -> Track:
    """Times, places, what points forward and to starboard, and speeds of a run, `capacity` of each at most."""
    log = VehicleRecords(run.dataset)
    kept = thin(log.position, log.attitude, capacity=capacity)
    wanted = log.set_points.get("depth")
    return Track(
        label=str(run.dataset.attrs.get("system", "vehicle")) if alone else run.label,
        colour=COLOURS[run.place % len(COLOURS)],
        time=run.time[kept],
        place=log.position[kept],
        forward=log.directions[kept][:, :, 0],
        starboard=log.directions[kept][:, :, 1],
        speed=np.linalg.norm(log.velocity[kept], axis=1),
        wanted=None if wanted is None or wanted[0].ndim > 1 else wanted[0][kept],
    )
