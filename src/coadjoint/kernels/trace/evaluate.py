"""Runs pure JAX functions on NumPy values without compiling them by XLA.

For set-up, checks and tests: one evaluation costs about as much as its tracing, where XLA would take seconds.
"""

from __future__ import annotations

from collections.abc import Callable

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.trace.control import CONTROL
from coadjoint.kernels.trace.fork_safety import require_own_xla
from coadjoint.kernels.trace.interpreter import Interpreter
from coadjoint.kernels.trace.jaxprs import Tracer, jaxpr_of
from coadjoint.kernels.trace.numeric import NUMERIC
from coadjoint.kernels.trace.straight_line import Straight
from coadjoint.kernels.untraceable import Untraceable

_NUMBERS = Interpreter(NUMERIC, CONTROL)

FEW = 12
"""The most numbers by which a second derivative is found column by column."""


def traced(*values: object) -> bool:
    """Whether any leaf is a JAX tracer, so that the caller runs inside a user's own jit, grad or vmap."""
    return any(isinstance(leaf, Tracer) for leaf in jax.tree_util.tree_leaves(values))


def evaluate(function: Callable[..., PyTree], *args: object) -> PyTree:
    """function(*args) with NumPy leaves; floats count as float64.

    `function` is pure and traceable by JAX, `args` are PyTrees of arrays. A primitive without a rule here sends the
    function through `jax.jit`. Under the user's own transformations it is traced further instead.
    """
    if traced(*args):
        return function(*args)
    return tabulate(function, *args)(*args)


def hessian_of(function: Callable[..., PyTree], z: np.ndarray) -> np.ndarray:
    """The second derivatives of a number by z (n,), (n, n); of few z by columns, as one takes a third of the time to
    trace."""
    if not 0 < len(z) <= FEW:
        return np.asarray(evaluate(jax.hessian(function), z))
    column = tabulate(lambda z, along: jax.jvp(jax.grad(function), (z,), (along,))[1], z, z)
    return np.stack([column(z, along) for along in np.eye(len(z))])


def tabulate(function: Callable[..., PyTree], *args: object, long: bool = False) -> Callable[..., PyTree]:
    """`function` traced once at the shapes of `args`: a callable for many values of the same shapes.

    long: whether it has loops of so many trips that XLA's compiling takes less time than they do here. Control flow
    that depends on values stays alive. ValueError if a later call has other shapes or structure.
    """
    args = jax.tree_util.tree_map(_numpy, args)
    closed, structure = jaxpr_of(function, *args)
    expected = jax.tree_util.tree_structure(args)
    shapes = [leaf.shape for leaf in jax.tree_util.tree_leaves(args)]
    by_xla: list[Callable] = [compiled(function)] if long else []
    straight: list[Straight] = []
    runs = 0

    def run(leaves: list[np.ndarray]) -> list[np.ndarray]:
        """Equation by equation the first time, by a straight-line program from the second on."""
        nonlocal runs
        runs += 1
        if runs == 1:
            return _NUMBERS.run(closed, leaves)
        if not straight:
            straight.append(Straight(_NUMBERS, closed))
        return straight[0](leaves)

    def call(*values: object) -> PyTree:
        values = jax.tree_util.tree_map(_numpy, values)
        leaves, given = jax.tree_util.tree_flatten(values)
        if given != expected or [leaf.shape for leaf in leaves] != shapes:
            raise ValueError("A tabulated function must be called with the structure and shapes it was traced for.")
        if not by_xla:
            try:
                with np.errstate(all="ignore"):
                    outputs = run(leaves)
                return jax.tree_util.tree_unflatten(structure, [np.array(o) for o in outputs])
            except Untraceable:
                by_xla.append(compiled(function))
        require_own_xla()
        with jax.enable_x64(True):
            return jax.tree_util.tree_map(np.asarray, by_xla[0](*values))

    return call


def compiled(function: Callable) -> Callable:
    """`function` by XLA, for primitives without a rule here."""
    return jax.jit(function)


def _numpy(leaf: object) -> np.ndarray:
    array = np.asarray(leaf)
    return array.astype(np.float64) if array.dtype.kind == "f" else array
