"""Numbers that a user gives, as finite float64 arrays; otherwise one error explains what is wrong."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.errors import ArgumentError, CoadjointError, shown
from coadjoint.groups.group import Array
from coadjoint.kernels.trace.jaxprs import Tracer


def float64(value: Any, name: str) -> Array:
    """A finite float64 array from numbers, arrays and lists of these; raises ArgumentError with `name`.

    Floats of fewer digits, those of more where digits would be lost, complex numbers, text and booleans are refused.
    Float64 tracers pass.
    """
    if isinstance(value, Tracer):
        return _float64_tracer(value, name)
    leaves = jax.tree.leaves(value, is_leaf=lambda leaf: leaf is None)
    try:
        for leaf in leaves:
            if type(leaf) not in (float, int):
                _require_real(leaf, name)
    except CoadjointError:
        raise
    except Exception as error:  # Of an object that cannot be converted.
        raise ArgumentError(f"{name} must be a number or an array of numbers, but is {shown(value)}.") from error
    if any(isinstance(leaf, Tracer) for leaf in leaves):
        with jax.enable_x64(True):
            return jnp.asarray(value, dtype=np.float64)
    try:
        array = np.array(value, dtype=np.float64)
    except OverflowError as error:
        raise ArgumentError(f"{name} must be a number of at most 1.8e308 in size, but is {shown(value)}.") from error
    except Exception as error:
        raise ArgumentError(f"{name} must be a number or an array of numbers, but is {shown(value)}.") from error
    if not np.all(np.isfinite(array)):
        bad = np.sum(~np.isfinite(array))
        said = f"is {array.tolist()}" if array.size <= 9 else f"{bad} of its {array.size} numbers are not"
        raise ArgumentError(f"{name} must be finite, but {said}.")
    return array


def numeric(value: Any) -> bool:
    """Whether this is made of numbers, of whatever kind, and not of text, truth values, times or other objects."""
    if isinstance(value, (tuple, list)):
        return all(numeric(part) for part in value)
    try:
        return isinstance(value, Tracer) or np.asarray(value).dtype.kind not in "OSUbmM"
    except Exception:  # Of an object that cannot be converted.
        return False


def is_short(dtype: Any) -> bool:
    """Whether this is a type of floats with fewer digits than float64: float32, float16, bfloat16 and the like."""
    return bool(jnp.issubdtype(dtype, jnp.floating)) and np.dtype(dtype).itemsize < 8


def _float64_tracer(value: Tracer, name: str) -> Tracer:
    if value.dtype != np.float64:
        raise ArgumentError(
            f"{name} must be float64, but is traced as {value.dtype}: wrap your own jit, grad or vmap in "
            "`with co.float64():` and pass Python floats or float64 arrays."
        )
    return value


def _require_real(leaf: Any, name: str) -> None:
    """Raise ArgumentError unless a leaf, or every entry of an array of objects, is a real number with all digits."""
    if isinstance(leaf, Tracer):
        _float64_tracer(leaf, name)
        return
    if np.ma.is_masked(leaf):
        raise ArgumentError(
            f"{name} must have a value everywhere, but some of its entries are masked: fill them first."
        )
    array = leaf if hasattr(leaf, "dtype") else np.asarray(leaf)
    if array.dtype == object and leaf is not None:
        for entry in np.ravel(array):
            if entry is None or isinstance(entry, (str, bytes, bool, complex, np.generic, np.ma.MaskedArray)):
                _require_real(entry, name)
    elif is_short(array.dtype):
        raise ArgumentError(
            f"{name} must be float64, but is {array.dtype}, which has lost digits already: 5.46 becomes 5.460000038; "
            "make it with NumPy, or with jax.numpy inside `with co.float64():`."
        )
    elif array.dtype.kind == "f" and array.dtype.itemsize > 8:
        if np.any((array.astype(np.float64) != array) & np.isfinite(array)):
            raise ArgumentError(
                f"{name} is {array.dtype}, whose digits float64 does not have: round it by .astype(float) if that is "
                "what you mean."
            )
    elif array.dtype.kind not in "fiu":
        said = shown(leaf) if len(shown(leaf)) < 60 else f"an array of {array.dtype}"
        raise ArgumentError(f"{name} must be a number or an array of numbers, but is {said}.")
