"""The residuals of the equations in group form on a trajectory: (P37) and (B8), (B13), (B19) and (B25)."""

from __future__ import annotations

from functools import partial
from typing import cast

import jax
import numpy as np

from coadjoint.arrays import Array, Scalar
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.noether import KelvinNoether
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.theory.euler_poincare import impulse
from coadjoint.theory.instant import Instant
from coadjoint.theory.poisson import (
    discrete_euler_poincare_poisson,
    kelvin_noether_poisson,
    poisson_lagrangian,
    poisson_link,
)
from coadjoint.theory.residuals import Residual, largest, pairs, row, scales
from coadjoint.theory.semidirect import discrete_euler_poincare_semidirect, semidirect_lagrangian, semidirect_link
from coadjoint.theory.slopes import Slopes
from coadjoint.theory.unreduced import Configuration, UnreducedLagrangian, discrete_euler_lagrange, has_points, link_of


def of_group_form(system: System, records: State, slopes: Slopes, h: Scalar, L: UnreducedLagrangian) -> list[Residual]:
    """(P37) and (B8) in the space frame."""
    group, _, V = system.places
    path = Configuration(records.g, records.q)
    a0 = evaluate(lambda s: V.act(group, s.g, s.a), jax.tree.map(lambda x: x[0], records))
    first, second = pairs(path)
    link, _ = pairs(slopes.link)

    def value(x: Configuration, y: Configuration, link):
        F, n, s, a, at = link
        below = system.reduced_group_lagrangian(F, n, s, a, h, at.t, at.inputs, at.internal)
        return L(x, y, a0, h, _seen(system, L, at)), below

    def stationary(x: Configuration, y: Configuration, z: Configuration, before, here):
        pair = _seen(system, L, before), _seen(system, L, here)
        return discrete_euler_lagrange(
            L, x, y, z, a0, h, pair, impulse(system, link_of(system.places, y, z, a0, here), h)
        )

    above, below = evaluate(jax.vmap(value), first, second, link)
    triple = [jax.tree.map(lambda x, cut=cut: x[cut], path) for cut in (slice(-2), slice(1, -1), slice(2, None))]
    on_group, on_space = evaluate(jax.vmap(stationary), *triple, *pairs(link.at))
    size = largest(slopes.right) + largest(slopes.along_s) * (1 + largest((slopes.link.n, slopes.link.s)))
    forced = system.forces is not None
    return [
        row("P37", "L(g_k, q_k, g_{k+1}, q_{k+1}, a₀) = Λ(F_k, n_k, s_k, a_k)", above - below, largest(below)),
        row("B8 g", f"D₃L_{{k−1}} + D₁L_k{' + T⁻_k' * forced} = 0", on_group, size),
        row("B8 q", f"D₄L_{{k−1}} + D₂L_k{' + g_k·φ⁻_k' * forced} = 0", on_space, scales(slopes)[1]),
    ]


def of_semidirect(system: System, slopes: Slopes, h: Scalar) -> list[Residual]:
    """(B13), where there are no advected parameters."""
    group, Q, V = system.places
    if not has_points(Q) or has_points(V) or not Q.flat:
        return []
    l, link = semidirect_lagrangian(system), partial(semidirect_link, group, Q)

    def both(before, here):
        return discrete_euler_poincare_semidirect(group, Q, l, link(before), link(here), h)

    on_group, on_space = evaluate(jax.vmap(both), *pairs(slopes.link))
    T, f = (" + T⁻_k − φ⁻_k⋄u_k", " + φ⁻_k") if system.forces is not None else ("", "")
    return [
        row(
            "B13 f", f"Ad*_{{f_k}}(D^Rl_k − D₂l_k⋄y_k){T} = D^Rl_{{k−1}} − D₂l_{{k−1}}⋄y_{{k−1}}", on_group,
            scales(slopes)[0],
        ),
        row("B13 u", f"f_k*D₂l_k + D₃l_{{k−1}}{f} = 0", on_space, largest(slopes.along_s)),
    ]  # fmt: skip


def of_poisson(system: System, records: State, slopes: Slopes, h: Scalar, noether: KelvinNoether) -> list[Residual]:
    """(B19) and (B25), where there are no additional dynamics."""
    group, Q, _ = system.places
    if has_points(Q):
        return []
    l, link = poisson_lagrangian(system), partial(poisson_link, group)

    def rows(before, here, record):
        K = noether.momentum_map(system, record)
        pair = link(before), link(here)
        return discrete_euler_poincare_poisson(l, *pair, h), *kelvin_noether_poisson(l, *pair, K, h), K

    later = jax.tree.map(lambda x: x[1:], records)
    equation, quantity, change, K = evaluate(jax.vmap(rows), *pairs(slopes.link), later)
    size = largest(slopes.right)
    T, source = (" − T⁻_k", "D₂l_k⋄a_k + T⁻_k") if system.forces is not None else ("", "D₂l_k⋄a_k")
    off = np.diff(quantity) - change[:-1]
    return [
        row("B19", f"Ad*_{{f_k}}D^Rl_k − D^Rl_{{k−1}} = −D₂l_k⋄a_k{T}", equation, size),
        row("B25", f"I_{{k+1}} − I_k = −⟨{source}, 𝒦_k⟩", off, size * largest(K) * group.dim),
    ]


def _seen(system: System, L: UnreducedLagrangian, at: Instant) -> Instant:
    """An instant as an L takes it that is not driven itself: with the inputs that the system sees there."""
    return (
        at
        if L.reduced.inputs is not None
        else Instant(at.t, system.inputs_at(cast(Array, at.t), at.inputs), at.internal)
    )
