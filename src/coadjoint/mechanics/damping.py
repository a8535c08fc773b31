"""Forces that dissipate."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.mechanics.state import Force, Motion


def rayleigh(dissipation: Callable[..., PyTree]) -> Callable[..., Force]:
    """The force T = −∂R/∂ξ, f = −∂R/∂ν of a dissipation function R, for the `forces` of a system.

        co.System(…, forces={"damping": co.mechanics.rayleigh(lambda motion, p: 0.5 * p.c * motion.nu @ motion.nu)})

    dissipation: R, a function (motion [, p]) to one number in terms of jax.numpy, W where the rest is in SI.
    A quadratic R takes the power 2R out of the system, one of degree d the power d·R (Rayleigh, 1873). With a current,
    let R depend on the velocity relative to the water: motion.nu − motion.a.current.
    Raises LagrangianError where R is not one number.
    """
    checks.function(dissipation, "dissipation", "a function R(motion, p)")

    def force(motion: Motion, *parameters: PyTree) -> Force:
        def R(xi: Array, nu: Array):
            value = dissipation(motion._replace(xi=xi, nu=nu, momenta=_no_momenta), *parameters)
            if jnp.ndim(value) != 0:
                raise LagrangianError(
                    f"A dissipation function must return one number, but returns shape {jnp.shape(value)}; use @ or "
                    "jnp.sum."
                )
            return value

        along_xi, along_nu = jax.grad(R, argnums=(0, 1))(motion.xi, motion.nu)
        return Force(-along_xi, jax.tree.map(jnp.negative, along_nu))

    return force


def _no_momenta() -> tuple[PyTree, PyTree]:
    raise LagrangianError("A dissipation function takes velocities, not μ and π: write the force itself in `forces`.")


def quadratic_drag(coefficients: Array, velocity: Array) -> Array:
    """−C|v|v, the drag of a fast flow, with |v| the Euclidean norm; its derivative at rest is 0.

    coefficients: C, a number, (k,) a value an axis, or a matrix (k, k); kg/m for a velocity in m/s. velocity: v, (k,).
    Returns (k,), N. For drag axis by axis, −c_i|v_i|v_i, write -p.c * jnp.abs(v) * v, which is as smooth.
    Raises ArgumentError for other shapes.
    """
    C, v = jnp.asarray(coefficients), jnp.asarray(velocity)
    if v.ndim != 1 or C.shape not in ((), v.shape, v.shape * 2):
        raise ArgumentError(
            "co.mechanics.quadratic_drag takes a velocity of shape (k,) and coefficients of shape (), (k,) or (k, "
            "k), but got "
            f"shapes {v.shape} and {C.shape}."
        )
    square = v @ v
    moving = square > 0
    # √ has no derivative at 0: there it is taken of 1, and not used.
    speed = jnp.where(moving, jnp.sqrt(jnp.where(moving, square, 1.0)), 0.0)
    return -speed * (C @ v if C.ndim == 2 else C * v)
