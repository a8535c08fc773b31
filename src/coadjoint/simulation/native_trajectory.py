"""A trajectory by native code inside JAX's transformations, with a forward and a reverse rule.

The value and the pullback of a native run are called back on the host. Forward mode has no native code: its tangent is
that of the XLA path. A custom primitive represents the tangent, a linear map whose transpose is the native
pullback, so that reverse mode runs native code only.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import flatten_util

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.kernels.packing import flattened
from coadjoint.kernels.run import gradient
from coadjoint.kernels.trace.primitives import host_call, linear_primitive
from coadjoint.methods.program import StepProgram

Blocks = tuple[int, int]
"""(records, save_every)."""


def native_trajectory(
    program: StepProgram, arguments: tuple[PyTree, PyTree, Any], blocks: Blocks, by_xla: Callable[[PyTree], PyTree]
) -> Any:
    """(records, final, code, iterations) of `arguments` = (constants, state, h), differentiable both ways.

    `by_xla` computes the same, (records, final) of the arguments, by operations that JAX can push tangents through.
    """
    arguments = jax.tree.map(jnp.asarray, arguments)
    shapes, number = jax.eval_shape(by_xla, arguments), jax.ShapeDtypeStruct((), np.float64)
    native_run = gradient.NativeRun(program, *arguments[:2], *blocks)
    end = native_run.state.size

    def pull_on_host(numbers):
        given, bars = np.split(numbers, [native_run.size])
        return native_run.pulled(given, bars[:-end], bars[-end:])

    @jax.custom_jvp
    def pullback(arguments, cotangents):
        return on_host(pull_on_host, (arguments, cotangents), arguments)

    @pullback.defjvp
    def _(primals, tangents):
        raise _second_derivatives()

    def by_native_code(taped):
        run = partial(native_run.value, taped=taped)
        return jax.custom_jvp(lambda given: on_host(run, given, (*shapes, number, number)))

    alone, differentiated = by_native_code(taped=False), by_native_code(taped=True)

    @alone.defjvp
    @differentiated.defjvp
    def _(primals, tangents):
        pushed = _tangent_map(by_xla, pullback, primals[0], tangents[0], shapes)
        return differentiated(*primals), (*pushed, jnp.zeros(()), jnp.zeros(()))

    return alone(arguments)


def on_host(function: Callable[[np.ndarray], np.ndarray], argument: object, like: object) -> PyTree:
    """function(argument) by NumPy on the host, of the float64 numbers of PyTrees end to end; a result as `like`."""
    leaves, result = jax.tree.flatten(like)
    sizes = [int(np.prod(leaf.shape)) for leaf in leaves]
    parts = jnp.split(host_call(function, flattened(argument), sum(sizes)), np.cumsum(sizes)[:-1])
    return result.unflatten([part.reshape(leaf.shape) for part, leaf in zip(parts, leaves, strict=True)])


def _tangent_map(by_xla, pullback, arguments: object, tangents: object, shapes: PyTree) -> Any:
    """The derivative of `by_xla` at the arguments along the tangents, with `pullback` as its transpose."""
    leaves, structure = jax.tree.flatten(arguments)
    # One flat tangent, zeros included, so that the primitive is linear in one operand.
    flat, unravel = flatten_util.ravel_pytree(tangents)
    outputs, made_of = jax.tree.flatten(shapes)

    def push(leaves, tangent):
        found = jax.jvp(by_xla, (structure.unflatten(leaves),), (unravel(tangent),))[1]
        return jax.tree.leaves(found)

    def pull(leaves, cotangents):
        return flatten_util.ravel_pytree(pullback(structure.unflatten(leaves), made_of.unflatten(cotangents)))[0]

    return made_of.unflatten(_tangent(leaves, flat, push, pull, outputs))


def _second_derivatives() -> ArgumentError:
    return ArgumentError('Second derivatives of a trajectory need backend="xla" in co.trajectory.')


_tangent = linear_primitive("native_trajectory_tangent", _second_derivatives)
