"""The reduced equations around a motion: essential and ignorable variables, and their slopes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.discrete import Point, node
from coadjoint.mechanics.poisson import vector_field
from coadjoint.mechanics.rates import rates
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.portable import Portable
from coadjoint.spaces.space import require_flat
from coadjoint.stability.scales import Scales, natural_scales

SAMPLES = 4
"""Motions around the given one at which it is looked for what the equations do not depend on."""

SPREAD = 0.5
"""How far these are from the given one, in natural sizes."""

IGNORABLE = 1e-9
"""A slope up to this fraction of the largest counts as zero."""


class ReducedSlopes(NamedTuple):
    """y = (μ, n, π, a), its rate Y, and their derivatives by the chart z = (δξ, δn, δν, η).

    y, rate: (y,). y_z, rate_z: (y, z).
    """

    y: np.ndarray
    rate: np.ndarray
    y_z: np.ndarray
    rate_z: np.ndarray


class Reduced(Portable):
    """The reduced equations ẏ = Y(y), y = (μ, n, π, a), modulo directions K of (n, a) that they do not depend on.

    K is the largest linear subspace of (n, a) with DY(y) K ⊂ K at every y, so that Y has an image on y modulo K: the
    position of a vehicle in still water, the direction of north, the angle of a rotor. A steady motion is an
    equilibrium there: ignorable variables go on growing or turning.

    system: without explicit time, on a flat space of additional dynamics. near: a state around which K is looked for,
    at random motions; its inputs and internal state are held. symmetries: integrals C_i, functions of a state, along
    whose flows a steady motion may go: Y − Σ λ_i X_{C_i} takes the place of Y, with λ = rates.
    rates: λ, (number of symmetries,), by default 0.
    Raises ArgumentError for another system.
    """

    def __init__(
        self, system: System, near: State, symmetries: Sequence[Callable] = (), rates: np.ndarray | None = None
    ):
        _require_autonomous(system)
        self.system = system
        self.near = near
        self.symmetries = tuple(symmetries)
        self.rates = np.zeros(len(self.symmetries)) if rates is None else rates
        self.sizes = _sizes(system)
        self._require_steady_forces()

    def moved(self, state: State, z: Array) -> State:
        """The state with ξ + δξ, n + δn, ν + δν, and g e^η, a ↦ e^{−η}a, for z = (δξ, δn, δν, η), (size,)."""
        group, _, V = self.system.places
        d_xi, d_n, d_nu, eta = jnp.split(z, np.cumsum(self.sizes)[:-1])
        xi, n, nu = state.xi + d_xi, state.n + d_n, state.nu + d_nu
        g, a = state.g, state.a
        if len(eta):
            F = group.exp(eta)
            g, a = group.compose(g, F), V.act(group, group.inverse(F), a)
        return state.replace(g=g, n=n, a=a, xi=xi, nu=nu)

    def energy(self, state: State) -> Array:
        """E = ⟨μ, ξ⟩ + ⟨π, ν⟩ − ℓ, one number."""
        return node(self.system, state, Point(state.xi, state.n, state.nu, state.a, state.t)).energy

    def phase(self, state: State, along: Array | None = None) -> tuple[PyTree, PyTree]:
        """y and Y as flat arrays (y,), Y less what goes along the symmetries at `along`, by default at `rates`."""
        y, moving = rates(self.system, state)
        rate = jnp.concatenate(moving)
        if self.symmetries:
            rate = rate - jnp.asarray(self.rates if along is None else along) @ self.flows(
                state.replace(mu=y.mu, pi=y.pi)
            )
        return jnp.concatenate(y), rate

    def flows(self, state: State) -> Array:
        """X_{C_i} of the symmetries at a state with momenta, (symmetries, y): a row each."""
        return jnp.stack([jnp.concatenate(vector_field(symmetry, state)) for symmetry in self.symmetries])

    def with_momenta(self, state: State) -> State:
        """The state with μ, π of its velocities."""
        mu, _, pi, _ = jnp.split(self.phase(state)[0], np.cumsum(self.sizes[:3]))
        return state.replace(mu=mu, pi=pi)

    def slopes(self, state: State) -> ReducedSlopes:
        """y, Y and their derivatives by z at a state."""
        (y, rate), (y_z, rate_z) = self._tabulated(state)
        if not all(np.all(np.isfinite(part)) for part in (rate, y_z, rate_z)):
            raise LagrangianError(
                "The equations of motion, or their derivatives, are not finite at the motion: look for a division by "
                "zero or the root of zero in the Lagrangian and the forces."
            )
        return ReducedSlopes(y, rate, y_z, rate_z)

    @cached_property
    def scales(self) -> Scales:
        """What counts as one around the given state, whatever the units."""
        slopes = self.slopes(self.near)
        return natural_scales(self.system, self.near, slopes.y_z, slopes.rate_z, self.sizes)

    @cached_property
    def _tabulated(self) -> PyTree:
        def both(state: State) -> PyTree:
            def at(z: Array) -> tuple[Array, Array]:
                return self.phase(self.moved(state, z))

            zero = jnp.zeros(sum(self.sizes))
            return at(zero), jax.jacfwd(at)(zero)

        return tabulate(both, self.near)

    @cached_property
    def ignorable(self) -> np.ndarray:
        """An orthonormal basis of K in y, columns, shape (len y, k); unit vectors where K is spanned by coordinates."""
        dim, ambient = self.system.group.dim, self.system.additional.ambient(self.system.group)
        size = dim + 2 * ambient + self.system.advected.ambient(self.system.group)
        basis = np.eye(size)[:, [*range(dim, dim + ambient), *range(dim + 2 * ambient, size)]]
        scale = self.scales.y
        samples = [self._jacobian(state) * scale / scale[:, None] for state in self.around]
        tolerance = IGNORABLE * max(float(np.max(np.abs(A), initial=0.0)) for A in samples)
        while basis.shape[1]:
            outside = np.eye(size) - basis @ basis.T
            leaving = np.concatenate([outside @ A @ basis for A in samples])
            _, singular, rows = np.linalg.svd(leaving, full_matrices=False)
            kept = rows[singular <= tolerance].T
            if kept.shape[1] == basis.shape[1]:
                break
            basis = basis @ kept
        basis = np.linalg.qr(scale[:, None] * basis)[0]
        projector = basis @ basis.T
        axes = np.diag(projector) > 0.5
        return np.eye(size)[:, axes] if np.allclose(projector, np.diag(axes), atol=1e-8) else basis

    @cached_property
    def essential(self) -> np.ndarray:
        """C, (rows, dim): orthonormal rows that take y to y modulo K.

        They are rows of the unit matrix where K is spanned by coordinates.
        """
        K = self.ignorable
        axes = np.max(np.abs(K), axis=1, initial=0.0) == 0
        if np.sum(axes) == len(K) - K.shape[1]:
            return np.eye(len(K))[axes]
        return np.linalg.svd(K, full_matrices=True)[0][:, K.shape[1] :].T

    @cached_property
    def around(self) -> list[State]:
        """Random states around the given one."""
        random = np.random.default_rng(1760)
        changes = [SPREAD * self.scales.z * random.normal(size=sum(self.sizes)) for _ in range(SAMPLES)]
        return [evaluate(self.moved, self.near, z) for z in changes]

    def _jacobian(self, state: State) -> np.ndarray:
        """∂Y/∂y in all ambient directions at a state."""
        y_x, rate_x = self._ambient(state)
        if np.linalg.matrix_rank(y_x) < len(y_x):
            raise LagrangianError(
                "The Lagrangian must be regular: ∂²ℓ/∂(ξ, ν)² is singular, so that velocities do not follow from "
                "momenta; give every velocity an inertia."
            )
        found = rate_x @ np.linalg.inv(y_x)
        if not np.all(np.isfinite(found)):
            raise LagrangianError("The equations of motion are not finite at motions near the given one.")
        return found

    @cached_property
    def _ambient(self) -> PyTree:
        def both(state: State) -> PyTree:
            def at(xi: Array, n: Array, nu: Array, a: Array) -> tuple[Array, Array]:
                return self.phase(state.replace(xi=xi, n=n, nu=nu, a=a))

            blocks = jax.jacfwd(at, argnums=(0, 1, 2, 3))(state.xi, state.n, state.nu, state.a)
            return tuple(jnp.concatenate(parts, axis=1) for parts in blocks)

        return tabulate(both, self.near)

    def _require_steady_forces(self) -> None:
        def drift(state: State) -> PyTree:
            return jax.jvp(lambda t: self.phase(state.replace(t=t))[1], (state.t,), (jnp.ones_like(state.t),))[1]

        rate = evaluate(drift, self.near.replace(t=np.asarray(self.near.t, dtype=float)))
        if np.any(rate != 0):
            raise ArgumentError("A steady motion needs forces that do not depend on time by themselves; hold them.")


def _sizes(system: System) -> tuple[int, int, int, int]:
    """How many of z are δξ, δn, δν, η; without advected parameters η moves nothing and is left out."""
    dim, ambient = system.group.dim, system.additional.ambient(system.group)
    return dim, ambient, ambient, dim if system.advected.ambient(system.group) else 0


def _require_autonomous(system: System) -> None:
    if not system.continuous:
        raise ArgumentError(
            "Steady motions need the continuous equations: a system with a Lagrangian or a Hamiltonian."
        )
    require_flat(system.additional, "The search for a steady motion", "describe q by coordinates")
    if system.depends_on_time or system.inputs is not None:
        raise ArgumentError(
            "A steady motion needs a system that does not depend on time: give inputs as constants to system.state."
        )
