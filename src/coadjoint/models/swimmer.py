"""A swimmer of three ellipses in an ideal fluid in the plane (Kanso, Marsden, Rowley, Melli-Huber 2005)."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.groups import SE2, SO2
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.quantities import checked, not_negative, number, positive, positive_pair, vector
from coadjoint.spaces import Trivial

UNITS = {
    "xi": "rad/s, m/s",
    "xi_spatial": "rad/s, m/s",
    "mu": "kg m/s, kg/s",
    "n": "rad",
    "nu": "rad/s",
    "q": "rad",
    "qdot": "rad/s",
    "pi": "kg m/s",
    "x": "m",
    "energy": "J/m",
    "discrete_energy": "J/m",
    "kelvin_noether": "kg m/s, kg/s",
}
"""Three components share an array, the angular one first; momenta and energies are per metre of depth."""


def links(x: Array, p: Parameters) -> tuple[Array, Array]:
    """The angles (3,) and centres (3, 2) of the front, middle and rear ellipse in the frame of the middle one.

    Joints are at the ends of the long axes; x are the angles of the front and the rear against the middle.
    """
    angles = jnp.stack([x[0], 0.0 * x[0], x[1]])
    a = p.semi_axes[0]
    front = jnp.stack([a + a * jnp.cos(x[0]), a * jnp.sin(x[0])])
    rear = -jnp.stack([a + a * jnp.cos(x[1]), a * jnp.sin(x[1])])
    return angles, jnp.stack([front, jnp.zeros(2), rear])


def inertias(p: Parameters) -> tuple[Array, Array, Array]:
    """𝒥 (kg m²), M_x, M_y (kg) of one ellipse with the fluid, one number each.

    Mass ρπab, added mass ρπb² and ρπa², added inertia ρπ(a² − b²)²/8.
    """
    a, b = p.semi_axes
    density, mass = np.pi * p.density, np.pi * p.density * a * b
    turning = mass * (a**2 + b**2) / 4 + density * (a**2 - b**2) ** 2 / 8
    return turning, mass + density * b**2, mass + density * a**2


CHECKS = {"semi_axes": positive_pair, "density": positive, "stiffness": not_negative}
"""Of the parameters, when one is made and when they are replaced."""


def lagrangian(xi, x, v, p):
    """ℓ = ½ Σ (𝒥ω_i² + M_x u_i² + M_y w_i²) − ½k|x|² over the ellipses, (u_i, w_i) along and across their long axes."""
    (angles, centres), (turning, moving) = jax.jvp(lambda x: links(x, p), (x,), (v,))
    about, along, across = inertias(p)
    omega = xi[0] + turning
    velocity = xi[1:] + xi[0] * jnp.stack([-centres[:, 1], centres[:, 0]], axis=1) + moving
    c, s = jnp.cos(angles), jnp.sin(angles)
    u, w = c * velocity[:, 0] + s * velocity[:, 1], c * velocity[:, 1] - s * velocity[:, 0]
    kinetic = 0.5 * (about * omega @ omega + along * u @ u + across * w @ w)
    return kinetic - 0.5 * p.stiffness * x @ x


def make(*, semi_axes: Quantity, density: Quantity, stiffness: Quantity) -> System:
    """Three equal ellipses, hinged in a row, in an ideal fluid at rest of their own density: SE(2) with two angles.

    The fluid adds to each ellipse the inertia that it adds to a single one; the flow between ellipses is neglected.
    semi_axes: (a, b), along the row and across it, m. density: of bodies and fluid, per metre of depth, kg/m³.
    stiffness: k of springs that straighten the row, N. Raises ArgumentError for what no body can have.
    """
    p = Parameters(**checked(CHECKS, {"semi_axes": semi_axes, "density": density, "stiffness": stiffness}))
    kept = {"units": UNITS, "checks": partial(checked, CHECKS)}
    return System(SE2(), lagrangian, additional=Trivial(2), parameters=p, name="three-link swimmer", **kept)


def start(
    swimmer: System,
    *,
    angle: Quantity = 0.0,
    position: Quantity = (0.0, 0.0),
    velocity: Quantity = (0.0, 0.0, 0.0),
    bend: object = (0.0, 0.0),
    bend_rate: object = (0.0, 0.0),
) -> State:
    """The state of a swimmer whose middle link has an angle (rad), a position (2,), m, and body velocity (ω, u, w).

    bend, bend_rate: the joint angles x (2,), rad, and ẋ, rad/s.
    """
    theta = number(angle, "angle")
    turned = evaluate(SO2().exp, np.array([theta]))
    return swimmer.state(
        g=(turned, vector(position, "position", 2)),
        xi=vector(velocity, "velocity", 3),
        q=vector(bend, "bend", 2),
        qdot=vector(bend_rate, "bend_rate", 2),
    )
