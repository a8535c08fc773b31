"""Powers of a group: many links of one kind, with an axis of links instead of a list of factors."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import GroupError
from coadjoint.groups.group import Element, LieGroup

COUPLINGS = ("chain", "ring", "all")


@dataclass(frozen=True, init=False)
class Power(LieGroup):
    """Gᴺ, a chain of N links with one group each: `co.Power(co.SE3(), 200)`.

    An element has the leaves of an element of G with a leading axis of links, as R (N, 3, 3) and x (N, 3); ξ and μ are
    the links' coordinates end to end, (N·dim G,), and ℓ, ℋ and forces get them as (N, dim G). All operations are those
    of G, mapped over the links; there is no basis and there are no structure constants.

    factor: G, a Lie group. count: N, from 1. coupling: which links act on each other, "chain" (the default), each on
    the next; "ring", and the last on the first; "all"; or pairs of links, as in [(0, 1), (1, 5)]. The equations of a
    step are solved by it, with as many operations as there are links (`kernels.newton.coupled`), and at the start of a
    run it is compared with the equations.

    Raises GroupError unless `factor` is a LieGroup, `count` a number of links and `coupling` one of those listed.
    """

    factor: LieGroup
    count: int
    coupling: str | tuple[tuple[int, int], ...]

    def __init__(self, factor: LieGroup, count: int, coupling: str | Iterable[tuple[int, int]] = "chain"):
        checks.instance(factor, "Argument `factor` of Power", LieGroup, "a Lie group such as SO3()", error=GroupError)
        if isinstance(factor, Power):
            raise GroupError(
                f"Argument `factor` of Power must not be a power itself, but is {factor!r}: take "
                f"Power({factor.factor!r}, {factor.count} * …) with pairs of links as `coupling`."
            )
        checks.whole(count, "Argument `count` of Power", 1, error=GroupError)
        object.__setattr__(self, "factor", factor)
        object.__setattr__(self, "count", int(count))
        object.__setattr__(self, "coupling", _coupling(coupling, int(count)))

    @property
    def basis(self) -> np.ndarray:
        raise GroupError(
            f"{self!r} has no basis, because it would take dim²·N² numbers: that of a link is factor.basis."
        )

    @property
    def dim(self) -> int:
        return self.count * self.factor.dim

    @property
    def matrix_size(self) -> int:
        """The size of the matrix of one link."""
        return self.factor.matrix_size

    @property
    def leaf_names(self) -> tuple[str, ...]:
        return self.factor.leaf_names

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """The links that act on each other, each pair once; of "all" raises GroupError."""
        if isinstance(self.coupling, tuple):
            return self.coupling
        if self.coupling == "all":
            raise GroupError(
                f"{self!r} has no list of pairs, because all links act on each other: give the pairs that are meant, "
                "as in co.spaces.RelativePoses([(0, 1), (1, 2)])."
            )
        chain = tuple((i, i + 1) for i in range(self.count - 1))
        return (*chain, (0, self.count - 1)) if self.coupling == "ring" and self.count > 2 else chain

    def view(self, xi: Array) -> Array:
        """ξ or μ (N·dim G,) as the user's functions see it, (N, dim G)."""
        return jnp.reshape(xi, (self.count, -1))

    def each(self, function: Callable[..., object], *arguments: object) -> PyTree:
        """`function` of every link's part of these arguments, with a leading axis of links.

        Arguments are elements, or vectors and covectors of any number of numbers a link, end to end.
        """
        return jax.vmap(function)(*(self._links(argument) for argument in arguments))

    def _links(self, argument: Any) -> PyTree:
        vector = hasattr(argument, "ndim") and argument.ndim == 1
        return jnp.reshape(argument, (self.count, -1)) if vector else argument

    def _vectors(self, function: Callable[..., object], *arguments: object) -> Array:
        return jnp.reshape(self.each(function, *arguments), -1)

    def identity(self) -> Element:
        return jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (self.count, *jnp.shape(leaf))), self.factor.identity())

    def compose(self, g: Element, h: Element) -> Element:
        return jax.vmap(self.factor.compose)(g, h)

    def inverse(self, g: Element) -> Element:
        return jax.vmap(self.factor.inverse)(g)

    def matrix(self, g: Element) -> Array:
        """The matrices of the links, (N, n, n)."""
        return jax.vmap(self.factor.matrix)(g)

    def from_matrix(self, matrix: Array) -> Element:
        """The element of the matrices of the links, (N, n, n)."""
        return jax.vmap(self.factor.from_matrix)(matrix)

    def tangent(self, xi: Array) -> Element:
        return self.each(self.factor.tangent, xi)

    def hat(self, xi: Array) -> Array:
        """ξ̂ of every link, (N, n, n)."""
        return self.each(self.factor.hat, xi)

    def vee(self, matrix: Array) -> Array:
        """The coordinates of matrices of the links (N, n, n), end to end."""
        return jnp.reshape(jax.vmap(self.factor.vee)(matrix), -1)

    def Ad(self, g: Element, xi: Array) -> Array:
        return jnp.reshape(jax.vmap(self.factor.Ad)(g, self.view(xi)), -1)

    def Ad_dual(self, g: Element, mu: Array) -> Array:
        return jnp.reshape(jax.vmap(self.factor.Ad_dual)(g, self.view(mu)), -1)

    def ad(self, xi: Array, eta: Array) -> Array:
        return self._vectors(self.factor.ad, xi, eta)

    def ad_dual(self, xi: Array, mu: Array) -> Array:
        return self._vectors(self.factor.ad_dual, xi, mu)

    def exp(self, xi: Array) -> Element:
        return self.each(self.factor.exp, xi)

    def _log(self, g: Element) -> Array:
        return jnp.reshape(jax.vmap(self.factor.log)(g), -1)

    def rotation_angle(self, xi: Array) -> Array | float:
        return jnp.max(jnp.asarray(self.each(lambda one: jnp.asarray(self.factor.rotation_angle(one)), xi)))

    @property
    def constrained(self) -> bool:
        return self.factor.constrained

    def project(self, g: Element) -> Element:
        return jax.vmap(self.factor.project)(g) if self.constrained else super().project(g)

    def defect(self, g: Element) -> Array:
        return jnp.max(jax.vmap(self.factor.defect)(g)) if self.constrained else super().defect(g)

    def outside(self, g: Element) -> Array:
        return jnp.max(jax.vmap(self.factor.outside)(g))


