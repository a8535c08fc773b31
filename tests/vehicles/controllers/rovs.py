"""A vehicle for tests that eight thrusters push any way: the BlueROV2 Heavy set of von Benzon et al. (2022)."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint_vehicles import Vehicle
from coadjoint_vehicles.parts import Damping, Thrusters

S, TAM = 0.707, np.zeros((6, 8))
TAM[0, :4], TAM[1, :4], TAM[2, 4:] = S, S * np.array([-1, 1, 1, -1]), [-1, 1, 1, -1]
TAM[3, 4:], TAM[4, 4:] = 0.21805 * np.array([-1, -1, 1, 1]), 0.12 * np.array([-1, 1, -1, 1])
TAM[5, :4] = 0.1888 * np.array([-1, 1, -1, 1])


def rov(**changes: Any) -> Vehicle:
    parts = (
        Damping("damping", linear=(13.7, 0, 33, 0, 0.8, 0), quadratic=(141, 217, 190, 1.192, 0.47, 1.5)),
        Thrusters("thrusters", curve={"quadratic": (40.0, 32.0)}, allocation=TAM, limit=1.0, lag=0.1),
    )
    body = {
        "mass": 13.5,
        "inertia": (0.26, 0.23, 0.37),
        "added_mass": (6.3567, 7.1206, 18.6863, 0.1858, 0.1348, 0.2215),
    }
    return Vehicle(
        **{"name": "ROV", **body, "volume": 0.0134, "center_of_buoyancy": (0, 0, -0.01), "parts": parts, **changes}
    )
