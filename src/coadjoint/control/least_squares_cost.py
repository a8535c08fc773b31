"""Costs that are sums of squares, whose curvature Gauss and Newton's method takes from the first derivatives."""

from __future__ import annotations

import functools
from collections.abc import Callable

import jax.numpy as jnp

from coadjoint import checks
from coadjoint.arrays import PyTree


def squares(function: Callable[..., object]) -> Callable[..., PyTree]:
    """The cost L = |e|² of e = function(motion [, p]), a vector of any length.

        cost=co.control.squares(lambda motion, p: jnp.concatenate([3 * (motion.q - goal), motion.nu]))

    function: as a cost, written with jax.numpy; its weights are square roots of those of the squares.

    For `problem.solve` this is a cost like any other. A controller takes 2 JᵀJ for its Hessian, J = ∂e/∂(x, u), which
    is never negative and needs no second derivatives. Raises ArgumentError unless it is a function.
    """
    checks.function(function, "function", "a function of the motion")

    @functools.wraps(function)
    def cost(*arguments: object) -> PyTree:
        return jnp.sum(jnp.square(jnp.ravel(jnp.asarray(function(*arguments)))))

    cost.residual = function  # pyright: ignore[reportAttributeAccessIssue]
    return cost
