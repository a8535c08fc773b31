"""Runs pure JAX functions on NumPy values without compiling them by XLA.

For set-up, checks and tests: one evaluation costs about as much as its tracing, where XLA would take seconds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.trace.control import CONTROL
from coadjoint.kernels.trace.fork_safety import require_own_xla
from coadjoint.kernels.trace.interpreter import Interpreter
from coadjoint.kernels.trace.jaxprs import Tracer, results
from coadjoint.kernels.trace.numeric import NUMERIC
from coadjoint.kernels.trace.programs import program_of
from coadjoint.kernels.trace.straight_line import Straight
from coadjoint.kernels.untraceable import Untraceable

_NUMBERS = Interpreter(NUMERIC, CONTROL)

FEW = 12
"""The most numbers by which a second derivative is found column by column."""


def traced(*values: object) -> bool:
    """Whether any leaf is a JAX tracer, so that the caller runs inside a user's own jit, grad or vmap."""
    return any(isinstance(leaf, Tracer) for leaf in jax.tree_util.tree_leaves(values))


@dataclass(frozen=True)
class Mapped:
    """`jax.vmap(function, in_axes, out_axes)`, with an identity by which its program is kept on disk."""

    function: Callable[..., PyTree]
    in_axes: PyTree = 0
    out_axes: PyTree = 0

    def __call__(self, *args: PyTree) -> PyTree:
        return jax.vmap(self.function, self.in_axes, self.out_axes)(*args)


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


class Tabulated:
    """A function traced once, for many values of the same shapes."""

    def __init__(self, function: Callable[..., PyTree], args: PyTree, long: bool, name: str | None = None):
        args = jax.tree_util.tree_map(_numpy, args)
        self._function = function
        self._closed, self._structure = program_of(function, args, name)
        self._expected = jax.tree_util.tree_structure(args)
        self._shapes = [leaf.shape for leaf in jax.tree_util.tree_leaves(args)]
        self._by_xla: Callable | None = compiled(function) if long else None
        self._runs = 0
        self._begun: tuple[list[bytes], Straight] | None = None
        """The program begun with the first inputs of these numbers."""

    @cached_property
    def shapes(self) -> PyTree:
        """The shapes and types of the result."""
        return jax.tree_util.tree_unflatten(self._structure, results(self._closed))

    @cached_property
    def _straight(self) -> Straight:
        return Straight(_NUMBERS, self._closed)

    def __call__(self, *values: object) -> PyTree:
        """The function of these values; ValueError if they have other shapes or structure."""
        leaves, given = jax.tree_util.tree_flatten(jax.tree_util.tree_map(_numpy, values))
        if given != self._expected or [leaf.shape for leaf in leaves] != self._shapes:
            raise ValueError("A tabulated function must be called with the structure and shapes it was traced for.")
        self._runs += 1
        # Equation by equation the first time, by a straight-line program from the second on.
        run = self._interpreted if self._runs == 1 else lambda leaves: self._straight(leaves)
        return jax.tree_util.tree_unflatten(self._structure, map(np.array, self._outputs(run, leaves)))

    def of_rows(self, first: PyTree, rest: PyTree, size: int) -> PyTree:
        """function(first, rest) of `size` rows of `rest` and of the result after another, which are filled up.

        What depends on `first` alone is found once, also over calls with the same values.
        """
        known, leaves = ([_numpy(leaf) for leaf in jax.tree_util.tree_leaves(part)] for part in (first, rest))
        count, found, numbers = len(leaves[0]), list[np.ndarray](), [leaf.tobytes() for leaf in known]
        self._runs += 1

        def continued(leaves: list[np.ndarray]) -> list[np.ndarray]:
            begun = self._begun
            if begun is None or begun[0] != numbers:
                begun = self._begun = numbers, self._straight.given(known)
            return begun[1](leaves[len(known) :])

        run = self._interpreted if self._runs == 1 and count <= size else continued
        for start in range(0, max(count, 1), size):
            rows = [leaf[start : start + size] for leaf in leaves]
            if len(rows[0]) < size:
                rows = [np.resize(leaf, (size, *leaf.shape[1:])) for leaf in rows]
            outputs = self._outputs(run, [*known, *rows])
            found = found or [np.empty((count, *x.shape[1:]), x.dtype) for x in outputs]
            for whole, part in zip(found, outputs, strict=True):
                whole[start : start + size] = part[: count - start]
        return jax.tree_util.tree_unflatten(self._structure, found)

    def _interpreted(self, leaves: list[np.ndarray]) -> list[np.ndarray]:
        return _NUMBERS.run(self._closed, leaves)

    def _outputs(
        self, run: Callable[[list[np.ndarray]], list[np.ndarray]], leaves: list[np.ndarray]
    ) -> list[np.ndarray]:
        """run(leaves), by XLA where the function cannot be traced."""
        if self._by_xla is None:
            try:
                with np.errstate(all="ignore"):
                    return run(leaves)
            except Untraceable:
                self._by_xla = compiled(self._function)
        require_own_xla()
        with jax.enable_x64(True):
            found = self._by_xla(*jax.tree_util.tree_unflatten(self._expected, leaves))
        return [np.asarray(leaf) for leaf in jax.tree_util.tree_leaves(found)]


def tabulate(function: Callable[..., PyTree], *args: object, long: bool = False, name: str | None = None) -> Tabulated:
    """`function` traced once at the shapes of `args`: a callable for many values of the same shapes.

    long: whether it has loops of so many trips that XLA's compiling takes less time than they do here. Control flow
    that depends on values stays alive. name: under which its program is kept on disk; by default as commands need it.
    """
    return Tabulated(function, args, long, name)


def compiled(function: Callable) -> Callable:
    """`function` by XLA, for primitives without a rule here."""
    return jax.jit(function)


def _numpy(leaf: object) -> np.ndarray:
    array = np.asarray(leaf)
    return array.astype(np.float64, copy=False) if array.dtype.kind == "f" else array
