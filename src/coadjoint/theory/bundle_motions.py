"""Motions on a principal bundle that no single section covers."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import LagrangianError, StepError
from coadjoint.groups.group import Element
from coadjoint.kernels.packing import flattened
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import native
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.connection import ROUND_OFF
from coadjoint.mechanics.principal_bundle import PrincipalBundle
from coadjoint.mechanics.start_arguments import require_tangent
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods import GroupVariational
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.theory.discrete_connections import positive_step

Lagrangian = Callable[[Array, Array], Scalar]

_BLOCK = 64
"""Steps between two looks at the domains; steps beyond the change of section are computed again."""


class BundleCurve(NamedTuple):
    """A motion in P: times (N+1,), points p (N+1, n), shapes x (N+1, m), the section of each node (N+1,), and the

    momentum J ∈ 𝔤*, ⟨J, ξ⟩ = ⟨∂ℓ/∂ṗ, ξ·p⟩, (N+1, dim G), which is conserved and belongs to no section.
    """

    time: np.ndarray
    p: np.ndarray
    x: np.ndarray
    section: np.ndarray
    momentum: np.ndarray


def bundle_motion(
    bundle: PrincipalBundle,
    lagrangian: Lagrangian,
    p: ArrayLike,
    velocity: ArrayLike,
    *,
    dt: float,
    steps: int,
    margin: float = 0.2,
) -> BundleCurve:
    """The discrete motion of a Lagrangian in P, through one local section after another.

    The discrete Lagrangian is L(p, p⁺) = h ℓ((p + p⁺)/2, (p⁺ − p)/h), of order 2; through a section it is
    Λ(F, x, x⁺) = L(s(x), F·s(x⁺)). As it belongs to no section, neither does the motion in P: to round-off it does not
    depend on where one section is left for another.

    bundle: P → M; G acts on P by a linear action. lagrangian: ℓ(p, ṗ) of arrays (n,), invariant under G, in terms of
    jax.numpy. p, velocity: the start, (n,) each. dt: h, s. steps: N, from 1 on. margin: a section is left where its
    `domain` is below this and that of another is larger; `PrincipalBundle.carried` carries the state over. Raises
    LagrangianError for a Lagrangian that is not invariant, and StepError where a step has no solution.
    """
    h, steps = positive_step(dt), checks.whole(steps, "steps")
    checks.instance(bundle, "bundle", PrincipalBundle, "a co.mechanics.PrincipalBundle")
    checks.function(lagrangian, "lagrangian", "a function (p, velocity) that returns a number")
    start = np.asarray(bundle.total.point(bundle.group, p, "p"))
    moving = checks.array(velocity, "velocity", start.shape)
    require_tangent(bundle.total, bundle.group, start, moving, "velocity", "p")
    _require_invariant(bundle, lagrangian, start, moving)
    i = int(np.argmax(evaluate(lambda p: bundle.depths(bundle.project(p)), start)))
    local = [_Local(bundle, lagrangian, k, h) for k in range(len(bundle.sections))]
    state, pieces, done = local[i].begin(start, moving), [], 0
    while True:
        nodes, code = local[i].run(state, min(_BLOCK, steps - done))
        seen = local[i].seen(nodes)
        count = len(nodes.t) - 1
        late = np.flatnonzero((seen.depths[1:, i] < margin) & (seen.depths[1:].argmax(axis=1) != i))
        k = int(late[0]) + 1 if len(late) else count
        if not len(late) and code != Code.CONVERGED:
            raise StepError(
                f"The step from t = {(done + count) * float(h):g} s has no solution that Newton's method finds through "
                f"section {i}: take a smaller dt or a larger margin."
            )
        last = done + k == steps
        cut = k + 1 if last else k
        pieces.append((seen.p[:cut], seen.x[:cut], np.full(cut, i), seen.momentum[:cut]))
        if last:
            break
        state, done = jax.tree.map(lambda rows, k=k: rows[k], nodes), done + k
        if len(late):
            j = int(seen.depths[k].argmax())
            state, i = local[i].carried(j, state), j
    return BundleCurve(float(h) * np.arange(steps + 1), *map(np.concatenate, zip(*pieces, strict=True)))


def local_system(bundle: PrincipalBundle, lagrangian: Lagrangian, section: int = 0) -> System:
    """The system Λ(F, x, x⁺; h) = h ℓ((p + p⁺)/2, (p⁺ − p)/h), p = s(x), p⁺ = F·s(x⁺), of a section.

    Arguments as in `bundle_motion`; section: its number. co.methods.GroupVariational() runs it within the domain.
    """
    s, act = bundle.section(section).point, partial(bundle.total.act, bundle.group)

    def discrete(F: Element, x: PyTree, x_next: PyTree, h: Scalar) -> Scalar:
        p, q = s(flattened(x)), act(F, s(flattened(x_next)))
        return h * lagrangian(0.5 * (p + q), (q - p) / h)

    return System(bundle.group, group_lagrangian=discrete, additional=bundle.shapes)


class _Seen(NamedTuple):
    """What nodes are in P, and the depth of each in all domains."""

    p: Array
    x: Array
    momentum: Array
    depths: Array


class _Local:
    """The steps through one section, compiled."""

    def __init__(self, bundle: PrincipalBundle, lagrangian: Lagrangian, i: int, h: Array):
        self.bundle, self.lagrangian, self.i, self.h = bundle, lagrangian, i, h
        self.system, self.step = local_system(bundle, lagrangian, i), GroupVariational()
        self.program, self.constants = StepProgram(self.system, self.step), Constants(self.system.parameters, None)

    def begin(self, p: Array, velocity: Array) -> State:
        """The state of a start: g, x, ξ and ẋ of the velocity, and μ and π, what ∂ℓ/∂ṗ is on them."""
        bundle, M, P, group = self.bundle, self.bundle.shapes, self.bundle.total, self.bundle.group
        section = bundle.sections[self.i].point

        def local(p: Array, velocity: Array):
            g, x = bundle.trivialised(self.i, p)
            v = jax.jvp(bundle.project, (p,), (velocity,))[1]
            s, along = jax.jvp(section, (x,), (v,))
            turned = P.push(group, group.inverse(g), p, velocity)
            fibre = jax.vmap(lambda e: P.infinitesimal(group, e, s))(jnp.eye(group.dim)).T
            xi = jnp.linalg.solve(fibre.T @ fibre, fibre.T @ (turned - along))
            momentum = jax.grad(self.lagrangian, argnums=1)(s, turned)
            return g, x, xi, v, fibre.T @ momentum, M.project(group, x, jax.vjp(section, x)[1](momentum)[0])

        g, x, xi, v, mu, pi = evaluate(local, p, velocity)
        state = self.system.state(g=g, q=M.given(group, x), xi=xi, qdot=M.given(group, v))
        return self.step.begin(self.system, state.replace(mu=mu, pi=pi, from_velocities=False), self.h)

    def run(self, state: State, steps: int) -> tuple[State, int]:
        """The nodes of so many steps, or of those that have a solution, with a leading axis, and the outcome."""
        chunk = native.run(self.program, self.constants, state, float(self.h), steps, 1, monitors=False)
        rows = jax.tree.map(
            lambda rows, end: np.concatenate([rows[: chunk.steps], end[None]]), chunk.records, chunk.final
        )
        return rows, chunk.code

    def seen(self, nodes: State) -> _Seen:
        """What nodes are in P."""
        group = self.bundle.group

        def one(g: Element, x: Array, mu: Array) -> _Seen:
            J = group.Ad_dual(group.inverse(g), mu)
            return _Seen(self.bundle.point(self.i, g, x), x, J, self.bundle.depths(x))

        return evaluate(jax.vmap(one), nodes.g, nodes.n, nodes.mu)

    def carried(self, j: int, state: State) -> State:
        """A node through section j, with F̃ = χ(x)Fχ(x⁺)⁻¹ of the step that starts there as the first guess."""

        def one(state: State) -> State:
            group, moved = self.bundle.group, self.bundle.carried(self.i, j, state)
            ends = state.n, state.n + self.h * state.nu
            chi, chi_next = (self.bundle.transition(self.i, j, x) for x in ends)
            F = group.compose(group.compose(chi, state.memory.F), group.inverse(chi_next))
            return moved.replace(memory=state.memory._replace(F=F, change=0 * state.memory.change))

        return evaluate(one, state)


def _require_invariant(bundle: PrincipalBundle, lagrangian: Lagrangian, p: Array, velocity: Array) -> None:
    """Raise LagrangianError unless ℓ(g·p, g·ṗ) = ℓ(p, ṗ) at a random g."""
    group, P = bundle.group, bundle.total
    eta = np.random.default_rng(1934).normal(scale=0.7, size=group.dim)

    def sides(p: Array, v: Array, eta: Array) -> tuple[Scalar, Scalar]:
        g = group.exp(eta)
        return lagrangian(P.act(group, g, p), P.push(group, g, p, v)), lagrangian(p, v)

    moved, still = map(float, evaluate(sides, p, velocity, eta))
    if not abs(moved - still) <= ROUND_OFF * max(abs(moved), abs(still), 1.0):
        raise LagrangianError(
            f"A Lagrangian on a bundle must be invariant, ℓ(g·p, g·ṗ) = ℓ(p, ṗ), but differs by {moved - still:.1e}."
        )
