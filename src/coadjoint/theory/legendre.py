"""The discrete Legendre transforms F± and the discrete momentum maps J± of every method that has a Λ (Theorem 6)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, StepError
from coadjoint.groups.group import Element
from coadjoint.kernels.newton import solver
from coadjoint.kernels.program import Code
from coadjoint.kernels.trace.evaluate import evaluate, tabulate, traced
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods import Method
from coadjoint.methods.step import Step
from coadjoint.theory.euler_poincare import Link, Momenta, advected, left_momenta, right_momenta
from coadjoint.theory.instant import require_one
from coadjoint.theory.slopes import legendre_transforms, slopes_of


class Transforms(NamedTuple):
    """F⁻ = (μ_k, π_k) at the node where a step starts and F⁺ = (μ_{k+1}, π_{k+1}) at the node where it ends."""

    minus: Momenta
    plus: Momenta


class MomentumMaps(NamedTuple):
    """J⁻ and J⁺ ∈ 𝔤* of a step, shapes (…, dim)."""

    minus: Array
    plus: Array


def discrete_legendre(system: System, method: Method, records: State, h: Scalar) -> Transforms:
    """F⁻ and F⁺ of the steps that start at records, a state or states with a leading axis, such as run.records.

        μ_k = D^R_FΛ − ∂_aΛ⋄a − ∂_nΛ⋄n − ∂_sΛ⋄s − T⁻,   π_k = −∂_nΛ − φ⁻
        μ_{k+1} = D^L_FΛ + T⁺,                          π_{k+1} = F*∂_sΛ + φ⁺

    They are taken from the unknowns ξ, ν of a record and never from its μ, π; Λ is differentiated anew from the
    definition of the rule, and forces enter by their virtual work. On a run F⁺ of a step is F⁻ of the next: that is
    (P42). For a composition F⁻ is that of its first stage and F⁺ that of its last; the stages between are solved again,
    record after record. `h`: the step of the run (s). Raises ArgumentError for methods without a discrete Lagrangian,
    for parameters of co.each and for records that are nearer than h, as after an event; StepError where a stage has no
    solution.
    """
    return _steps(system, method, records, h).transforms


def discrete_momentum_maps(system: System, method: Method, records: State, h: Scalar) -> MomentumMaps:
    """J⁻ = Ad*_{g_k⁻¹}(μ_k − π_k⋄n_k) by F⁻, J⁺ = Ad*_{g_{k+1}⁻¹}(μ_{k+1} − π_{k+1}⋄n_{k+1}) by F⁺, in the space frame.

    ⟨J⁻, η⟩ = −⟨D₁L, η·(g, q)⟩ and ⟨J⁺, η⟩ = ⟨D₂L, η·(g⁺, q⁺)⟩ of the unreduced L, and the share of forces in each.
    Along η with η·a₀ = 0 both are equal where no force acts, and so are conserved (Noether). Arguments as those of
    `discrete_legendre`; the last row of J⁺ belongs to the node after the last record, as that of F⁺.
    """
    found = _steps(system, method, records, h)
    spatial = partial(_spatial, system)
    for _ in range(np.ndim(records.t)):
        spatial = jax.vmap(spatial)
    starts = records.g, records.n
    return MomentumMaps(*(evaluate(spatial, *pair) for pair in zip((starts, found.end), found.transforms, strict=True)))


def link_momentum_maps(system: System, g: Element, link: Link, h: Scalar) -> MomentumMaps:
    """J⁻ and J⁺ of a step of Λ in group form that starts at g, (dim,) each; traceable by JAX.

    They are those of `left_momenta` and `right_momenta`. h: the length of the step, one number, s.
    """
    after = system.group.compose(g, link.F), advected(system, link)[0]
    here = _spatial(system, (g, link.n), left_momenta(system, link, h))
    return MomentumMaps(here, _spatial(system, after, right_momenta(system, link, h)))


def _spatial(system: System, place: tuple[Element, Array], momenta: Momenta) -> Array:
    """Ad*_{g⁻¹}(μ − π⋄n)."""
    group, (g, n) = system.group, place
    return group.Ad_dual(group.inverse(g), momenta.mu - system.additional.diamond(group, momenta.pi, n))


class _Done(NamedTuple):
    """The transforms of a step, and (g_{k+1}, n_{k+1})."""

    transforms: Transforms
    end: tuple[Element, Array]


def _steps(system: System, method: Method, records: State, h: Scalar) -> _Done:
    require_one(system)
    _require_whole(method, records, h)
    stages = [(step, fraction * h) for step, fraction in method.stages if not step.tolerant]
    if len(stages) == 1:
        step, size = stages[0]
        return records.each(lambda record: _done(system, step, record, size))
    if np.ndim(records.t) == 0:
        return _composed(system, stages, records)(records)
    lead = np.shape(records.t)
    first, *rest = (jax.tree.map(lambda leaf, at=at: leaf[at], records) for at in np.ndindex(lead))
    composed = _composed(system, stages, first)
    found = map(composed, (first, *rest))
    return jax.tree.map(lambda *leaves: np.reshape(np.stack(leaves), (*lead, *np.shape(leaves[0]))), *found)


def _require_whole(method: Method, records: State, h: Scalar) -> None:
    """Raise ArgumentError where records are nearer to each other than h, so that a step between them was another."""
    if method.variable or not np.ndim(records.t) or traced(records.t, h):
        return
    gaps = np.diff(records.t, axis=-1) / h
    if np.any(gaps < 1 - 1e-6):
        raise ArgumentError(
            f"The records must be h = {h:g} s or more apart, but some are {np.min(gaps) * h:g} s: give the `h` of the "
            "run, and of a run that ended at an event leave out the last two records."
        )


def _done(system: System, step: Step, record: State, h: Scalar) -> _Done:
    """A stage from the unknowns of its record."""
    slopes = slopes_of(system, step, h, record)
    end = system.group.compose(record.g, slopes.link.F), advected(system, slopes.link)[0]
    return _Done(Transforms(*legendre_transforms(system, slopes)), end)


def _stage(system: System, step: Step, record: State, h: Scalar) -> tuple[_Done, State]:
    """A stage, and the state after it with the momenta F⁺."""
    done = _done(system, step, record, h)
    right = done.transforms.plus
    return done, step.advance(system, record, h).replace(mu=right.mu, pi=right.pi)


def _composed(system: System, stages: list[tuple[Step, Scalar]], like: State) -> Callable[[State], _Done]:
    """A step of several stages: the first from its record, the others solved anew; each kind is traced once."""
    kinds: dict[object, Callable[..., PyTree]] = {}

    def solved(step: Step, state: State, h: Scalar):
        def residual(z: Array) -> Array:
            return step.residual(system, state, h, z)

        root = solver.solve(residual, step.guess(system, state, h), h, step.blocks(system))
        return root.code, *_stage(system, step, step.record(system, state, h, root.unknowns), h)

    (step, size), *rest = stages
    begin = tabulate(partial(_stage, system, step), like, size)

    def through(record: State) -> _Done:
        first, state = begin(record, size)
        last = first
        for step, size_here in rest:
            if step not in kinds:
                kinds[step] = tabulate(partial(solved, step), state, size_here)
            code, last, state = kinds[step](state, size_here)
            if code != Code.CONVERGED:
                raise StepError(
                    f"A stage of {type(step).__name__} in the step from t = {float(record.t):g} s has no solution that "
                    "Newton's method finds from the unknowns of the record: give the `h` of the run."
                )
        return _Done(Transforms(first.transforms.minus, last.transforms.plus), last.end)

    return through
