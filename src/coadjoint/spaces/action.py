"""Open subsets of ℝᵐ, or charts of manifolds, on which a group acts by any smooth left action."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, GroupError, shown
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element
from coadjoint.groups.overrides import in_words
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.space import Space

_DRAWN = 2000
"""Random points among which those of a domain are looked for."""
_TESTED = 5
"""Points at which the axioms are tested."""
_NEAR = 0.3
"""The size of ξ in the elements exp(ξ) of the axioms: the action of a chart is defined near e alone."""
_AGREES = 1e-9
"""How far both sides of an axiom may be apart, relative to them."""
_SPACING, _SECANT = 1e-4, 1e-6
"""The distance of central differences, and how far they may be from derivatives, relative to these."""


@dataclass(frozen=True, init=False)
class Action(Space):
    """An open subset of ℝᵐ, or a chart of a manifold, on which G acts by any smooth left action.

        def moebius(g, z):  # SL(2) on the upper half plane, z = x + iy ↦ (az + b)/(cz + d)
            (a, b), (c, d) = g
            x, y = z
            size = (c * x + d) ** 2 + (c * y) ** 2
            return jnp.stack([(a * x + b) * (c * x + d) + a * c * y**2, y]) / size

        half_plane = Action(moebius, dim=2, domain=lambda z: z[1])

    The infinitesimal action ξ·x (P19), g·v, g*b, the diamond (P45) and their lifts are derivatives of the action.

    Arguments:
        act: (g, x) ↦ g·x, (dim,), in terms of jax.numpy, for g in the group's own form and x (dim,). It must be
            smooth, with e·x = x and (gh)·x = g·(h·x) for g and h near e: a chart may have poles and jumps elsewhere.
        dim: m, at least 1.
        domain: x ↦ one number, or an array of them, all positive inside the domain; by default all of ℝᵐ. The axioms
            are tested at random points inside, starts outside raise ArgumentError, and steps that leave it fail.

    Raises ArgumentError for other arguments; a system raises GroupError where an axiom does not hold, where the
    derivatives are not those of the values, and where none of 2000 random points of sizes 0.1 to 10 lies inside.
    """

    affine = False

    function: Callable[[Element, Array], PyTree]
    size: int
    domain: Callable[[Array], PyTree] | None

    def __init__(
        self,
        act: Callable[[Element, Array], PyTree],
        dim: int,
        domain: Callable[[Array], PyTree] | None = None,
    ):
        checks.function(act, "act", "a function (g, x) that returns g·x")
        if domain is not None:
            checks.function(domain, "domain", "a function of x, positive inside")
        object.__setattr__(self, "function", act)
        object.__setattr__(self, "size", checks.whole(dim, "dim"))
        object.__setattr__(self, "domain", domain)

    def __repr__(self) -> str:
        return f"Action({getattr(self.function, '__name__', 'act')}, dim={self.size})"

    def ambient(self, group: LieGroup) -> int:
        return self.size

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        """g·x, (dim,); NaN outside the domain, which makes a step that leaves it fail."""
        moved = jnp.asarray(self.function(g, x))
        return moved if self.domain is None else jnp.where(self._depth(x) > 0, moved, jnp.nan)

    def _depth(self, x: Array) -> Scalar:
        """The smallest number of the domain's function at x, positive inside."""
        if self.domain is None:
            return jnp.ones(())
        with in_words(f"`domain` of {self!r}"):
            return jnp.min(jnp.asarray(self.domain(x), dtype=float))

    def require_fit(self, group: LieGroup) -> None:
        """Raise GroupError unless `act` is a smooth left action near e, with derivatives that are those of its values.

        At random points of the domain e·x = x, (gh)·x = g·(h·x), g·(ξ·x) = (Ad_gξ)·(g·x), and ξ·x and g·v are compared
        with differences of values.
        """
        _require_smooth_action(self, group)

    def sample(self, group: LieGroup, random: np.random.Generator) -> np.ndarray:
        """A random point of the domain, (dim,)."""
        inside = _points(self, group)
        return inside[random.integers(len(inside))]

    def point(self, group: LieGroup, value: object, name: str) -> Array:
        array = super().point(group, value, name)
        if self.domain is not None and isinstance(array, np.ndarray):
            depth = float(evaluate(self._depth, array))
            if not depth > 0:
                raise ArgumentError(
                    f"Argument `{name}` must lie in the domain of {self!r}, where its function is positive, but at "
                    f"{shown(array.tolist())} that is {depth:.3g}."
                )
        return array


