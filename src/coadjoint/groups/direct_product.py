"""Direct products of groups."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise

import jax.numpy as jnp
import jax.scipy.linalg
import numpy as np

from coadjoint.arrays import Array
from coadjoint.errors import GroupError
from coadjoint.groups.group import Element, LieGroup, require_group
from coadjoint.groups.power import require_one_matrix


@dataclass(frozen=True, init=False)
class DirectProduct(LieGroup):
    """G₁ × … × G_m; an element is the tuple of its factors' elements, ξ the factors' coordinates end to end.

    factors: groups, one at least, such as SO3(), SO2(). Raises GroupError unless each is a LieGroup.
    """

    factors: tuple[LieGroup, ...]

    def __init__(self, *factors: LieGroup):
        if not factors:
            raise GroupError("DirectProduct needs at least one factor: DirectProduct(SO3(), SO2()).")
        for factor in factors:
            require_group(factor, "A factor of DirectProduct")
            require_one_matrix(factor, "DirectProduct")
        object.__setattr__(self, "factors", tuple(factors))

    @property
    def basis(self) -> np.ndarray:
        size = sum(f.matrix_size for f in self.factors)
        basis = np.zeros((self.dim, size, size))
        row = corner = 0
        for factor in self.factors:
            end = corner + factor.matrix_size
            basis[row : row + factor.dim, corner:end, corner:end] = factor.basis
            row, corner = row + factor.dim, end
        return basis

    @property
    def dim(self) -> int:
        return sum(f.dim for f in self.factors)

    @property
    def leaf_names(self) -> tuple[str, ...]:
        return tuple(f"{name}_{i + 1}" for i, factor in enumerate(self.factors) for name in factor.leaf_names)

    def split(self, xi: Array) -> list[Array]:
        """The factors' parts of a vector or covector (dim,)."""
        ends = np.cumsum([0, *(f.dim for f in self.factors)])
        return [xi[a:b] for a, b in pairwise(ends)]

    def _vectors(self, name: str, vector: Array, arguments: Sequence[Element]) -> Array:
        parts = zip(self.factors, arguments, self.split(vector), strict=True)
        return jnp.concatenate([getattr(factor, name)(argument, part) for factor, argument, part in parts])

    def identity(self) -> Element:
        return tuple(f.identity() for f in self.factors)

    def compose(self, g: Element, h: Element) -> Element:
        return tuple(f.compose(a, b) for f, a, b in zip(self.factors, g, h, strict=True))

    def inverse(self, g: Element) -> Element:
        return tuple(f.inverse(a) for f, a in zip(self.factors, g, strict=True))

    def matrix(self, g: Element) -> Array:
        return jax.scipy.linalg.block_diag(*(f.matrix(a) for f, a in zip(self.factors, g, strict=True)))

    def from_matrix(self, matrix: Array) -> Element:
        ends = np.cumsum([0, *(f.matrix_size for f in self.factors)])
        corners = zip(self.factors, ends[:-1], ends[1:], strict=True)
        return tuple(f.from_matrix(matrix[a:b, a:b]) for f, a, b in corners)

    def tangent(self, xi: Array) -> Element:
        return tuple(f.tangent(part) for f, part in zip(self.factors, self.split(xi), strict=True))

    def Ad(self, g: Element, xi: Array) -> Array:
        return self._vectors("Ad", xi, g)

    def Ad_dual(self, g: Element, mu: Array) -> Array:
        return self._vectors("Ad_dual", mu, g)

    def ad(self, xi: Array, eta: Array) -> Array:
        return self._vectors("ad", eta, self.split(xi))

    def ad_dual(self, xi: Array, mu: Array) -> Array:
        return self._vectors("ad_dual", mu, self.split(xi))

    def exp(self, xi: Array) -> Element:
        return tuple(f.exp(part) for f, part in zip(self.factors, self.split(xi), strict=True))

    def _log(self, g: Element) -> Array:
        return jnp.concatenate([f.log(a) for f, a in zip(self.factors, g, strict=True)])

    def rotation_angle(self, xi: Array) -> Array | float:
        angles = [f.rotation_angle(part) for f, part in zip(self.factors, self.split(xi), strict=True)]
        return reduce(jnp.maximum, angles)

    @property
    def constrained(self) -> bool:
        """Whether any factor knows its defining equations; the others have no defect."""
        return any(f.constrained for f in self.factors)

    def project(self, g: Element) -> Element:
        return tuple(f.project(a) if f.constrained else a for f, a in zip(self.factors, g, strict=True))

    def defect(self, g: Element) -> Array:
        defects = [f.defect(a) for f, a in zip(self.factors, g, strict=True) if f.constrained]
        return reduce(jnp.maximum, defects) if defects else super().defect(g)

    def outside(self, g: Element) -> Array:
        return reduce(jnp.maximum, [f.outside(a) for f, a in zip(self.factors, g, strict=True)])

    def rotation(self, g: Element) -> Array | None:
        found = (f.rotation(a) for f, a in zip(self.factors, g, strict=True))
        return next((R for R in found if R is not None), None)
