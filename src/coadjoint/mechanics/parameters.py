"""The parameters of a system: named float64 arrays, the leaves that one differentiates, varies and replaces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np
from jax.core import Tracer

from coadjoint.errors import ArgumentError
from coadjoint.mechanics.each import Each
from coadjoint.spaces.named import Named


@jax.tree_util.register_pytree_with_keys_class
class Parameters(Named):
    """Named parameters, `co.Parameters(mass=123.8, inertia=np.diag([5.46, 5.29, 5.72]))`, in SI units.

    Values are numbers, arrays, nested dictionaries of these, or `co.each` of them, kept as float64; float32 arrays,
    text and values that
    are not finite raise ArgumentError.
    """

    __slots__ = ()

    def __init__(self, **values: Any):
        super().__init__(**{name: _leaf(name, value) for name, value in values.items()})


def _leaf(name: str, value: Any) -> Any:
    if isinstance(value, Each):
        return value
    if isinstance(value, Mapping):
        return Parameters(**value)
    if isinstance(value, Named):
        return value if isinstance(value, Parameters) else Parameters(**value.asdict())
    return float64(value, f"Parameter `{name}`")


def float64(value: Any, name: str) -> Any:
    """A finite float64 array; raises ArgumentError with `name`. A float64 tracer passes as it is."""
    if isinstance(value, Tracer):
        if value.dtype != np.float64:
            raise ArgumentError(
                f"{name} must be float64, but is traced as {value.dtype}: wrap your own jit, grad or vmap in "
                "`with co.float64():` and pass Python floats or float64 arrays."
            )
        return value
    if getattr(value, "dtype", None) in (np.float32, np.float16):
        raise ArgumentError(
            f"{name} must be float64, but is {value.dtype}, which has lost digits already: 5.46 becomes 5.460000038; "
            "make it with NumPy, or with jax.numpy inside `with co.float64():`."
        )
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{name} must be a number or an array of numbers, but is {value!r}.") from error
    if not np.all(np.isfinite(array)):
        raise ArgumentError(f"{name} must be finite, but is {array.tolist()}.")
    return array
