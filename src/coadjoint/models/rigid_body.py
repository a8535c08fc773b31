"""The free rigid body: Euler's equations and the attitude."""

from __future__ import annotations

from functools import partial

from coadjoint.groups import SO3
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.orientation import orientation
from coadjoint.models.quantities import checked, positive_definite

UNITS = {
    "xi": "rad/s",
    "xi_spatial": "rad/s",
    "mu": "kg m²/s",
    "energy": "J",
    "discrete_energy": "J",
    "kelvin_noether": "kg m²/s",
}
WITH_ANGLES = {**UNITS, "n": "rad", "nu": "rad/s", "q": "rad", "qdot": "rad/s", "pi": "kg m²/s"}
"""Those of a body whose shapes are angles."""


CHECKS = {"inertia": positive_definite}
"""Of the parameters, when one is made and when they are replaced."""


def lagrangian(xi, p):
    """ℓ(ω) = ½ ω·Jω."""
    return 0.5 * xi @ p.inertia @ xi


def make(*, inertia: Quantity) -> System:
    """A rigid body on SO(3) that nothing acts on: Jω̇ = Jω × ω, Ṙ = Rω^×.

    inertia: J about the mass centre in the body frame, (3, 3) or its diagonal (3,), kg m². Raises ArgumentError unless
    it is symmetric and positive definite.
    """
    p, kept = Parameters(**checked(CHECKS, {"inertia": inertia})), {"units": UNITS, "checks": partial(checked, CHECKS)}
    return System(SO3(), lagrangian, parameters=p, name="free rigid body", **kept)


def start(
    body: System,
    *,
    rotation: Quantity | None = None,
    euler_zxz: Quantity | None = None,
    euler_zyx: Quantity | None = None,
    angular_velocity: Quantity | None = None,
    euler_rates: Quantity | None = None,
) -> State:
    """The state of a body at an attitude R with angular velocity ω, given as in `orientation`."""
    R, omega = orientation(rotation, euler_zxz, euler_zyx, angular_velocity, euler_rates)
    return body.state(g=R, xi=omega)
