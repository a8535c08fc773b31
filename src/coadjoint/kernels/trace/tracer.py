"""Traces pure JAX functions into scalar expressions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.expressions.graph import Graph
from coadjoint.kernels.packing import layout
from coadjoint.kernels.trace.control import CONTROL
from coadjoint.kernels.trace.interpreter import Interpreter
from coadjoint.kernels.trace.jaxprs import jaxpr_of
from coadjoint.kernels.trace.numeric import NUMERIC
from coadjoint.kernels.trace.symbolic import expression_rules, lift, nodes


class Tracer:
    """A graph and the interpreter that fills it."""

    def __init__(self, graph: Graph | None = None) -> None:
        self.graph = Graph() if graph is None else graph
        self._interpreter = Interpreter(NUMERIC, CONTROL, expression_rules(self.graph))
        self._jaxprs: dict[tuple, Any] = {}

    def symbols(self, name: str, tree: PyTree) -> PyTree:
        """`tree` with every element replaced by a separate symbol, numbered through the leaves."""
        leaves, structure = jax.tree_util.tree_flatten(tree)
        placed, count = [], 0
        for leaf in leaves:
            shape = np.shape(leaf)
            size = int(np.prod(shape))
            placed.append(nodes((self.graph.symbol(f"{name}{count + i}") for i in range(size)), shape))
            count += size
        return jax.tree_util.tree_unflatten(structure, placed)

    def trace(self, function: Callable, *args: object) -> PyTree:
        """function(*args) as a PyTree of arrays of expressions.

        `args` are PyTrees of arrays of expressions or numbers. Untraceable names what the language lacks. A method
        of an object that equals an earlier one is not traced by JAX again.
        """
        return self.reader(function, *args)(*args)

    def reader(self, function: Callable, *like: object) -> Callable[..., PyTree]:
        """`trace` of a function that JAX traces here, for any arguments of the shapes of `like`."""
        closed, structure = self._jaxpr(function, like)

        def trace(*args: object) -> PyTree:
            inputs = [np.asarray(leaf) for leaf in jax.tree_util.tree_leaves(args)]
            with np.errstate(all="ignore"):
                outputs = self._interpreter.run(closed, inputs)
                outputs = [lift(self.graph, output) for output in outputs]
            return jax.tree_util.tree_unflatten(structure, outputs)

        return trace

    def _jaxpr(self, function: Callable, args: tuple) -> Any:
        owner = getattr(function, "__self__", None)
        if owner is None:
            return jaxpr_of(function, *args)
        key = owner, getattr(function, "__name__", ""), *layout(args)
        try:
            hash(key)
        except TypeError:
            return jaxpr_of(function, *args)
        if key not in self._jaxprs:
            self._jaxprs[key] = jaxpr_of(function, *args)
        return self._jaxprs[key]


def flat(tree: PyTree) -> list[Expr]:
    """Every expression of a PyTree of arrays of expressions, in order."""
    return [node for leaf in jax.tree_util.tree_leaves(tree) for node in np.asarray(leaf).reshape(-1)]
