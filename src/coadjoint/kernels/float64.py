"""Double precision, always, without touching the user's configuration of JAX."""

from __future__ import annotations

from contextlib import AbstractContextManager

import jax

from coadjoint.errors import ArgumentError


def float64() -> AbstractContextManager[None]:
    """The scope in which JAX computes in float64: needed around your own jit, grad and vmap of `co.trajectory`.

    with co.float64():
        jax.grad(lambda m: co.trajectory(vehicle.replace(mass=m), start, dt=0.02, steps=2000).final.q[2])(123.8)
    """
    return jax.enable_x64(True)


def require_scope(what: str) -> None:
    """Raise ArgumentError unless JAX keeps float64 inside the user's own jit, grad or vmap."""
    if not jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
        raise ArgumentError(f"{what} inside your own jit, grad or vmap needs float64: wrap it in `with co.float64():`.")
