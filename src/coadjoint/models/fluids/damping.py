"""Viscosity, drag and steady stirring of fluids on the sphere, by Strang splitting around isospectral steps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods import IsospectralMidpoint
from coadjoint.methods.isospectral_end import RightSides
from coadjoint.methods.method import Claims
from coadjoint.models.fluids.euler import planetary, size_of
from coadjoint.models.fluids.harmonics import checked, from_coefficients, on_diagonal
from coadjoint.models.fluids.laplacian import skewed, straight

LARGEST = 2**29
"""The most bytes that the harmonics of viscosity may take."""


@dataclass(frozen=True)
class DampedMidpoint(IsospectralMidpoint):
    """Fluids on the sphere with viscosity, drag and stirring: order 2, symmetric.

        ∂ω/∂t = −{ψ, ω + 2Ωz} + ν(Δ + 2)ω − αω + f

    A step is half a step of the last three terms, one of co.IsospectralMidpoint, and again half a step of the three
    (Strang). They are solved exactly, by degrees:

        c_lm(t) = e^{λt} c_lm(0) + f_lm (e^{λt} − 1)/λ,   λ = −ν(l(l + 1) − 2) − α,   l ≥ 1,

    so that each degree of a decaying flow decays at its own rate whatever the step. ω is the relative vorticity; a
    solid rotation feels no viscosity. Neither energy nor Casimirs are conserved. Steps back in time are the inverses of
    those forward, as the method is symmetric, and amplify round-off by e^{−λt}: `co.trajectory` refuses more than 10⁸.

    viscosity: ν, radii of the sphere squared over s, by default 0. drag: α, 1/s, by default 0. stirring: c_lm of f,
    (L, L) with L ≤ N, 1/s², c_00 = 0, by default none. Others as of co.IsospectralMidpoint.
    Raises ArgumentError for other values, unless `fluid` is a fluid on the sphere, and where the harmonics of
    viscosity, 8N³ bytes, would take more than 0.5 GB. Source: Lindborg and Nordmark, Two-dimensional turbulence on a
    sphere, J. Fluid Mech. 933 (2022), of ν(Δ + 2); Strang, SIAM J. Numer. Anal. 5 (1968).
    """

    viscosity: float = 0.0
    drag: float = 0.0
    stirring: Any = None

    def __post_init__(self):
        super().__post_init__()
        for name in ("viscosity", "drag"):
            object.__setattr__(self, name, checks.not_negative(getattr(self, name), name))
        if self.stirring is not None:
            c = checked(self.stirring, "stirring")
            if c.ndim != 2 or c[0, 0] != 0:
                raise ArgumentError("Argument `stirring` must be c_lm, (L, L), with c_00 = 0.")
            object.__setattr__(self, "stirring", tuple(map(tuple, c.tolist())))

    @property
    def title(self) -> str:
        words = [f"{name}={getattr(self, name):g}" for name in ("viscosity", "drag") if getattr(self, name)]
        return f"DampedMidpoint({', '.join([*words, *(['stirring'] if self.stirring else [])])})"

    @property
    def claims(self) -> Claims:
        if not (self.viscosity or self.drag or self.stirring):
            return super().claims
        return super().claims._replace(symplectic=False, momentum=False, energy="changed")

    def damping_rate(self, system: System) -> float:
        """That of the highest degree, ν(N(N − 1) − 2) + α, 1/s."""
        size = size_of(system)
        return self.viscosity * max(size * (size - 1) - 2, 0) + self.drag

    def require_fit(self, system: System) -> None:
        super().require_fit(system)
        size = size_of(system)
        if system.advected.ambient(system.group):
            raise ArgumentError("DampedMidpoint damps vorticity alone: take a fluid that carries nothing, as euler(N).")
        if (self.viscosity or self.stirring) and 8 * size**3 > LARGEST:
            raise ArgumentError(
                f"The harmonics of viscosity and stirring at N = {size} would take {8 * size**3 / 1e9:.3g} GB: take N "
                f"up to {int(np.cbrt(LARGEST / 8))}, or drag alone."
            )

    def _settled(self, system: System, state: State, t: Scalar) -> State:
        """The state after damping and stirring alone for the time t."""
        rest = planetary(system)
        omega = state.mu - rest
        if not self.viscosity and not self.stirring:
            return state.replace(mu=rest + jnp.exp(-self.drag * t) * omega)
        size = size_of(system)
        l, harmonics = _harmonics(size)
        x = -(self.viscosity * (l * (l + 1.0) - 2) + self.drag) * t
        parts = jnp.einsum("jil,ij->lj", harmonics, skewed(omega.reshape(size, size)))
        parts = jnp.where(l == 0, 1.0, jnp.exp(x)) * parts
        if self.stirring:
            forced = skewed(jnp.asarray(from_coefficients(size, np.array(self.stirring)).reshape(size, size)))
            safe = jnp.where(x == 0, 1.0, x)
            mean = jnp.where(x == 0, 1.0, jnp.expm1(safe) / safe)
            parts = parts + t * mean * jnp.einsum("jil,ij->lj", harmonics, forced)
        columns = jnp.einsum("jil,lj->ij", harmonics, parts)
        return state.replace(mu=rest + straight(columns).reshape(-1))

    def evaluated(self, system: System, state: State, h: Scalar, z: Array) -> tuple[Array, RightSides]:
        return super().evaluated(system, self._settled(system, state, 0.5 * h), h, z)

    def advance(self, system: System, record: State, h: Scalar) -> State:
        inner = super().advance(system, self._settled(system, record, 0.5 * h), h)
        return self._settled(system, inner, 0.5 * h)

    def balance(self, system: System, record: State, h: Scalar, after: State) -> Array:
        """That of the isospectral step inside, one number."""
        inner = self._settled(system, record, 0.5 * h)
        return super().balance(system, inner, h, super().advance(system, inner, h))


@lru_cache(maxsize=2)
def _harmonics(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Degrees (N, N), l by columns j, and orthonormal vectors (j, i, l): diagonals m = j and j − N of all T_lm.

    Of a column, the first N − j entries are diagonal j and the others diagonal j − N, as in `laplacian.skewed`.
    """
    degrees, found = np.zeros((size, size)), np.zeros((size, size, size))
    for j in range(size):
        for m, begin in ((j, 0), (size - j, size - j)):
            if m < size:
                part = slice(begin, begin + size - m)
                degrees[part, j] = np.arange(m, size)
                found[j, part, part] = on_diagonal(size, m) * np.sqrt(4 * np.pi / size)
    return degrees, found
