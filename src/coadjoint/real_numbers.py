"""Real numbers of any kind as float64, without loss of digits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, CoadjointError, shown

if TYPE_CHECKING:
    from coadjoint.kernels.trace.jaxprs import Tracer


def float64(value: object, name: str) -> Any:
    """A finite float64 array from numbers, arrays and lists of these.

    Floats of fewer digits, those of more where digits would be lost, complex numbers, text and booleans are refused.
    Float64 tracers pass.
    """
    import jax

    from coadjoint.kernels.trace.jaxprs import Tracer

    if isinstance(value, Tracer):
        return _float64_tracer(value, name)
    leaves = jax.tree.leaves(value, is_leaf=lambda leaf: leaf is None)
    traced = any(isinstance(leaf, Tracer) for leaf in leaves)
    try:
        for leaf in leaves:
            if type(leaf) not in (float, int):
                _require_real(leaf, name)
        found = np.zeros(()) if traced else np.array(value, dtype=np.float64)
    except CoadjointError:
        raise
    except OverflowError as error:
        raise ArgumentError(f"{name} must be a number of at most 1.8e308 in size, but is {shown(value)}.") from error
    except Exception as error:  # Of an object that cannot be converted.
        raise ArgumentError(f"{name} must be a number or an array of numbers, but is {shown(value)}.") from error
    if traced:
        with jax.enable_x64(True):
            return jax.numpy.asarray(value, dtype=np.float64)
    if not np.all(np.isfinite(found)):
        bad = np.sum(~np.isfinite(found))
        said = f"is {found.tolist()}" if found.size <= 9 else f"{bad} of its {found.size} numbers are not"
        raise ArgumentError(f"{name} must be finite, but {said}.")
    return found


def numeric(value: object) -> bool:
    """Whether this is made of numbers, of whatever kind, and not of text, truth values, times or other objects."""
    from coadjoint.kernels.trace.jaxprs import Tracer

    if isinstance(value, (tuple, list)):
        return all(numeric(part) for part in value)
    try:
        return isinstance(value, Tracer) or np.asarray(value).dtype.kind not in "OSUbmM"
    except Exception:  # Of an object that cannot be converted.
        return False


def is_short(dtype: Any) -> bool:
    """Whether this is a type of floats with fewer digits than float64: float32, float16, bfloat16 and the like."""
    try:
        found = np.dtype(dtype)
    except TypeError:  # a type of JAX alone, as that of keys of random numbers
        return False
    if found.kind != "V":
        return found.kind == "f" and found.itemsize < 8
    from jax import numpy as jnp

    return bool(jnp.issubdtype(found, jnp.floating)) and found.itemsize < 8


def _float64_tracer(value: Tracer, name: str) -> Tracer:
    if value.dtype != np.float64:
        raise ArgumentError(
            f"{name} must be float64, but is traced as {value.dtype}: wrap your own jit, grad or vmap in "
            "`with co.float64():` and pass Python floats or float64 arrays."
        )
    return value


def _require_real(leaf: PyTree, name: str) -> None:
    """Raise ArgumentError unless a leaf, or every entry of an array of objects, is a real number with all digits."""
    from coadjoint.kernels.trace.jaxprs import Tracer

    if isinstance(leaf, Tracer):
        _float64_tracer(leaf, name)
        return
    if np.ma.is_masked(leaf):
        raise ArgumentError(
            f"{name} must have a value everywhere, but some of its entries are masked: fill them first."
        )
    found = leaf if hasattr(leaf, "dtype") else np.asarray(leaf)
    if found.dtype == object and leaf is not None:
        for entry in np.ravel(found):
            if entry is None or isinstance(entry, (str, bytes, bool, complex, np.generic, np.ma.MaskedArray)):
                _require_real(entry, name)
    elif is_short(found.dtype):
        raise ArgumentError(
            f"{name} must be float64, but is {found.dtype}, which has lost digits already: 5.46 becomes 5.460000038; "
            "make it with NumPy, or with jax.numpy inside `with co.float64():`."
        )
    elif found.dtype.kind == "f" and found.dtype.itemsize > 8:
        if np.any((found.astype(np.float64) != found) & np.isfinite(found)):
            raise ArgumentError(
                f"{name} is {found.dtype}, whose digits float64 does not have: round it by .astype(float) if that is "
                "what you mean."
            )
    elif found.dtype.kind not in "fiu":
        said = shown(leaf) if len(shown(leaf)) < 60 else f"an array of {found.dtype}"
        raise ArgumentError(f"{name} must be a number or an array of numbers, but is {said}.")
