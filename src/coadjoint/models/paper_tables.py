"""The vehicle and the run of the paper's section 5: Tables 1 and 2 as data."""

from __future__ import annotations

from math import pi, radians
from typing import TYPE_CHECKING

from coadjoint.arrays import PyTree

if TYPE_CHECKING:
    from coadjoint.mechanics.state import State
    from coadjoint.mechanics.system import System

TABLE_1: dict[str, PyTree] = {
    "mass": 123.8,
    "added_mass": (65.0, 70.0, 75.0),
    "inertia": (5.46, 5.29, 5.72),
    "buoyancy": 1215.8,
    "center_of_buoyancy": (0.0, 0.0, -0.007),
    "gravity": 9.81,
}
"""kg, kg, kg m², N (printed as kg), m, m/s²; J is the inertia in the body frame."""

TABLE_2: dict[str, PyTree] = {
    "position": (0.0, 0.0, 1.0),
    "velocity": (0.1, 0.1, 0.8),
    "euler_zxz": (2 * pi, 0.0, 2 * pi),
    "euler_rates": (radians(10), radians(10), radians(10)),
}
"""m, m/s, rad, rad/s; with them R₀ = I and ω₀ = (10°, 0, 20°)/s."""

PAPER_STEP = 0.01
"""h of Table 2, s."""
PAPER_DURATION = 500.0
"""T of Table 2, s."""


def paper_vehicle() -> System:
    """The vehicle of Table 1, adapted there from Nordkvist and Sanyal (2010)."""
    from coadjoint.models.paper_form import vehicle

    return vehicle(**TABLE_1)


def paper_start(vehicle: System) -> State:
    """The initial state of Table 2. The paper takes its velocities as the first discrete ones: start="velocity"."""
    from coadjoint.models.paper_form import start

    return start(vehicle, **TABLE_2)
