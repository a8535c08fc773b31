"""The functions of a problem at one step or node, as those of CasADi of columns x, u, z, p and h."""

from __future__ import annotations

from typing import Any, NamedTuple

from coadjoint.arrays import PyTree
from coadjoint.control.expressions import casadi_expressions
from coadjoint.control.library import casadi
from coadjoint.control.stage import StepGraph
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.spaces.measured import MeasuredSpace


class Functions(NamedTuple):
    """Functions of CasADi.

    equations: (x, u, z, p, h) → (r, Φ). within: (x, u, z, p, h) → the constraints of the path at points inside the
    step, None without such. cost, path: (x, u, p, h) → the cost rate of a node, and its constraints. start: (x, u, p,
    h) of the first node → its residual. end, final: of the last node, and its cost. measured: name → (x, u, p, h) → the
    predicted measurement at a node. terminal: (x, u, p, h) of the last node → e of the terminal cost.
    """

    equations: Any
    cost: Any
    path: Any
    start: PyTree
    end: Any
    final: PyTree
    measured: dict[str, PyTree]
    within: Any = None
    terminal: Any = None


class MeasuredDifference(NamedTuple):
    """h ⊖ y, (m,), of a measurement, by the numbers y of its value in a space."""

    off: list[Expr]
    y: list[Expr]
    space: MeasuredSpace


class StepColumns:
    """The numbers of a step as columns x, u, z, p, h of CasADi, for functions of them."""

    def __init__(self, graph: StepGraph, eta: list[Expr], live: list[int]):
        ca, symbols = casadi(), graph.symbols
        chosen = [*symbols.parameters, *eta]
        nodes = [[symbols.state[i] for i in live], symbols.commands, symbols.unknowns, chosen, [symbols.h]]
        self.columns = [ca.SX.sym(name, len(row)) for name, row in zip("xuzph", nodes, strict=True)]
        pairs = zip(self.columns, nodes, strict=True)
        self.known = {node: column[i] for column, row in pairs for i, node in enumerate(row)}

    def of_step(self, results: dict[str, list[Expr]]) -> Any:
        """(x, u, z, p, h) → the results."""
        return self._function("equations", self.columns, list("xuzph"), results)

    def of_node(self, name: str, found: list[Expr], values: list[Expr] | None = None) -> Any:
        """(x, u, p, h) → the result `name`; values: further arguments y, behind these."""
        x, u, _, p, h = self.columns
        if values is None:
            return self._function(name, [x, u, p, h], list("xuph"), {name: found})
        y = casadi().SX.sym("y", len(values))
        self.known.update({node: y[i] for i, node in enumerate(values)})
        return self._function(name, [x, u, p, h, y], list("xuphy"), {name: found})

    def _function(self, name: str, arguments: list[Any], names: list[str], results: dict[str, list[Expr]]) -> Any:
        ca = casadi()
        outputs = [ca.vertcat(*casadi_expressions(nodes, self.known)) for nodes in results.values()]
        return ca.Function(name, arguments, outputs, names, list(results))


def functions_of(
    graph: StepGraph,
    eta: list[Expr],
    live: list[int],
    cost: list[Expr],
    path: list[Expr],
    start: list[Expr],
    end: list[Expr],
    final: list[Expr],
    measured: dict[str, MeasuredDifference],
) -> Functions:
    columns, after = StepColumns(graph, eta, live), graph.next()
    by_node = {"cost": cost, "path": path, "start": start, "end": end, "final": final}
    return Functions(
        columns.of_step({"residual": graph.residual, "next": [after[i] for i in live]}),
        **{name: columns.of_node(name, found) for name, found in by_node.items()},
        measured={name: columns.of_node("measured", one.off, one.y) for name, one in measured.items()},
    )
