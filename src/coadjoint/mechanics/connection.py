"""Principal connections on M × G in local form: horizontal velocities and curvature."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, GroupError
from coadjoint.groups import LieGroup
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.jaxprs import results
from coadjoint.mechanics.trace_checks import trace
from coadjoint.spaces.space import checked_vector

ROUND_OFF = 1e-9
"""How far an identity may be off at random values, relative to its terms."""


@dataclass(frozen=True)
class Connection:
    """A principal connection 𝒜(g, x)(ġ, ẋ) = Ad_g(g⁻¹ġ + A(x)ẋ) on M × G, with M = ℝᵐ a space of shapes.

    group: G. size: m, at least 1. form: a function x (m,) → A(x) (dim G, m) in terms of jax.numpy. Horizontal motions,
    𝒜 = 0, turn with g⁻¹ġ = −A(x)ẋ. Raises GroupError, ArgumentError and LagrangianError for what does not fit.
    """

    group: LieGroup
    size: int
    form: Callable[[Array], Array]

    def __post_init__(self):
        require_bundle(self.group, self.size)
        x = random_shapes(self.size, 1)[0]
        found = results(trace(self.form, "The form A(x) of a connection", (x,)))
        if len(found) != 1 or found[0].shape != (self.group.dim, self.size):
            shown = ", ".join(str(value.shape) for value in found)
            raise ArgumentError(
                f"The form A(x) of a connection on {self.group!r} with {self.size} shape coordinates must have shape "
                f"({self.group.dim}, {self.size}), but has shape {shown}."
            )

    def __call__(self, x: ArrayLike) -> np.ndarray:
        """A(x), shape (dim G, m)."""
        return finite(evaluate(self.form, checked_vector(x, self.size, "x")), "The connection")

    def velocity(self, x: Array, v: Array) -> Array:
        """g⁻¹ġ = −A(x)ẋ, (dim G,), of the horizontal motion at x (m,) with shape velocity v (m,)."""
        return -self.form(x) @ v

    def curvature(self, x: ArrayLike) -> np.ndarray:
        """B(u, v) = DA(u)v − DA(v)u − [A u, A v] at x (m,) as an array (dim G, m, m).

        The holonomy of a small loop with sides εu, then εv is exp(−ε²B(u, v)) up to ε³. Of shapes (k, m), one for each.
        """

        def bent(x: Array):
            slope = jnp.swapaxes(jax.jacfwd(self.form)(x), 1, 2)
            columns = self.form(x).T
            brackets = jax.vmap(lambda u: jax.vmap(lambda v: self.group.ad(u, v))(columns))(columns)
            return slope - jnp.swapaxes(slope, 1, 2) - jnp.moveaxis(brackets, 2, 0)

        at = checks.array(x, "x", (self.size,), f"(k, {self.size})")
        return finite(evaluate(bent if at.ndim == 1 else jax.vmap(bent), at), "The curvature")


def require_bundle(group: object, size: object) -> None:
    """Raise GroupError or ArgumentError unless G is a group and M = ℝᵐ with m ≥ 1."""
    checks.instance(group, "group", LieGroup, "a Lie group such as co.SO3()", error=GroupError)
    checks.whole(size, "Argument `size`, the number of shape coordinates,")


def random_shapes(size: int, count: int) -> np.ndarray:
    """Shapes x at which functions of the user are tried, (count, size)."""
    return np.random.default_rng(1935).normal(scale=0.5, size=(count, size))


def finite(value: object, what: str) -> PyTree:
    """The value itself; raises ArgumentError where a number in it is not finite."""
    if not all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(value)):
        raise ArgumentError(f"{what} is not finite at these shapes.")
    return value
