"""Primitives of JAX that the library adds: calls of the host, and linear maps whose transpose is given."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import core as jax_core
from jax.extend import core
from jax.interpreters import ad, batching, mlir

from coadjoint.arrays import Array, PyTree


def host_call(function: Callable[[np.ndarray], np.ndarray], numbers: Array, size: int) -> Array:
    """function(numbers), float64 (n,) → (size,), by NumPy on the host. It has no derivative.

    Unlike `jax.pure_callback` it passes numbers on without arrays of JAX; members of a batch go one after another. The
    result is passed as pairs of 32-bit words: JAX calls on threads of its own, where the float64 scope of the caller
    does not apply and float64 numbers would be rounded to float32.
    """
    return jax.lax.bitcast_convert_type(_host_call().bind(numbers, function=function, size=size), np.float64)


def _words(numbers: Any, function: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    return np.ascontiguousarray(function(np.asarray(numbers)), np.float64).view(np.uint32).reshape(-1, 2)


def _batched(operands: Sequence[Array], axes: Sequence[int], **parameters: Any) -> tuple[Array, int]:
    return jax.lax.map(lambda x: _host_call().bind(x, **parameters), jnp.moveaxis(operands[0], axes[0], 0)), 0


def _lowered(context: Any, numbers: Any, *, function: Callable[[np.ndarray], np.ndarray], size: int) -> Any:
    def call(numbers: np.ndarray) -> tuple[np.ndarray]:
        return (_words(numbers, function),)

    kinds, options = (context.avals_in, context.avals_out), {"has_side_effect": False, "returns_token": False}
    return mlir.emit_python_callback(context, call, None, [numbers], *kinds, **options)[0]


@cache
def _host_call() -> core.Primitive:
    made = core.Primitive("host_call")
    made.def_impl(lambda numbers, function, size: jnp.asarray(_words(numbers, function)))
    made.def_abstract_eval(lambda _, function, size: jax_core.ShapedArray((size, 2), np.dtype(np.uint32)))
    batching.primitive_batchers[made] = _batched
    mlir.register_lowering(made, _lowered, cacheable=False)
    return made


def linear_primitive(name: str, no_derivative: Callable[[], Exception]) -> Callable[..., list[PyTree]]:
    """A family of linear maps whose transpose is given: (constants, x, push, pull, shapes) ↦ push(constants, x).

    `pull`(constants, y) is the transpose, `shapes` are those of push. Members of a batch go one after another. Its
    derivative by the constants raises `no_derivative`().
    """

    @cache
    def primitive() -> core.Primitive:
        made = core.Primitive(name)
        made.multiple_results = True
        made.def_impl(apply)
        made.def_abstract_eval(lambda *_, shapes, **__: [jax_core.ShapedArray(s.shape, s.dtype) for s in shapes])
        ad.primitive_jvps[made] = refuse
        ad.primitive_transposes[made] = transpose
        batching.primitive_batchers[made] = batch
        mlir.register_lowering(made, mlir.lower_fun(apply, multiple_results=True))
        return made

    def apply(*operands: object, push: Callable, **_: object) -> Sequence[PyTree]:
        return push(operands[:-1], operands[-1])

    def transpose(cotangents: Any, *operands: object, push: Callable, pull: Callable, shapes: PyTree) -> list[PyTree]:
        pairs = zip(cotangents, shapes, strict=True)
        full = [jnp.zeros(s.shape, s.dtype) if type(c) is ad.Zero else c for c, s in pairs]
        return [*[None] * (len(operands) - 1), pull(operands[:-1], full)]

    def batch(operands: Any, axes: PyTree, **parameters: PyTree) -> tuple[Any, tuple[int, ...]]:
        pairs = list(zip(operands, axes, strict=True))
        moving = [jnp.moveaxis(operand, axis, 0) for operand, axis in pairs if axis is not None]

        def one(members: PyTree) -> tuple[PyTree, ...]:
            members = iter(members)
            return tuple(primitive().bind(*(x if axis is None else next(members) for x, axis in pairs), **parameters))

        found = jax.lax.map(one, tuple(moving))
        return found, (0,) * len(found)

    def refuse(*_: object, **__: object) -> Any:
        raise no_derivative()

    def bind(
        constants: Sequence[object], x: Array, push: Callable, pull: Callable, shapes: Sequence[object]
    ) -> list[PyTree]:
        return primitive().bind(*constants, x, push=push, pull=pull, shapes=tuple(shapes))

    return bind
