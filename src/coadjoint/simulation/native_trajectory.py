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
from jax.flatten_util import ravel_pytree

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.kernels.run import gradient, native
from coadjoint.kernels.trace import jaxprs
from coadjoint.methods.program import StepProgram

Blocks = tuple[int, int]
"""(records, save_every)."""


def native_trajectory(
    program: StepProgram, arguments: object, blocks: Blocks, by_xla: Callable[[PyTree], PyTree]
) -> Any:
    """(records, final, code, iterations) of `arguments` = (constants, state, h), differentiable both ways.

    `by_xla` computes the same, (records, final) of the arguments, by operations that JAX can push tangents through.
    """
    arguments = jax.tree.map(jnp.asarray, arguments)
    shapes = jax.eval_shape(by_xla, arguments)
    number = jax.ShapeDtypeStruct((), np.float64)

    def run_on_host(arguments):
        constants, state, h = arguments
        chunk = native.run(program, constants, state, float(h), blocks[0], blocks[1], monitors=False)
        whole = jax.tree.map(partial(_padded, rows=blocks[0]), chunk.records)
        return whole, chunk.final, np.float64(chunk.code), np.float64(chunk.iterations)

    def pull_on_host(given):
        (constants, state, h), cotangents = given
        found = gradient.pullback(program, constants, state, float(h), blocks[0], blocks[1])(*cotangents)
        return found.parameters, found.state, found.h

    @jax.custom_jvp
    def pullback(arguments, cotangents):
        return on_host(pull_on_host, (arguments, cotangents), arguments)

    @pullback.defjvp
    def _(primals, tangents):
        raise _second_derivatives()

    @jax.custom_jvp
    def run(arguments):
        return on_host(run_on_host, arguments, (*shapes, number, number))

    @run.defjvp
    def _(primals, tangents):
        pushed = _tangent_map(by_xla, pullback, primals[0], tangents[0], shapes)
        return run(*primals), (*pushed, jnp.zeros(()), jnp.zeros(()))

    return run(arguments)


def on_host(function: Callable[[PyTree], PyTree], argument: object, like: object) -> PyTree:
    """function(argument) by NumPy on the host: float64 PyTrees in and out, the result shaped as `like`.

    Numbers are passed as pairs of 32-bit words: JAX calls back on its own threads, where the float64 scope of the
    caller does not apply and float64 numbers would be rounded to float32.
    """
    words, structure = _words(argument)
    leaves, result = jax.tree.flatten(like)
    sizes = [int(np.prod(leaf.shape)) for leaf in leaves]

    def call(words):
        found = jax.tree.leaves(function(structure(np.asarray(words))))
        flat = np.concatenate([np.ravel(np.asarray(leaf, np.float64)) for leaf in found])
        return flat.view(np.uint32).reshape(-1, 2)

    total = jax.ShapeDtypeStruct((sum(sizes), 2), np.uint32)
    back = jax.lax.bitcast_convert_type(jax.pure_callback(call, total, words, vmap_method="sequential"), np.float64)
    parts = jnp.split(back, np.cumsum(sizes)[:-1])
    return result.unflatten([part.reshape(leaf.shape) for part, leaf in zip(parts, leaves, strict=True)])


def _words(tree: PyTree) -> tuple[Any, Callable[[np.ndarray], PyTree]]:
    """A float64 PyTree as words (n, 2), and how to read it back from them in NumPy."""
    leaves, structure = jax.tree.flatten(tree)
    shapes = [np.shape(leaf) for leaf in leaves]
    ends = np.cumsum([0, *(int(np.prod(shape)) for shape in shapes)])
    flat = jnp.concatenate([jnp.ravel(leaf) for leaf in leaves])

    def read(words: np.ndarray) -> PyTree:
        numbers = np.ascontiguousarray(words).view(np.float64).reshape(-1)
        return structure.unflatten([numbers[ends[i] : ends[i + 1]].reshape(s) for i, s in enumerate(shapes)])

    return jax.lax.bitcast_convert_type(flat, np.uint32), read


def _tangent_map(by_xla, pullback, arguments: object, tangents: object, shapes: PyTree) -> Any:
    """The derivative of `by_xla` at the arguments along the tangents, with `pullback` as its transpose."""
    leaves, structure = jax.tree.flatten(arguments)
    # One flat tangent, zeros included, so that the primitive is linear in one operand.
    flat, unravel = ravel_pytree(tangents)
    outputs, made_of = jax.tree.flatten(shapes)

    def push(leaves, tangent):
        found = jax.jvp(by_xla, (structure.unflatten(leaves),), (unravel(tangent),))[1]
        return jax.tree.leaves(found)

    def pull(leaves, cotangents):
        return ravel_pytree(pullback(structure.unflatten(leaves), made_of.unflatten(cotangents)))[0]

    return made_of.unflatten(_tangent(leaves, flat, push, pull, outputs))


def _second_derivatives() -> ArgumentError:
    return ArgumentError('Second derivatives of a trajectory need backend="xla" in co.trajectory.')


_tangent = jaxprs.linear_primitive("native_trajectory_tangent", _second_derivatives)


def _padded(values: np.ndarray, rows: int) -> np.ndarray:
    """A failed run's records, its last good one repeated to the length that JAX expects."""
    missing = rows - len(values)
    if not missing:
        return values
    last = values[-1:] if len(values) else np.zeros((1, *values.shape[1:]))
    return np.concatenate([values, np.repeat(last, missing, axis=0)])
