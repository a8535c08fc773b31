"""User's functions in water: their failures, each as one sentence."""

from __future__ import annotations

from collections.abc import Callable

import jax.numpy as jnp

from coadjoint.arrays import Array
from coadjoint.errors import ArgumentError, CoadjointError


def returned(
    function: Callable[..., object], arguments: tuple[object, ...], shape: tuple[int, ...], what: str
) -> Array:
    """The value of a function, of this shape; raises ArgumentError if it fails or has another shape."""
    try:
        value = jnp.asarray(function(*arguments), dtype=float)
    except CoadjointError:
        raise
    except Exception as error:
        if "dtype promotion" in str(error):  # float32, which is reported elsewhere
            raise
        if type(error).__module__.startswith("jax"):
            raise ArgumentError(
                f"{what} must be written with jax.numpy, because it is differentiated and compiled: jnp.sin for np.sin "
                "or math.sin, no float() or np.asarray of its arguments, and jnp.where(z > 5, a, b) for `if`."
            ) from error
        first = (str(error).strip().split("\n") or [""])[0].rstrip(".")
        raise ArgumentError(f"{what} failed: {type(error).__name__}: {first}.") from error
    if value.shape != shape:
        wanted = "one number, a depth in m" if shape == () else f"a velocity of shape {shape}"
        raise ArgumentError(f"{what} must return {wanted}, but returned shape {value.shape}.")
    return value
