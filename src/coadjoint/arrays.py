"""The types of numbers, arrays and PyTrees in annotations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    import jax
    import numpy as np
    from numpy.typing import ArrayLike

    Array: TypeAlias = np.ndarray | jax.Array
    """An array of float64 of NumPy or JAX; a tracer is one of JAX."""

    Scalar: TypeAlias = float | Array
    """One number: of Python, or an array without axes, which may be traced."""

    Coordinates: TypeAlias = ArrayLike | Mapping[str, "Coordinates"]
    """The numbers of a point, a velocity or a covector as a user gives them: an array, a list, or both by names."""
else:  # read by type checkers alone
    Array = Scalar = Coordinates = Any

PyTree: TypeAlias = Any
"""Arrays in tuples, lists, dictionaries and registered dataclasses, as `jax.tree` walks them."""
