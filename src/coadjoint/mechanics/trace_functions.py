"""Casimir functions of matrix algebras as traces of products: the only ones that large groups have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups import SO3, SOn, SUn, Un
from coadjoint.groups.unitary import ComplexMatrix, product
from coadjoint.mechanics.invariance import group_of
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.spaces import Adjoint, ByInverse, Coadjoint, Several


@dataclass(frozen=True)
class TraceCasimir:
    """tr(MΘᵏ⁻¹), one number, of a state: M = Θ, or M = W of the momentum.

    On U(n) and SU(n) of the Hermitian matrices −iW, −iΘ; on SO(n) (−1)^{k/2} times that of W, Θ themselves.
    power: k. field: which of the advected parameters Θ is, −1 for W. with_momentum: whether M is W.
    """

    power: int
    field: int = -1
    with_momentum: bool = False

    def __call__(self, state: State) -> Array:
        """The value at a state, one number."""
        group = group_of(state.places)
        dim = group.dim
        theta = state.mu if self.field < 0 else state.a[self.field * dim : (self.field + 1) * dim]
        base, first = (_matrix(group, x) for x in (theta, state.mu if self.with_momentum else theta))
        for _ in range(self.power - 1):
            first = product(first, base)
        sign = (-1.0) ** (self.power // 2) if isinstance(group, (SOn, SO3)) else 1.0
        return sign * jnp.trace(first.real)

    def __str__(self) -> str:
        theta = "W" if self.field < 0 else "Θ"
        return f"tr({'W' if self.with_momentum else theta} {theta}^{self.power - 1})"


def trace_casimirs(system: System, degree: int = 4) -> dict[str, TraceCasimir]:
    """Casimir functions tr Wᵏ, or with an advected parameter Θ tr Θᵏ and tr WΘᵏ⁻¹, on U(n), SU(n), SO(n) of any n.

        run = co.simulate(system.watching(co.mechanics.trace_casimirs(system)), start, dt=0.01, steps=100, method=…)

    Returns functions of a state by name for `system.watching`: `trace_mu_k`, or of advected=co.Coadjoint() `trace_a_k`
    and `trace_mu_a_k`, of a dictionary by its names. With several advected parameters the spectrum of each is kept,
    and tr WΘᵏ⁻¹ is not. k goes from 2, and of tr WΘᵏ⁻¹ from 1 on U(n), to `degree`, on SO(n) over even numbers.
    system: on co.Un, co.SUn, co.SOn or co.SO3, left- or right-invariant. degree: the largest k ≥ 2, an integer, by
    default 4. Raises ArgumentError for others.
    """
    checks.whole(degree, "degree", 2)
    group, V = group_of(system.places), system.advected
    if not isinstance(group, (Un, SUn, SOn, SO3)):
        raise ArgumentError(
            f"co.mechanics.trace_casimirs needs a system on co.Un, co.SUn, co.SOn or co.SO3, but got {group!r}: "
            "use co.mechanics.casimirs(system)."
        )
    names, spaces = (V.names, V.factors) if type(V) is Several else (("a",), (V,))
    if not V.ambient(system.group):
        names, spaces = (), ()
    plain = [space.space if isinstance(space, ByInverse) else space for space in spaces]
    if not all(isinstance(space, (Adjoint, Coadjoint)) for space in plain):
        raise ArgumentError(
            f"co.mechanics.trace_casimirs needs advected parameters in co.Coadjoint(), but got {shown(V)}: "
            "use co.mechanics.casimirs(system)."
        )
    powers = range(2, degree + 1, 2 if isinstance(group, (SOn, SO3)) else 1)
    if not names:
        return {f"trace_mu_{k}": TraceCasimir(k) for k in powers}
    found = {f"trace_{name}_{k}": TraceCasimir(k, i) for i, name in enumerate(names) for k in powers}
    if len(names) == 1:
        cross = [1, *powers] if isinstance(group, Un) else powers
        found |= {f"trace_mu_{names[0]}_{k}": TraceCasimir(k, 0, True) for k in cross}
    return found


def _matrix(group: Any, x: Array) -> ComplexMatrix:
    """−iX of U(n) and SU(n), X of SO(n), by parts (n, n), of coordinates x (dim,)."""
    if isinstance(group, (SOn, SO3)):
        X = group.hat(x)
        return ComplexMatrix(X, jnp.zeros_like(X))
    A, B = group.parts(x)
    return ComplexMatrix(B, -A)
