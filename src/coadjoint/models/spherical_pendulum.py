"""The spherical pendulum: a mass on a sphere, seen from a carrier that turns freely."""

from __future__ import annotations

from functools import partial

import jax.numpy as jnp

from coadjoint.groups import SO3
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.orientation import orientation
from coadjoint.models.quantities import checked, direction, not_negative, positive, positive_definite, vector
from coadjoint.models.rigid_body import UNITS
from coadjoint.spaces import Defining, Sphere

_UNITS = {**UNITS, "n": "1", "nu": "1/s", "q": "1", "qdot": "1/s", "pi": "kg m²/s", "a": "1"}
_UNITS["pendulum_momentum"] = "kg m²/s"


CHECKS = {"mass": positive, "length": positive, "gravity": not_negative, "inertia": positive_definite}
"""Of the parameters, when one is made and when they are replaced."""


def lagrangian(xi, n, nu, a, p):
    """ℓ(ω, n, ν, a) = ½ ω·Jω + ½ ml² ν·ν − mgl n·a on SO(3) × S², a pointing up."""
    m, length = p.mass, p.length
    return 0.5 * xi @ p.inertia @ xi + 0.5 * m * length**2 * nu @ nu - m * p.gravity * length * n @ a


def pendulum_momentum(state):
    """a·(n × π), the pendulum's angular momentum about the vertical."""
    return state.a @ jnp.cross(state.n, state.pi)


def make(*, mass: Quantity, length: Quantity, gravity: Quantity = 9.81, inertia: Quantity = (1.0, 1.0, 1.0)) -> System:
    """A spherical pendulum on S² with a free carrier on SO(3), which it does not feel: q ∈ S², n = R⁻¹q.

    Integrals: energy and the vertical angular momentum. z = q·e_z obeys ż² = (2g/l)(z − z₁)(z − z₂)(z − z₃).

    mass: kg. length: l, m. gravity: m/s². inertia: J of the carrier, (3, 3) or its diagonal, kg m².
    """
    p = Parameters(**checked(CHECKS, {"mass": mass, "length": length, "gravity": gravity, "inertia": inertia}))
    spaces = {"additional": Sphere(), "advected": Defining(), "parameters": p, "checks": partial(checked, CHECKS)}
    watched = {"pendulum_momentum": pendulum_momentum}
    return System(SO3(), lagrangian, **spaces, quantities=watched, name="spherical pendulum", units=_UNITS)


def start(
    pendulum: System,
    *,
    bob: object = (0.0, 0.0, -1.0),
    bob_velocity: object = (0.0, 0.0, 0.0),
    rotation: Quantity | None = None,
    euler_zxz: Quantity | None = None,
    euler_zyx: Quantity | None = None,
    angular_velocity: Quantity | None = None,
    euler_rates: Quantity | None = None,
    up: Quantity = (0.0, 0.0, 1.0),
) -> State:
    """The state with the bob in direction q ∈ S² of the space frame, q̇ tangent in 1/s; the carrier by `orientation`."""
    R, omega = orientation(rotation, euler_zxz, euler_zyx, angular_velocity, euler_rates)
    q, qdot = direction(bob, "bob"), vector(bob_velocity, "bob_velocity")
    return pendulum.state(g=R, xi=omega, q=q, qdot=qdot, a0=direction(up, "up"))