def require_one_matrix(group: LieGroup, what: str) -> None:
    """Raise GroupError for a power, whose elements have a matrix for each link, within another group, `what`."""
    if isinstance(group, Power):
        raise GroupError(
            f"{what} must not hold a power, but got {group!r}: take Power({what}(…), {group.count}), whose links are "
            "such groups, and everything else in `additional` or `advected`."
        )


def _coupling(coupling: Any, count: int) -> str | tuple[tuple[int, int], ...]:
    """ "chain", "ring", "all", or pairs (i, j) with i < j, each once and in order; raises GroupError."""
    if isinstance(coupling, str):
        fits = coupling in COUPLINGS
        checks.expect(
            fits, coupling, "Argument `coupling` of Power", '"chain", "ring", "all" or pairs of links', GroupError
        )
        return coupling
    given: Any = np.zeros(0)
    with suppress(TypeError, ValueError):
        given = np.asarray(list(coupling))
    if given.size == 0 and isinstance(coupling, (list, tuple)):
        return ()
    fits = given.ndim == 2 and given.shape[-1] == 2 and (given.dtype.kind in "iu")
    checks.expect(
        fits, coupling, "Argument `coupling` of Power", "a list of pairs of links, as in [(0, 1), (1, 5)]", GroupError
    )
    wrong = given[np.any((given < 0) | (given >= count), axis=1) | (given[:, 0] == given[:, 1])]
    if len(wrong):
        raise GroupError(
            f"The pair {tuple(map(int, wrong[0]))} of `coupling` must be of two links from 0 to {count - 1}, and of "
            "different ones."
        )
    return tuple(sorted({(min(pair), max(pair)) for pair in given.tolist()}))
