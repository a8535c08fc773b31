"""A rigid body with a rotor: a gyrostat, whose rotor's angle is a shape that no rotation moves."""

from __future__ import annotations

from functools import partial

from coadjoint.groups import SO3
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.orientation import orientation
from coadjoint.models.quantities import checked, direction, number, positive, positive_definite
from coadjoint.models.rigid_body import WITH_ANGLES
from coadjoint.spaces import Trivial

_UNITS = {**WITH_ANGLES, "momentum_squared": "J² s²"}


CHECKS = {"inertia": positive_definite, "rotor_inertia": positive, "axis": direction}
"""Of the parameters, when one is made and when they are replaced."""


def lagrangian(xi, n, nu, p):
    """ℓ(ω, φ, φ̇) = ½ ω·Jω + ½ I(e·ω + φ̇)², J without the rotor's spin about its axis e."""
    return 0.5 * xi @ p.inertia @ xi + 0.5 * p.rotor_inertia * (p.axis @ xi + nu[0]) ** 2


def momentum_squared(state):
    """|μ|², the Casimir function of SO(3); the momentum of a free rotor, π = I(e·ω + φ̇), is conserved too."""
    return state.mu @ state.mu


def make(*, inertia: Quantity, rotor_inertia: object, axis: object = (0.0, 0.0, 1.0)) -> System:
    """A free rigid body with a rotor that turns freely about an axis of the body: μ̇ = μ×ω, π̇ = 0.

    μ = Jω + πe, so that a fast rotor holds the body: about a principal axis e = eₖ the body turns stably at rate ω
    where (Jₖ − Jᵢ)ω + π, i ≠ k, have one sign.

    inertia: J of the body with the rotor's mass, but not its spin, (3, 3) or its diagonal, kg m². rotor_inertia: I,
    kg m². axis: e, (3,), a unit vector in the body frame.
    """
    p = Parameters(**checked(CHECKS, {"inertia": inertia, "rotor_inertia": rotor_inertia, "axis": axis}))
    watched = {"momentum_squared": momentum_squared}
    spaces = {"additional": Trivial(1), "parameters": p, "quantities": watched, "checks": partial(checked, CHECKS)}
    return System(SO3(), lagrangian, **spaces, name="rigid body with a rotor", units=_UNITS)


def start(
    body: System,
    *,
    rotation: Quantity | None = None,
    euler_zxz: Quantity | None = None,
    euler_zyx: Quantity | None = None,
    angular_velocity: Quantity | None = None,
    euler_rates: Quantity | None = None,
    rotor_angle: object = 0.0,
    rotor_rate: object = 0.0,
) -> State:
    """The state of a body, its rotor at φ, rad, with the rate φ̇ relative to the body, rad/s; see `orientation`."""
    R, omega = orientation(rotation, euler_zxz, euler_zyx, angular_velocity, euler_rates)
    angle, rate = number(rotor_angle, "rotor_angle"), number(rotor_rate, "rotor_rate")
    return body.state(g=R, xi=omega, q=[angle], qdot=[rate])
