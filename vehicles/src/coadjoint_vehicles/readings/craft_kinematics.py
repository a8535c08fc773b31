"""The kinematics of a craft at a node, with its accelerations, and between two nodes."""

from __future__ import annotations

from collections.abc import Callable

import jax.numpy as jnp

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.extending import replace_parameters
from coadjoint.mechanics import State, System, continuous
from coadjoint_vehicles.model.craft import Craft
from coadjoint_vehicles.model.energies import Surroundings
from coadjoint_vehicles.sensors.kinematics import Kinematics, rotation_of


def kinematics(
    craft: Craft, *, bottom: float | Callable[[PyTree, PyTree], PyTree] | None = None, system: System | None = None
) -> Callable[..., Kinematics]:
    """(state, p) → Kinematics at a node of a craft; traced by JAX, as observations of a `co.Stepper` are.

    Velocities are those of the momenta at the node, accelerations those of the continuous equations (P20)–(P22) with
    all forces and the internal state there. bottom: the depth of a level bottom, one number in m, or a function
    (north, east) ↦ depth, m; None without a bottom. system: by default that of the craft.
    """
    of = craft.system if system is None else system
    water = craft.water

    def at(state: State, p: PyTree) -> Kinematics:
        own = replace_parameters(of, p)
        there = state.holding(state.internal)
        xi, nu = continuous.velocities(own, there)
        rates = continuous.vector_field(own, there.replace(xi=xi, nu=nu))
        a = own.advected.view(own.group, state.a)
        around = Surroundings(water, state.n, a, state.t, state.internal, p)
        R, depth = rotation_of(a), around.depth()
        position = R @ state.n
        below = bottom(position[0], position[1]) if callable(bottom) else bottom
        return Kinematics(
            position=position,
            rotation=R,
            velocity=nu,
            omega=xi,
            acceleration=rates.nu + jnp.cross(xi, nu),
            angular_acceleration=rates.xi,
            gravity=jnp.asarray(p.gravity),
            current=water.current(around.place(), state.t, around.memory, p.water),
            bottom=None if below is None else jnp.asarray(below),
            head=water.pressure_head(depth, p.water) if water.stratified else p.fluid_density * depth,
            density=jnp.asarray(water.density(depth, p.water) if water.stratified else p.fluid_density),
            t=state.t,
        )

    return at


def between(first: Kinematics, last: Kinematics, t: Scalar) -> Kinematics:
    """The kinematics at the time t, one number in s, from those of the nodes before and after; jax.numpy only.

    Place, velocity, attitude, rates and pressure are the cubics that have the values and the slopes of both nodes, so
    that they are wrong by O(h⁴); R is made orthogonal again. Accelerations and current lie on the line between. Where a
    force jumps at a node, as at a command without lag, a fault or a payload that is dropped, the slope there is that
    after the jump, and over the step that ends there velocity and rates are wrong by O(h), place and attitude by O(h²).
    """
    h = last.t - first.t
    h = jnp.where(h > 0, h, 1.0)
    s = jnp.clip((t - first.t) / h, 0.0, 1.0)

    def cubic(x: Array, dx: Array, y: Array, dy: Array) -> Array:
        left, right = (1 + 2 * s) * (1 - s) ** 2, s**2 * (3 - 2 * s)
        return left * x + right * y + h * s * (1 - s) * ((1 - s) * dx - s * dy)

    def line(x: Array, y: Array) -> Array:
        return x + s * (y - x)

    ends = (first, last)
    moving = [node.rotation @ node.velocity for node in ends]
    pushed = [node.rotation @ node.acceleration for node in ends]
    turning = [node.rotation @ _hat(node.omega) for node in ends]
    sinking = [node.density * speed[2] for node, speed in zip(ends, moving, strict=True)]
    R = _orthogonal(cubic(first.rotation, turning[0], last.rotation, turning[1]))
    return first._replace(
        position=cubic(first.position, moving[0], last.position, moving[1]),
        rotation=R,
        velocity=R.T @ cubic(moving[0], pushed[0], moving[1], pushed[1]),
        omega=cubic(first.omega, first.angular_acceleration, last.omega, last.angular_acceleration),
        acceleration=line(first.acceleration, last.acceleration),
        angular_acceleration=line(first.angular_acceleration, last.angular_acceleration),
        current=line(first.current, last.current),
        bottom=None if first.bottom is None else line(first.bottom, last.bottom),
        head=cubic(first.head, sinking[0], last.head, sinking[1]),
        density=line(first.density, last.density),
        t=t,
    )


def _hat(omega: Array) -> Array:
    """ω̂ with ω̂v = ω × v."""
    zero = jnp.zeros(())
    x, y, z = omega[0], omega[1], omega[2]
    return jnp.stack([jnp.stack([zero, -z, y]), jnp.stack([z, zero, -x]), jnp.stack([-y, x, zero])])


def _orthogonal(R: Array) -> Array:
    """The rotation whose last and first rows are those of R, made orthonormal."""
    down = R[2] / jnp.sqrt(R[2] @ R[2])
    north = R[0] - (R[0] @ down) * down
    north = north / jnp.sqrt(north @ north)
    return jnp.stack([north, jnp.cross(down, north), down])