@lru_cache(maxsize=256)
def _points(space: Action, group: LieGroup) -> np.ndarray:
    """Random points of the domain, (count, dim), of sizes 0.1 to 10."""
    random = np.random.default_rng(1872)
    drawn = random.normal(size=(_DRAWN, space.size)) * 10.0 ** random.uniform(-1, 1, size=(_DRAWN, 1))
    depths = evaluate(jax.vmap(space._depth), drawn) if space.domain is not None else np.ones(_DRAWN)
    inside = drawn[depths > 0]
    if not len(inside):
        raise GroupError(
            f"None of {_DRAWN} random points with coordinates of sizes 0.1 to 10 lies in the domain of {space!r}: "
            "scale the coordinates."
        )
    return inside


@lru_cache(maxsize=256)
def _require_smooth_action(space: Action, group: LieGroup) -> None:
    random, inside = np.random.default_rng(1873), _points(space, group)[:_TESTED]
    etas = _NEAR * random.normal(size=(len(inside), 3, group.dim)) / np.sqrt(max(group.dim, 1))
    along = random.normal(size=inside.shape)
    what = f"`act` of {space!r} on {group!r}"
    with in_words(what):
        shape = jax.eval_shape(lambda x: space.act(group, group.identity(), x), inside[0]).shape
    checks.shape(np.empty(shape), what, (space.size,), error=GroupError)
    with in_words(what):
        sides = evaluate(jax.vmap(lambda *point: _axioms(space, group, *point)), etas, inside, along)
    for says, (found, expected, tolerance) in sides.items():
        if not (np.all(np.isfinite(found)) and np.all(np.isfinite(expected))):
            x = inside[int(np.argmax(~np.all(np.isfinite(found + expected), axis=-1)))]
            raise GroupError(
                f"{what} must have finite values and derivatives near g = e, but has none at x = "
                f"{shown(np.round(x, 4).tolist())}: declare the `domain` where it has."
            )
        off = np.max(np.abs(found - expected), axis=-1)
        size = np.maximum(np.max(np.abs(expected), axis=-1), 1.0)
        worst = int(np.argmax(off / (tolerance * size)))
        if off[worst] > tolerance[worst] * size[worst]:
            raise GroupError(
                f"{what} must satisfy {says}, but at x = {shown(np.round(inside[worst], 4).tolist())} it is off by "
                f"{off[worst]:.1e}: a right action becomes a left one with g⁻¹."
                if says.startswith("act")
                else f"{what} must satisfy {says}, but at x = {shown(np.round(inside[worst], 4).tolist())} it is off "
                f"by {off[worst]:.1e}: look for jax.lax.stop_gradient, or for a wrong jax.custom_jvp."
            )


def _axioms(space: Action, group: LieGroup, etas: Array, x: Array, v: Array) -> dict[str, tuple[Array, Array, Array]]:
    """By what each says: both sides and their tolerance."""
    g, h, xi = group.exp(etas[0]), group.exp(etas[1]), etas[2]
    turned, moving = space.act(group, g, x), space.infinitesimal(group, xi, x)

    def secant(function: Callable[[Scalar], Array]) -> Array:
        return (function(jnp.asarray(_SPACING)) - function(jnp.asarray(-_SPACING))) / (2 * _SPACING)

    exact, near = jnp.asarray(_AGREES), jnp.asarray(_SECANT)
    return {
        "act(e, x) = x": (space.act(group, group.identity(), x), x, exact),
        "act(gh, x) = act(g, act(h, x))": (
            space.act(group, group.compose(g, h), x),
            space.act(group, g, space.act(group, h, x)),
            exact,
        ),
        "g·(ξ·x) = (Ad_gξ)·(g·x)": (
            space.push(group, g, x, moving),
            space.infinitesimal(group, group.Ad(g, xi), turned),
            exact,
        ),
        "ξ·x = d/dε act(exp εξ, x)": (moving, secant(lambda e: space.act(group, group.exp(e * xi), x)), near),
        "g·v = D act(g, x)·v": (
            space.push(group, g, x, v),
            secant(lambda e: space.act(group, g, x + e * v)),
            near,
        ),
    }
