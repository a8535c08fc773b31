"""A falling cat: two bodies of revolution on a joint that bends but does not twist (Kane and Scher 1969)."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array
from coadjoint.groups import SO3
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.orientation import orientation
from coadjoint.models.quantities import checked, not_negative, positive_pair, vector
from coadjoint.models.rigid_body import WITH_ANGLES
from coadjoint.spaces import Trivial


def halves(x: Array) -> tuple[Array, Array]:
    """The attitudes (3, 3) of the front and the rear body in the middle frame, R± = exp(±½(0, x₁, x₂)^), of x (2,).

    The first axis points forward along the spine. x is the rotation vector of the bend, rad: the spine bends by the
    angle |x| in a direction that x gives, and never twists.
    """
    half = 0.5 * jnp.concatenate([jnp.zeros(1), x])
    return SO3().exp(half), SO3().exp(-half)


CHECKS = {
    "mass": positive_pair,
    "axial": positive_pair,
    "transverse": positive_pair,
    "reach": partial(vector, size=2),
    "stiffness": not_negative,
}
"""Of the parameters, when one is made and when they are replaced."""


def lagrangian(xi, x, v, p):
    """ℓ = ½ Σ ω·Jω + ½ m_r |ḋ|² − ½k|x|², with d from the rear to the front mass centre and m_r = m₁m₂/(m₁ + m₂)."""
    front, rear = halves(x)
    turning = jax.jvp(halves, (x,), (v,))[1]
    kinetic = 0.0
    for R, slope, axial, transverse in zip((front, rear), turning, p.axial, p.transverse, strict=True):
        omega = R.T @ xi + SO3().vee(R.T @ slope)
        kinetic += 0.5 * (axial * omega[0] ** 2 + transverse * (omega[1] ** 2 + omega[2] ** 2))
    reach = p.reach[0] * front[:, 0] + p.reach[1] * rear[:, 0]
    opening = p.reach[0] * turning[0][:, 0] + p.reach[1] * turning[1][:, 0]
    reduced_mass = p.mass[0] * p.mass[1] / (p.mass[0] + p.mass[1])
    apart = jnp.cross(xi, reach) + opening
    return kinetic + 0.5 * reduced_mass * apart @ apart - 0.5 * p.stiffness * x @ x


def make(*, mass: Quantity, axial: Quantity, transverse: Quantity, reach: Quantity, stiffness: Quantity) -> System:
    """A cat in free fall, seen from its mass centre: SO(3) with the bend x ∈ ℝ² of its spine as shape.

    Front and rear body stand in the attitudes R± of `halves` to the middle frame; what couples them is the joint alone.
    Each argument but the last is a pair, front and rear. mass: kg. axial, transverse: moments of inertia about the
    body's own mass centre, along and across the spine, kg m². reach: from the joint to the mass centres, m.
    stiffness: k of a spring that straightens the spine, N m. Raises ArgumentError for what no body can have.
    """
    given = {"mass": mass, "axial": axial, "transverse": transverse, "reach": reach, "stiffness": stiffness}
    p, kept = Parameters(**checked(CHECKS, given)), {"units": WITH_ANGLES, "checks": partial(checked, CHECKS)}
    return System(SO3(), lagrangian, additional=Trivial(2), parameters=p, name="falling cat", **kept)


def start(
    cat: System,
    *,
    rotation: Quantity | None = None,
    euler_zxz: Quantity | None = None,
    euler_zyx: Quantity | None = None,
    angular_velocity: Quantity | None = None,
    euler_rates: Quantity | None = None,
    bend: object = (0.0, 0.0),
    bend_rate: object = (0.0, 0.0),
) -> State:
    """The state of a cat whose middle frame has an attitude and angular velocity, given as in `orientation`.

    bend, bend_rate: x and ẋ, (2,), rad and rad/s.
    """
    R, omega = orientation(rotation, euler_zxz, euler_zyx, angular_velocity, euler_rates)
    return cat.state(g=R, xi=omega, q=vector(bend, "bend", 2), qdot=vector(bend_rate, "bend_rate", 2))
