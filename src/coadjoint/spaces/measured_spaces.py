"""The space of a measurement from what its function returns."""

from __future__ import annotations

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups import SE3, SO2, SO3, LieGroup
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.charts import CHARTS
from coadjoint.spaces.measured import Directions, Elements, MeasuredSpace, MeasuredTogether, Vectors
from coadjoint.spaces.sphere import Sphere

SIDES = ("body", "space")


def measured_space(space: PyTree, value: PyTree, side: str, coordinates: PyTree, what: str) -> MeasuredSpace:
    """The space of a measurement called `what`, whose function returns `value`, arrays or shapes.

    space, side, coordinates: as of `co.estimation.Measurement`. Raises ArgumentError where they do not fit.
    """
    if isinstance(space, (tuple, list)):
        charts = [None] * len(space) if coordinates is None else coordinates
        if not isinstance(value, (tuple, list)) or len(value) != len(space) or len(charts) != len(space):
            raise ArgumentError(
                f"{what} has {len(space)} spaces: its function returns a tuple of as many values, and `coordinates` "
                f"has as many parts, but there are {shown(jax.tree.map(np.shape, value))} and {shown(coordinates)}."
            )
        parts = zip(space, value, charts, strict=True)
        return MeasuredTogether([measured_space(one, part, side, chart, what) for one, part, chart in parts])
    checks.choice(side, f"`error_side` of {what}", SIDES)
    chart = (
        None if coordinates is None else checks.choice(coordinates, f"`coordinates` of {what}", (*CHARTS, "bearing"))
    )
    shapes = [np.shape(leaf) for leaf in jax.tree.leaves(value)]
    if isinstance(space, Sphere) and space == Sphere() and chart in (None, "bearing"):
        _require_shapes(shapes, [(3,)], what, "a direction, a vector (3,)")
        return Directions(chart == "bearing")
    if chart is not None and (chart == "bearing" or not isinstance(space, (SO3, SE3))):
        raise ArgumentError(
            f'`coordinates="{chart}"` of {what} is of {"co.Sphere()" if chart == "bearing" else "co.SO3() or co.SE3()"}'
            f", but its space is {space!r}."
        )
    if space is None or (isinstance(space, SO2) and shapes != [(2, 2)]):
        _require_shapes(shapes[1:], [], what, "one array")
        if not shapes or 0 in shapes[0]:
            raise ArgumentError(
                f"The function of {what} returns no number: there is nothing to measure. Of a system without "
                "`additional`, q and qdot of a motion are empty."
            )
        return Vectors(shapes[0], space is not None)
    if isinstance(space, LieGroup):
        wanted = [leaf.shape for leaf in jax.tree.leaves(evaluate(space.identity))]
        _require_shapes(shapes, wanted, what, f"an element of {space!r}, of the shapes {shown(wanted)}")
        return Elements(space, side, None if chart is None else CHARTS[chart])
    raise ArgumentError(
        f"`space` of {what} must be a group such as co.SO3(), co.Sphere() for directions, None for vectors, or a tuple "
        f"of these, but is {shown(space)}."
    )


def _require_shapes(shapes: list[tuple[int, ...]], wanted: list[tuple[int, ...]], what: str, words: str) -> None:
    if shapes != wanted:
        raise ArgumentError(f"The function of {what} must return {words}, but returns the shapes {shown(shapes)}.")
