"""Principal connections on M × G in local form: spaces of shapes, horizontal velocities, curvature."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

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
from coadjoint.spaces import Several, Space, Trivial
from coadjoint.spaces.space import checked_vector

ROUND_OFF = 1e-9
"""How far an identity may be off at random values, relative to its terms."""
OUTSIDE = 1e-9
"""How far outside of a curved space of shapes a point may be."""


@dataclass(frozen=True)
class Bundle:
    """M × G with a space of shapes M ⊂ ℝᵐ.

    group: G. size: m, at least 1, the length of arrays of shapes. shapes: M, a space or a dictionary of spaces, by
    default ℝᵐ. Where G acts on a part q of M, the shape is x = g⁻¹q, and ẋ its rate in the body frame.
    """

    group: LieGroup
    size: int
    shapes: Space | Mapping[str, Space] | None = field(default=None, kw_only=True)

    def __post_init__(self):
        checks.instance(self.group, "group", LieGroup, "a Lie group such as co.SO3()", error=GroupError)
        checks.whole(self.size, "Argument `size`, the number of shape coordinates,")
        M = Trivial(self.size) if self.shapes is None else self.shapes
        M = Several(M) if isinstance(M, Mapping) else M
        checks.instance(M, "shapes", Space, "a space of shapes such as co.Sphere(co.Trivial(3))")
        object.__setattr__(self, "shapes", M)
        M.require_fit(self.group)
        if M.ambient(self.group) != self.size:
            raise ArgumentError(
                f"Argument `size` must be the length of arrays of shapes, {M.ambient(self.group)} in {M!r}, but is "
                f"{self.size}."
            )

    @property
    def _M(self) -> Space:
        """M as a space, which `shapes` is once the bundle is made."""
        return self.shapes if isinstance(self.shapes, Space) else Trivial(self.size)

    def project(self, x: Array, b: Array) -> Array:
        """The part of b along M at x, both (m,)."""
        return self._M.project(self.group, x, b)

    def shape(self, x: ArrayLike, name: str) -> np.ndarray:
        """A point of M, (m,); raises ArgumentError for another one."""
        found = np.asarray(checked_vector(x, self.size, name))
        self.require_shapes(found[None], name)
        return found

    def require_shapes(self, x: np.ndarray, name: str) -> None:
        """Raise ArgumentError unless shapes, (k, m), lie in M."""
        if self._M.flat:
            return
        off = evaluate(jax.vmap(lambda x: jnp.asarray(self._M.defect(self.group, x), dtype=float)), x)
        if not np.max(off) <= OUTSIDE:
            raise ArgumentError(f"Argument `{name}` must lie in {self._M!r}, but is off by {np.max(off):.1e}.")


@dataclass(frozen=True)
class Connection(Bundle):
    """A principal connection 𝒜(g, x)(ġ, ẋ) = Ad_g(g⁻¹ġ + A(x)ẋ) on M × G, with M ⊂ ℝᵐ a space of shapes.

    group: G. size: m, at least 1. form: a function x (m,) → A(x) (dim G, m) in terms of jax.numpy, smooth about M.
    shapes: M, by default ℝᵐ: a space, as `additional` of a system. Horizontal motions, 𝒜 = 0, turn with
    g⁻¹ġ = −A(x)ẋ; g⁻¹ġ + A(x)ẋ is the vertical part of a motion. Raises GroupError, ArgumentError and LagrangianError
    for what does not fit.
    """

    form: Callable[[Array], Array]

    def __post_init__(self):
        super().__post_init__()
        x = random_shapes(self._M, self.group, 1)[0]
        found = results(trace(self.form, "The form A(x) of a connection", (x,)))
        if len(found) != 1 or found[0].shape != (self.group.dim, self.size):
            shown = ", ".join(str(value.shape) for value in found)
            raise ArgumentError(
                f"The form A(x) of a connection on {self.group!r} with {self.size} shape coordinates must have shape "
                f"({self.group.dim}, {self.size}), but has shape {shown}."
            )

    def __call__(self, x: ArrayLike) -> np.ndarray:
        """A(x), shape (dim G, m), of a shape x (m,); on a curved M the part along M."""

        def along(x: Array) -> Array:
            return jax.vmap(lambda row: self.project(x, row))(self.form(x))

        return finite(evaluate(along, self.shape(x, "x")), "The connection")

    def velocity(self, x: Array, v: Array) -> Array:
        """g⁻¹ġ = −A(x)ẋ, (dim G,), of the horizontal motion at x (m,) with shape velocity v (m,)."""
        return -self.form(x) @ v

    def curvature(self, x: ArrayLike) -> np.ndarray:
        """B(u, v) = DA(u)v − DA(v)u − [A u, A v] at x (m,) as an array (dim G, m, m).

        The holonomy of a small loop with sides εu, then εv is exp(−ε²B(u, v)) up to ε³. Of shapes (k, m), one for each.
        On a curved M only the parts of u and v along M count.
        """

        def bent(x: Array):
            slope = jnp.swapaxes(jax.jacfwd(self.form)(x), 1, 2)
            columns = self.form(x).T
            brackets = jax.vmap(lambda u: jax.vmap(lambda v: self.group.ad(u, v))(columns))(columns)
            whole = slope - jnp.swapaxes(slope, 1, 2) - jnp.moveaxis(brackets, 2, 0)
            along = jax.vmap(lambda e: self.project(x, e))(jnp.eye(self.size))
            return jnp.einsum("ui,gij,vj->guv", along, whole, along)

        at = checks.array(x, "x", (self.size,), f"(k, {self.size})")
        self.require_shapes(np.atleast_2d(at), "x")
        return finite(evaluate(bent if at.ndim == 1 else jax.vmap(bent), at), "The curvature")


def random_shapes(space: Space, group: LieGroup, count: int) -> np.ndarray:
    """Shapes x of M at which functions of the user are tried, (count, m); on a curved M all near the first."""
    random = np.random.default_rng(1935)
    if space.flat:
        found = np.stack([space.sample(group, random) for _ in range(count)])
        return 0.5 * found if space.affine else found
    x = space.sample(group, random)
    along = random.normal(scale=0.3, size=(count - 1, len(x)))

    def near(u: Array) -> Array:
        return x + space.difference(group, x, space.project(group, x, u))

    return np.stack([x, *(evaluate(near, u) for u in along)])


def finite(value: object, what: str) -> PyTree:
    """The value itself; raises ArgumentError where a number in it is not finite."""
    if not all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(value)):
        raise ArgumentError(f"{what} is not finite at these shapes.")
    return value
