"""The reduced Lagrangian of a craft: body, added mass, weight and buoyancy, in water that moves."""

from __future__ import annotations

from collections.abc import Iterator

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array, PyTree
from coadjoint.mechanics import Force, Motion
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.part import Flow, Part, acting_at
from coadjoint_vehicles.water.water import Water


class Surroundings:
    """The water as a craft meets it, in body axes, with the parameters p."""

    def __init__(self, water: Water, n: Array, a: PyTree, t: PyTree, internal: PyTree, p: PyTree):
        self.water, self.t = water, t
        self.down, self.north = a.down, a.north
        self.back = jnp.stack([a.north, jnp.cross(a.down, a.north), a.down], axis=1)  # R⁻¹, from space to body
        self.n = n
        self.memory = internal.water if water.start() else None
        self.own, self.fluid_density = p.water, p.fluid_density

    def place(self, position: Array | float = 0.0) -> Array:
        """R(n + r) in space, (3,) m, of the point r of the body."""
        return self.back.T @ (self.n + position)

    def current(self, position: Array | float = 0.0) -> Array:
        """R⁻¹c at the point r of the body."""
        return self.back @ self.water.current(self.place(position), self.t, self.memory, self.own)

    def vorticity(self, position: Array) -> Array:
        """R⁻¹(∇ × c) at the point r of the body."""
        J = jax.jacfwd(lambda q: self.water.current(q, self.t, self.memory, self.own))(self.place(position))
        return self.back @ jnp.stack([J[2, 1] - J[1, 2], J[0, 2] - J[2, 0], J[1, 0] - J[0, 1]])

    def depth(self, position: Array | float = 0.0) -> Array:
        """The depth of the point r of the body, m."""
        return (self.n + position) @ self.down

    def pressure_head(self, position: Array) -> Array:
        """∫₀^depth ρ dz above the point r of the body, kg/m²."""
        depth = self.depth(position)
        return self.water.pressure_head(depth, self.own) if self.water.stratified else self.fluid_density * depth

    def flow(self, omega: Array, nu: Array) -> Flow:
        """The water as the parts meet it."""
        depth = self.depth()
        density = self.water.density(depth, self.own) if self.water.stratified else self.fluid_density
        here = self.current()
        elsewhere = None if self.water.uniform else lambda position: self.current(position) - here
        return Flow(nu - here, omega, density, self.down, depth, self.t, elsewhere)


def masses(parts: tuple[Part, ...], internal: Named, p: Named) -> Iterator[tuple[Array, Array, Array | float]]:
    """(mass, position, velocity in the hull) of the body and of the masses that its parts move."""
    yield p.mass, p.center_of_mass, 0.0
    for part in parts:
        if part.holds_mass:
            yield from part.lumps(actual_of(part, internal), getattr(p, part.name))


def volumes(parts: tuple[Part, ...], internal: Named, p: Named) -> Iterator[tuple[Array, Array]]:
    """(volume, position) of the body and of the volumes that its parts add."""
    yield p.volume, p.center_of_buoyancy
    for part in parts:
        if part.holds_mass:
            yield from part.displaced(actual_of(part, internal), getattr(p, part.name))


def actual_of(part: Part, internal: Named) -> PyTree:
    """The actual value of a part's actuator; None without one."""
    return None if part.command is None else getattr(internal, part.name)


def lagrangian(water: Water, parts: tuple[Part, ...], omega, n, nu, a, p, t, internal) -> Array:
    """ℓ = ½[ν_r; ω]ᵀ(M_RB + M_A)[ν_r; ω] + Σ mg depth_g − Σ Vg ∫₀^depth_b ρ dz, ν_r = ν − R⁻¹c, in a steady uniform c.

    With ν in place of ν_r for the body itself, ℓ would differ by (d/dt)(m q_g·c), which moves nothing; so everything
    moves as in still water, on the grid too. In another current c(q, t) the body has ½m|ν_g|² + ½ω·I_cω, added mass
    has ½ν_rᵀM_Aν_r, and the water that the body displaces gives Σ ρV(−c·ν_b + ½|c|²) at each centre of buoyancy b: with
    `shear`, the force ρV Dc/Dt (Auton, Hunt and Prud'homme 1988). ρ there, and in M_A, is the vehicle's own.
    """
    around = Surroundings(water, n, a, t, internal, p)
    through = nu - around.current()
    both = jnp.concatenate([through, omega])
    carried = water.uniform and water.steady
    moving = through if carried else nu
    total = 0.5 * (omega @ p.inertia @ omega + both @ p.added_mass @ both)
    for mass, position, inside in masses(parts, internal, p):
        velocity = moving + jnp.cross(omega, position) + inside
        total = total + mass * (0.5 * velocity @ velocity + p.gravity * around.depth(position))
    for part in (part for part in parts if part.holds_mass):
        for momentum, position in part.released(actual_of(part, internal), getattr(p, part.name)):
            total = total + momentum @ (around.back.T @ (moving + jnp.cross(omega, position)))
    for volume, position in volumes(parts, internal, p):
        total = total - volume * p.gravity * around.pressure_head(position)
        if not carried:
            c = around.current(position)
            velocity = nu + jnp.cross(omega, position)
            total = total + p.fluid_density * volume * (0.5 * c @ c - c @ velocity)
    return total


def shear(water: Water, parts: tuple[Part, ...], motion: Motion, p: Named) -> Force:
    """−Σ ρV (∇ × c) × ν_r at each centre of buoyancy: the lift that displaced water alone would have in ℓ."""
    around = Surroundings(water, motion.n, motion.a, motion.t, motion.internal, p)
    torque, force = jnp.zeros(3), jnp.zeros(3)
    for volume, position in volumes(parts, motion.internal, p):
        through = motion.nu + jnp.cross(motion.xi, position) - around.current(position)
        push = acting_at(position, -p.fluid_density * volume * jnp.cross(around.vorticity(position), through))
        torque, force = torque + push.torque, force + push.force
    return Force(torque=torque, force=force)
