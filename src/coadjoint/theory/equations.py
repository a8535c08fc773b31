"""The printed discrete equations as a health check: the residual of each on a trajectory, in the corrected form.

Everything is differentiated anew from Λ and τ: neither (dτ⁻¹)* nor node forms nor transported momenta of the methods
are used, so that the check does not share their mistakes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.invariance import is_right
from coadjoint.mechanics.noether import KelvinNoether
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods import Galerkin, GroupVariational, Method, Variational
from coadjoint.methods.step import Step
from coadjoint.theory.constraints import off_nodes, with_reactions
from coadjoint.theory.curves import NODES
from coadjoint.theory.euler_poincare import advected
from coadjoint.theory.group_form import of_group_form, of_poisson, of_semidirect
from coadjoint.theory.instant import require_one
from coadjoint.theory.reduction import unreduce
from coadjoint.theory.residuals import Residual, largest, pairs, row, scales
from coadjoint.theory.slopes import Slopes, legendre_transforms, slopes_of, trivialised
from coadjoint.theory.unreduced import UnreducedLagrangian

RULES = (*NODES, Variational, Galerkin)

OPPOSITE = (
    "right-invariant: products are those of the opposite group, g·h = hg, so that F_k = g_{k+1}g_k⁻¹, a_k = g_k a₀"
)
"""What a table of a right-invariant system begins with."""


@dataclass(frozen=True)
class Equations:
    """The residuals of all equations that a trajectory can be asked for; print it for a table."""

    rows: tuple[Residual, ...]
    right: bool = False
    """Whether the system is right-invariant, so that products are those of the opposite group."""

    def __iter__(self) -> Iterator[Residual]:
        return iter(self.rows)

    def __getitem__(self, equation: str) -> Residual:
        return next(row for row in self.rows if row.equation == equation)

    @property
    def worst(self) -> Residual:
        """The equation that holds least well."""
        return max(self.rows, key=lambda row: row.largest)

    def __str__(self) -> str:
        rows = [f"{row.equation:<8}{row.largest:9.1e}  {row.statement}" for row in self.rows]
        return "\n".join([OPPOSITE, *rows] if self.right else rows)


def printed_equations(
    run: Any, noether: KelvinNoether | None = None, unreduced: UnreducedLagrangian | None = None
) -> Equations:
    """The residuals of (P37)–(P52) and, where Λ is in group form, of (B8)–(B25), over a run that kept every step.

    With forces they are those of the discrete Lagrange–d'Alembert principle. The rows F⁻ and F⁺ compare the momenta of
    the records with the discrete Legendre transforms of the steps that start and end there.
    `noether`: the 𝒦 of (P50)–(P52), by default 𝒦 = c. `unreduced`: L of (P36) for (P37) and (B8), by default that of
    the system; the forces are always the system's. Raises ArgumentError for compositions, and for records that are not
    consecutive.
    """
    records = consecutive(run)
    return equations_of(run.system, run.method, records, run.dt, noether, unreduced)


def consecutive(run: Any) -> State:
    """The records of a run that kept every step, whole steps alone; raises ArgumentError for other ones."""
    if not hasattr(run, "plan"):
        raise ArgumentError(f"Argument `run` must be a run of co.simulate, but is {run!r}; equations_of takes states.")
    if not hasattr(run, "dt"):
        raise ArgumentError(
            "Argument `run` must be the run of one system, but is an ensemble: simulate a member alone."
        )
    if run.plan.save_every != 1:
        raise ArgumentError("The equations need consecutive records: run with save_every=1.")
    records = run.records
    if len(records.t) > 1 and abs(records.t[-1] - records.t[-2] - run.dt) > 1e-6 * run.dt:
        # The part of a step that led to an event has another Λ.
        records = jax.tree.map(lambda leaf: leaf[:-2], records)
    return records


def equations_of(
    system: System,
    method: Method,
    records: State,
    h: Scalar,
    noether: KelvinNoether | None = None,
    unreduced: UnreducedLagrangian | None = None,
) -> Equations:
    """`printed_equations` of states with a leading axis: consecutive nodes with the unknowns that start at them."""
    if not isinstance(method, RULES):
        raise ArgumentError(
            f"The printed equations are those of one discrete Lagrangian a step, which {method.title} does not have: "
            "use co.LeftRectangle, co.RightRectangle, co.Trapezoidal, co.Midpoint, co.Simpson, co.Galerkin, "
            "co.Variational or co.methods.GroupVariational."
        )
    require_one(system)
    checks.shape(records.t, "The time of the records", "(n,)")
    if len(records.t) < 3:
        raise ArgumentError(f"The equations need at least 3 records, but there are {len(records.t)}.")
    noether = noether or KelvinNoether(np.ones(system.group.dim))
    step = method.stages[0][0]
    bare = records.replace(memory=records.memory.base) if system.constraints else records
    slopes = evaluate(jax.vmap(partial(slopes_of, system, step, h)), bare)
    rows = _of_nodes(system, records, slopes)
    if system.constraints:
        slopes = slopes._replace(impulse=with_reactions(system, records, slopes.impulse, h))
        rows += _of_constraints(system, records)
    rows += [*_of_steps(system, slopes), *_of_momenta(system, records, slopes)]
    rows += _of_noether(system, records, slopes, noether)
    if isinstance(method, GroupVariational):
        rows += of_group_form(system, records, slopes, h, unreduced or unreduce(system))
        rows += of_semidirect(system, slopes, h) + of_poisson(system, records, slopes, h, noether)
    elif not isinstance(method, Galerkin):
        rows.append(_of_variations(system, step, bare, h))
    return Equations(tuple(rows), is_right(system.places))


def _of_constraints(system: System, records: State) -> list[Residual]:
    """φ = 0 and A·(ξ, ν) = b at every node, relative to the largest n and a, ξ and ν."""
    places, rates, speeds = evaluate(jax.vmap(partial(off_nodes, system)), records)
    size = largest((records.n, records.a))
    rows = [row("A", "A_k·(ξ, ν) = b_k, for φ: φ̇ = 0", rates, (1 + size) * largest(speeds))]
    return [row("φ", "φ(n_k, a_k) = 0", places, size), *rows] if places.shape[1] else rows


def _of_nodes(system: System, records: State, slopes: Slopes) -> list[Residual]:
    """What relates nodes of the configuration to reduced variables."""
    group, Q, V = system.places
    here, after = pairs(records)
    link, _ = pairs(slopes.link)
    a0 = evaluate(lambda s: V.act(group, s.g, s.a), jax.tree.map(lambda x: x[0], records))

    def places(here, after, link):
        back = group.inverse(here.g)
        moved = group.matrix(after.g) - group.matrix(group.compose(here.g, link.F))
        seen = link.s - Q.act(group, group.compose(back, after.g), after.n)
        n, a = advected(system, link)
        return moved, seen, here.a - V.act(group, back, a0), after.n - n, after.a - a

    moved, seen, parameter, n, a = evaluate(jax.vmap(places), here, after, link)
    size_g = largest(evaluate(jax.vmap(group.matrix), records.g))
    size_n, size_a = largest(records.n), largest(records.a)
    return [
        row("P38 F", "F_k = g_k⁻¹g_{k+1}", moved, size_g),
        row("P38 s", "s_k = g_k⁻¹q_{k+1}", seen, size_n),
        row("P39", "a_k = g_k⁻¹a₀", parameter, size_a),
        row("P43", "n_{k+1} = F_k⁻¹s_k", n, size_n),
        row("P44", "a_{k+1} = F_k⁻¹a_k", a, size_a),
    ]


def _of_steps(system: System, slopes: Slopes) -> list[Residual]:
    """(P42) with the pull-back of (P46): F⁻ of a step is F⁺ of the one before."""
    group, Q, _ = system.places

    def both(before: Slopes, here: Slopes):
        left, right = legendre_transforms(system, here)[0], legendre_transforms(system, before)[1]
        return left.mu - right.mu, Q.coordinates(group, here.link.n, left.pi - right.pi), here.inner

    mu, pi, inner = evaluate(jax.vmap(both), *pairs(slopes))
    of_mu, of_pi = scales(slopes)
    held, forced = "½hA_kᵀ(λ′_k + λ_k) + " * bool(system.constraints), system.forces is not None
    rows = [
        row("P42 μ", f"{held}{'T⁻_k + ' * forced}D^L_FΛ_{{k−1}} + ∂_aΛ⋄a + ∂_nΛ⋄n + ∂_sΛ⋄s = D^R_FΛ_k", mu, of_mu),
        row("P42 π", f"{held}∂_nΛ_k{' + φ⁻_k' * forced} = −F*_{{k−1}}∂_sΛ_{{k−1}}", pi, of_pi),
    ]
    if inner.shape[1]:
        rows.append(row("P41", "δΣΛ = 0 between the ends of a step", inner, of_mu + of_pi))
    return rows


def _of_momenta(system: System, records: State, slopes: Slopes) -> list[Residual]:
    """The momenta of the records against the discrete Legendre transforms of the steps on their two sides."""
    group, Q, _ = system.places

    def off(before: Slopes, here: Slopes, record: State):
        left, right = legendre_transforms(system, here)[0], legendre_transforms(system, before)[1]
        apart = [Q.coordinates(group, record.n, record.pi - momenta.pi) for momenta in (left, right)]
        return record.mu - left.mu, apart[0], record.mu - right.mu, apart[1]

    before, here = pairs(slopes)
    values = evaluate(jax.vmap(off), before, here, jax.tree.map(lambda x: x[1:], records))
    of_mu, of_pi = scales(slopes)
    ahead, behind = ("½hA_kᵀλ_k", "½hA_{k+1}ᵀλ′_{k+1}") if system.constraints else ("", "")
    before, after = f" − {ahead}" if ahead else "", f" + {behind}" if behind else ""
    return [
        row("F⁻ μ", f"μ_k = D^R_FΛ_k − ∂_aΛ⋄a − ∂_nΛ⋄n − ∂_sΛ⋄s − T⁻_k{before}", values[0], of_mu),
        row("F⁻ π", f"π_k = −∂_nΛ_k − φ⁻_k{before}", values[1], of_pi),
        row("F⁺ μ", f"μ_{{k+1}} = D^L_FΛ_k + T⁺_k{after}", values[2], of_mu),
        row("F⁺ π", f"π_{{k+1}} = F*_k∂_sΛ_k + φ⁺_k{after}", values[3], of_pi),
    ]


def _of_noether(system: System, records: State, slopes: Slopes, noether: KelvinNoether) -> list[Residual]:
    """(P50), and (P52) with the forces' share ⟨𝒦_k, T⁻_k − φ⁻_k⋄n_k + T⁺_{k−1} − φ⁺_{k−1}⋄n_k⟩ or that of reactions."""
    group, Q, V = system.places
    first = jax.tree.map(lambda x: x[0], records)

    def quantities(record: State, at: Slopes):
        K = noether.momentum_map(system, record)
        since = group.Ad(group.compose(group.inverse(record.g), first.g), noether.momentum_map(system, first))
        momentum, work = at.right - Q.diamond(group, at.along_s, at.link.s), at.impulse
        source = V.diamond(group, at.along_a, at.link.a) + work.torque - Q.diamond(group, work.force, record.n)
        n, _ = advected(system, at.link)
        return K, K - since, K @ momentum, K @ source, work.torque_next - Q.diamond(group, work.force_next, n)

    K, off, quantity, source, behind = evaluate(jax.vmap(quantities), records, slopes)
    change = source[1:] + np.sum(K[1:] * behind[:-1], axis=1)
    size = system.group.dim * largest(K) * scales(slopes)[0]
    forced = " + T⁻_k − φ⁻_k⋄n_k + T⁺_{k−1} − φ⁺_{k−1}⋄n_k" if system.forces is not None or system.constraints else ""
    return [
        row("P50", "𝒦(c_k, a_k) = Ad_{g_k⁻¹g_0} 𝒦(c_0, a_0)", off, largest(K)),
        row("P52", f"(P51)_k − (P51)_{{k−1}} = ⟨𝒦_k, ∂_aΛ⋄a_k{forced}⟩", np.diff(quantity) - change, size),
    ]


def _of_variations(system: System, step: Step, records: State, h: Scalar) -> Residual:
    """(P47): δξ = dτ⁻¹_{−hξ}η⁺/h − dτ⁻¹_{hξ}η/h gives δF = −ηF + Fη⁺, for two fixed η."""
    group = system.group
    eta, ahead = np.random.default_rng(47).normal(size=(2, group.dim))

    def off(record: State):
        there, back = (trivialised(system, step, h, record.replace(xi=x)) for x in (record.xi, -record.xi))
        change = jnp.linalg.solve(back, ahead) - jnp.linalg.solve(there, eta)

        def increment(xi: Array):
            return group.matrix(step.relative(system, record.replace(xi=xi), h))

        F, moved = jax.jvp(increment, (record.xi,), (change,))
        return moved - F @ group.hat(ahead) + group.hat(eta) @ F

    values = evaluate(jax.vmap(off), records)
    return row("P47", "hδξ = dτ⁻¹_{−hξ}η⁺ − dτ⁻¹_{hξ}η", values, largest(eta) + largest(ahead))
