"""The energy–momentum method: a discrete gradient on 𝔤* × T*Q × V*."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, Scalar
from coadjoint.checks import whole
from coadjoint.difference_maps.secant import require_secant, secant, secant_dual
from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Element
from coadjoint.mechanics.continuous import energy
from coadjoint.mechanics.discrete import Point, power
from coadjoint.mechanics.reduced_functions import added
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.energy_momentum_on_curved import ENDS, CurvedLeap, curved_leap, first_guess, mean_velocity, split
from coadjoint.methods.increments import HalfStepSquared
from coadjoint.methods.method import Claims, Method
from coadjoint.methods.quadrature import gauss
from coadjoint.methods.step import Step

MAX_POINTS = 8


class _Slopes(NamedTuple):
    """The gradient of ℓ at a point."""

    mu: Array
    along_n: Array
    pi: Array
    along_a: Array
    along_t: Array


class _Leap(NamedTuple):
    """One step: H, the middle of it with hΔ there, ℓ's gradients at the points, and the state at its end."""

    half: Element
    middle: Point
    source: Array
    slopes: list[_Slopes]
    n: Array
    a: Array
    mu: Array
    pi: Array


@dataclass(frozen=True)
class EnergyMomentum(Method, HalfStepSquared):
    """A discrete gradient of the reduced Hamiltonian ℋ(μ, π, n, a), order 2, symmetric: keeps ℋ and the momenta.

    Between nodes x₀ and x₁, x = (μ, π, n, a), the mean ∇̄ℋ = ∫₀¹ ∇ℋ(x₀ + s(x₁ − x₀)) ds has ⟨∇̄ℋ, x₁ − x₀⟩ = ℋ₁ − ℋ₀.
    With (ξ, ρ, −φ, −β) := ∇̄ℋ in the order (μ, π, n, a), H = τ(hξ/2) and H·v − H⁻¹·v = hξ·(Av) (`secant`) the step is

        n₁ = H⁻¹(H⁻¹n₀ + hν), a₁ = H⁻¹ā, ā = H⁻¹a₀, π₁ = H*(H*π₀ + hκ), μ₁ = Ad*_H(Ad*_H μ₀ + hD), g₁ = gH²,
        ν = Aρ, κ = A*φ + f, D = A*β⋄ā + A*φ⋄n̄ + π̄⋄ν + T,

    n̄, π̄ halfway between H⁻¹n₀, H*π₀ and H·n₁, H⁻*π₁. So m₁ = Ad*_F m₀ + Ad*_H h(A*β⋄ā + T − f⋄n̄), and ℋ₁ − ℋ₀ =
    h(⟨T, ξ⟩ + ⟨f, ½(H + H⁻¹)ρ⟩ − ∂_tℓ): both are exact, but the symplectic form is not kept. points: Gauss points for
    the mean, by default 1. ℋ is kept to round-off if it is a polynomial of degree ≤ 2·points in (μ, π, n, a); one point
    suffices for bodies, tops and vehicles. Otherwise ℋ is kept up to O(h^{2·points}). The unknowns are the velocities
    at the points, ∂_{(ξ,ν)}ℓ = (μ, π) there: ℋ itself is never formed.

    On a curved Q every ℋ is kept to round-off: ν = A(ρ + v), κ = A*(φ + b) + f, where v and b are normal up to O(h) and
    hold n₁ on Q and π₁ on T*Q. The mean is that of the gradients at both ends, with a correction along x₁ − x₀ by which
    ⟨(ξ, ρ + v, −φ − b, −β), x₁ − x₀⟩ = ℋ₁ − ℋ₀; points is not used.
    Source: Gonzalez 1996; McLachlan, Quispel, Robidoux 1999 for ∇̄; the forms on G and on Q are this library's own.
    """

    constrainable = False

    points: int = 1

    def __post_init__(self):
        super().__post_init__()
        whole(self.points, "points", most=MAX_POINTS)
        self._start_from_momenta()

    @property
    def order(self) -> int:
        return 2

    @property
    def symmetric(self) -> bool:
        return True

    @property
    def claims(self) -> Claims:
        """Four points keep every smooth energy to round-off; with fewer it drifts where ℋ is not quadratic."""
        return Claims(2, True, symplectic=False, energy="exact" if self.points >= 4 else "quadratic")

    @property
    def title(self) -> str:
        several = f", points={self.points}" if self.points > 1 else ""
        return f"EnergyMomentum({self.difference_map!r}{several})"

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return ((self, 1.0),)

    def require_fit(self, system: System) -> None:
        """Raise if V* is curved or an action is not affine, or the map's secant is not known."""
        super().require_fit(system)
        for space in (system.additional, system.advected):
            if not space.affine or (space is system.advected and not space.flat):
                raise ArgumentError(
                    "EnergyMomentum needs affine actions and a flat V*, because it draws straight lines in them, "
                    f"but got {space!r}: use co.Midpoint(), or, for a sphere, co.Defining() with a constant length."
                )
            require_secant(self.difference_map, system.group, space)

    def blocks(self, system: System) -> tuple[int, ...]:
        group, Q, _ = system.places
        sets = self.points if Q.flat else len(ENDS[0])
        of_points = sets * group.dim, sets * Q.dim(group)
        return of_points if Q.flat else (*of_points, Q.ambient(group), Q.ambient(group), group.dim + 1)

    def _means(self, system: System) -> tuple[np.ndarray, np.ndarray]:
        """Gauss's places in (0, 1) and weights; on a curved Q the ends."""
        rule = gauss(self.points)
        return (rule.c, rule.b) if system.additional.flat else ENDS

    def remember(self, system: System, state: State) -> State:
        if not system.additional.flat:
            return state.replace(memory=np.zeros(sum(self.blocks(system))))
        return state if self.points == 1 else state.replace(memory=self._spread(state.xi, state.nu))

    def _spread(self, xi: Array, nu: Array) -> Array:
        """The same velocities at every point."""
        return jnp.concatenate([jnp.tile(xi, self.points), jnp.tile(nu, self.points)])

    def guess(self, system: System, state: State, h: Scalar) -> Array:
        if not system.additional.flat:
            return first_guess(system, state, h, len(ENDS[0]))
        return jnp.concatenate([state.xi, state.nu]) if self.points == 1 else state.memory

    def record(self, system: System, state: State, h: Scalar, z: Array) -> State:
        """ξ and ρ, the means over the points; all of z stays in the memory where there are several."""
        _, weights = self._means(system)
        if not system.additional.flat:
            found = split(system, z, len(weights))
            nu = mean_velocity(system, state, found, weights)
            return state.replace(xi=found.turn, nu=nu, memory=z)
        xi, nu = (jnp.asarray(weights) @ part for part in self._velocities(system, z))
        return state.replace(xi=xi, nu=nu, memory=state.memory if self.points == 1 else z)

    def _velocities(self, system: System, z: Array) -> tuple[Array, Array]:
        """(ξ, ν) at the points, a row each."""
        end = self.blocks(system)[0]
        return z[:end].reshape(self.points, -1), z[end:].reshape(self.points, -1)

    def _leap(self, system: System, record: State, h: Scalar) -> _Leap | CurvedLeap:
        if not system.additional.flat:
            found = split(system, record.memory, len(ENDS[0]))
            return curved_leap(self.difference_map, system, record, h, found, ENDS)
        (group, Q, V), (places, weights) = system.places, self._means(system)
        xi, map_ = record.xi, self.difference_map
        half = map_.tau(group, 0.5 * h * xi)
        back = group.inverse(half)
        start, a = Q.act(group, back, record.n), V.act(group, back, record.a)
        nu = secant(map_, group, Q, h * xi, start, record.nu)
        n_next, a_next = Q.act(group, back, start + h * nu), V.act(group, back, a)

        slopes = []
        for c, velocities in zip(
            places, zip(*self._velocities(system, self._unknowns(record)), strict=True), strict=True
        ):
            n, advected = record.n + c * (n_next - record.n), record.a + c * (a_next - record.a)
            slopes.append(self._slopes(system, record, (velocities[0], n, velocities[1], advected), record.t + c * h))
        phi = cast(Array, sum(w * at.along_n for w, at in zip(weights, slopes, strict=True)))
        beta = cast(Array, sum(w * at.along_a for w, at in zip(weights, slopes, strict=True)))

        n = start + 0.5 * h * nu
        middle = self._middle(system, record, half, n, a, h)
        torque, force = added(system, system.body_forces(system.motion(*middle, record.inputs, record.over_step)))
        pushed = secant_dual(map_, group, Q, h * xi, n, phi)
        from_advected = V.diamond(group, secant_dual(map_, group, V, h * xi, a, beta), a)
        pi = Q.pull(group, half, start, record.pi)
        kappa = pushed + force
        turning = Q.diamond(group, pushed, n) + Q.lifted_diamond(group, pi + 0.5 * h * kappa, n, nu)
        mu = group.Ad_dual(half, record.mu) + h * (from_advected + turning + torque)
        return _Leap(
            half=half,
            middle=middle,
            source=h * (from_advected + torque - Q.diamond(group, force, n)),
            slopes=slopes,
            n=n_next,
            a=a_next,
            mu=group.Ad_dual(half, mu),
            pi=Q.pull(group, half, n_next, pi + h * kappa),
        )

    def _unknowns(self, record: State) -> Array:
        return jnp.concatenate([record.xi, record.nu]) if self.points == 1 else record.memory

    def _slopes(self, system: System, record: State, at: tuple[Array, ...], t: Scalar) -> _Slopes:
        def lagrangian(xi: Array, n: Array, nu: Array, a: Array, t: Scalar):
            return system.reduced_lagrangian(
                xi, n, nu, a, t, record.inputs, record.over_step, near=(record.mu, record.pi)
            )

        return _Slopes(*jax.grad(lagrangian, argnums=(0, 1, 2, 3, 4))(*at, jnp.asarray(t)))

    def _middle(self, system: System, record: State, half: Element, n: Array, a: Array, h: Scalar) -> Point:
        """Where forces act in the middle, with the velocity ½(H + H⁻¹)ρ that gives their power."""
        group, Q, _ = system.places
        nu = 0.5 * (Q.push(group, half, n, record.nu) + Q.push(group, group.inverse(half), n, record.nu))
        return Point(record.xi, n, nu, a, record.t + 0.5 * h)

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        """∂_ξℓ − μ and ∂_νℓ − π at the points of the line from (μ₀, π₀) to (μ₁, π₁)."""
        leap, (places, _) = self._leap(system, record, h), self._means(system)
        if isinstance(leap, CurvedLeap):
            return leap.rows
        of_mu, of_pi = [], []
        for c, at in zip(places, leap.slopes, strict=True):
            of_mu.append(at.mu - record.mu - c * (leap.mu - record.mu))
            of_pi.append(at.pi - record.pi - c * (leap.pi - record.pi))
        return jnp.concatenate([*of_mu, *of_pi])

    def advance(self, system: System, record: State, h: Scalar) -> State:
        leap = self._leap(system, record, h)
        g = system.group.compose(record.g, system.group.compose(leap.half, leap.half))
        return record.later(h, g=g, n=leap.n, a=leap.a, mu=leap.mu, pi=leap.pi)

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        leap = self._leap(system, record, h)
        source = system.group.Ad_dual(system.group.inverse(leap.half), leap.source)
        return source, jnp.zeros_like(source)

    def work(self, system: System, record: State, h: Scalar) -> Array:
        """h(⟨T, ξ⟩ + ⟨f, ½(H + H⁻¹)ρ⟩) of each force, then −h mean ∂_tℓ: the change of ℋ, to round-off."""
        leap, (_, weights) = self._leap(system, record, h), self._means(system)
        forces = system.body_forces(system.motion(*leap.middle, record.inputs, record.over_step))
        along_t = cast(Array, sum(w * at.along_t for w, at in zip(weights, leap.slopes, strict=True)))
        return h * power(forces, record.xi, leap.middle.nu, [along_t] if system.depends_on_time else [])

    def energy(self, system: System, record: State, h: Scalar) -> Array:
        """ℋ at the node, which this method keeps; it has no Λ."""
        return energy(system, record)
