"""Double precision, always, without touching the user's configuration of JAX."""

from __future__ import annotations

from contextlib import AbstractContextManager

import jax


def float64() -> AbstractContextManager[None]:
    """The scope in which JAX computes in float64: needed around your own jit, grad and vmap of `co.trajectory`.

    with co.float64():
        jax.grad(lambda m: co.trajectory(vehicle.replace(mass=m), start, dt=0.02, steps=2000).final.q[2])(123.8)
    """
    return jax.enable_x64(True)
