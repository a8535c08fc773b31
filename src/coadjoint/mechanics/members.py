"""A value for each member of an ensemble, in the place of one value."""

from __future__ import annotations

import jax
from numpy.typing import ArrayLike

from coadjoint.arrays import PyTree
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import traced


class Each:
    """Values with a leading axis of members; made by `co.each`, a leaf wherever one value may stand."""

    def __init__(self, values: PyTree):
        self.values = values

    def __len__(self) -> int:
        return len(jax.tree.leaves(self.values)[0])

    def __repr__(self) -> str:
        return f"each({len(self)} values)"

    def __mul__(self, factor: float) -> Each:
        """The values in another unit, as `3.0 * …` of one number."""
        return Each(jax.tree.map(lambda leaf: leaf * factor, self.values))

    __rmul__ = __mul__

    def member(self, index: int) -> PyTree:
        """The value of one member."""
        return jax.tree.map(lambda leaf: leaf[index], self.values)


Quantity = ArrayLike | Each
"""A number or an array, nested lists included, or one for each member."""


def each(values: object) -> Each:
    """One value for each member of an ensemble, in the place of a single value.

        fleet = vehicle.replace(mass=co.each(np.linspace(110.0, 140.0, 1000)))
        co.simulate(fleet, start, dt=0.05, duration=60.0) # 1000 members together

    values: an array with a leading axis of members, (members, …); for group elements that are tuples, such as SE3's
    (R, x), a tuple of such arrays. It may stand for any parameter and any argument of `system.state`; all `co.each` of
    an ensemble have equally many members.

    Raises ArgumentError for values that are not finite float64 numbers with one leading axis, and inside jit, grad or
    vmap, where `jax.vmap` does this.
    """
    parts = values if isinstance(values, tuple) else (values,)
    if traced(parts):
        raise ArgumentError("co.each is for co.simulate; inside your own jit, grad or vmap use jax.vmap.")
    arrays = [float64(part, "The values of co.each") for part in parts]
    lengths = {array.shape[0] if array.ndim else 0 for array in arrays}
    if len(lengths) != 1 or lengths == {0}:
        raise ArgumentError(
            "co.each needs numbers with a leading axis of at least one member, but got shape "
            f"{', '.join(str(array.shape) for array in arrays)}."
        )
    return Each(tuple(arrays) if isinstance(values, tuple) else arrays[0])


def count_members(*trees: PyTree) -> int | None:
    """How many members the `Each` leaves stand for, None where there are none; raises ArgumentError if they differ."""
    lengths = {len(leaf) for leaf in jax.tree.leaves(trees) if isinstance(leaf, Each)}
    if len(lengths) > 1:
        raise ArgumentError(f"All co.each of an ensemble must hold equally many values, but hold {sorted(lengths)}.")
    return lengths.pop() if lengths else None


def member_of(tree: PyTree, index: int) -> PyTree:
    """The tree of one member."""
    return jax.tree.map(lambda leaf: leaf.member(index) if isinstance(leaf, Each) else leaf, tree)


def stacked(tree: PyTree) -> tuple[PyTree, PyTree]:
    """The tree with `Each` leaves as arrays, and the tree of axes for jax.vmap: 0 where there is a member axis."""
    values = jax.tree.map(lambda leaf: leaf.values if isinstance(leaf, Each) else leaf, tree)
    axes = jax.tree.map(lambda leaf: 0 if isinstance(leaf, Each) else None, tree)
    return values, axes
