"""Writes the gains of the cruise controllers of shipped vehicles, which are then found in place of designed.

python .ci/gains.py
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from coadjoint.kernels.trace.identity import identity
from coadjoint_vehicles.controllers import Cruise, design
from coadjoint_vehicles.files.registry import load_vehicle, vehicle_names


def designed() -> dict[str, dict]:
    """What `propose` finds for every shipped vehicle with a cruise controller, with the digest of both."""
    vehicles = {name: load_vehicle(name) for name in vehicle_names()}
    cruising = {name: one for name, one in vehicles.items() if isinstance(one.controller, Cruise)}
    return {name: _found(vehicle.controller, vehicle) for name, vehicle in cruising.items()}


def _found(controller, vehicle) -> dict:
    known = identity(*design.parts_of_design("cruise", controller, vehicle))
    return {"digest": known.digest, **_plain(design.designed_gains(controller, vehicle))}


def _plain(value):
    """Arrays as lists, whose numbers have all their digits."""
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


if __name__ == "__main__":
    Path(str(design.SHIPPED)).write_text(json.dumps(designed(), indent=1) + "\n")
