"""The heavy top: a rigid body with one point held fixed, under gravity."""

from __future__ import annotations

from functools import partial

import numpy as np

from coadjoint import checks
from coadjoint.groups import SO3
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.orientation import orientation
from coadjoint.models.quantities import checked, direction, not_negative, positive, positive_definite, vector
from coadjoint.spaces import Defining

UNITS = {
    "xi": "rad/s",
    "xi_spatial": "rad/s",
    "mu": "kg m²/s",
    "a": "1",
    "energy": "J",
    "discrete_energy": "J",
    "kelvin_noether": "kg m²/s",
}


CHECKS = {"mass": positive, "center_of_mass": vector, "inertia": positive_definite, "gravity": not_negative}
"""Of the parameters, when one is made and when they are replaced."""


def lagrangian(xi, a, p):
    """ℓ(ω, a) = ½ ω·Jω − mg r·a, with a = R⁻¹e_z pointing up."""
    return 0.5 * xi @ p.inertia @ xi - p.mass * p.gravity * p.center_of_mass @ a


def make(
    *,
    mass: Quantity,
    center_of_mass: Quantity,
    inertia: Quantity,
    gravity: Quantity = 9.81,
    inertia_about: str = "pivot",
) -> System:
    """A heavy top on SO(3) with the upward direction as its advected parameter.

    ℓ(ω, a) = ½ ω·Jω − mg r·a, J about the pivot. If `inertia` is about the mass centre, J = I_c + m(|r|²I − r rᵀ).

    mass: m, kg. center_of_mass: r from the pivot, body frame, (3,) m. inertia: (3, 3) or its diagonal (3,), kg m²,
    about the point named by `inertia_about`, "pivot" or "center_of_mass". gravity: g, m/s².
    Raises ArgumentError for what no body can have.
    """
    m, r = positive(mass, "mass"), vector(center_of_mass, "center_of_mass")
    J = positive_definite(inertia, "inertia")
    checks.choice(inertia_about, "inertia_about", ("pivot", "center_of_mass"))
    if inertia_about == "center_of_mass":
        J = J + m * ((r @ r) * np.eye(3) - r[:, None] * r[None, :])
    p = Parameters(**checked(CHECKS, {"mass": m, "center_of_mass": r, "inertia": J, "gravity": gravity}))
    kept = {"units": UNITS, "checks": partial(checked, CHECKS)}
    return System(SO3(), lagrangian, advected=Defining(), parameters=p, name="heavy top", **kept)


def start(
    top: System,
    *,
    rotation: Quantity | None = None,
    euler_zxz: Quantity | None = None,
    euler_zyx: Quantity | None = None,
    angular_velocity: Quantity | None = None,
    euler_rates: Quantity | None = None,
    up: Quantity = (0.0, 0.0, 1.0),
) -> State:
    """The state of a top at an attitude R with angular velocity ω, a = R⁻¹up.

    Attitude and angular velocity as in `orientation`: R = I and ω = 0 unless given. up: the direction against gravity
    in the space frame, (3,), a unit vector.
    """
    R, omega = orientation(rotation, euler_zxz, euler_zyx, angular_velocity, euler_rates)
    return top.state(g=R, xi=omega, a0=direction(up, "up"))
