"""A step as a function of CasADi, for other programs: rockit, acados, or your own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from coadjoint.control.stage import step_graph
from coadjoint.control.step_functions import StepColumns
from coadjoint.control.transcribe import begun
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.midpoint import Midpoint
from coadjoint.simulation.arguments import grid, require_kinds


@dataclass(frozen=True, eq=False)
class ExportedStep:
    """A step x_{k+1} = Φ(x, u, z, p, h) with r(x, u, z, p, h) = 0, as `casadi.Function`s.

    function: (x, u, z, p, h) → (residual, next), with exact sparse derivatives; saved by `function.save(path)`.
    names: of the numbers of x. start: x at the start, (nx,). unknowns: the count of z. h: the step, s.
    """

    function: Any
    names: tuple[str, ...]
    start: np.ndarray
    unknowns: int
    h: float


def step_function(
    system: System,
    start: State,
    dt: float,
    method: Method | None = None,
    inputs: Mapping[str, object] | None = None,
    parameters: tuple[str, ...] = (),
) -> ExportedStep:
    """One step of `co.simulate` as a function of CasADi.

        step = co.control.step_function(body, start, 0.05, inputs={"torque": co.control.Input((3,))})
        solve = casadi.rootfinder("solve", "newton", …)  # r = 0 for z, or z among the variables of an optimiser

    system, start, dt, method, inputs: as in `co.control.Problem`. parameters: names of those that are arguments p; the
    others are numbers.

    u of a linear input holds its numbers at the beginning of the step, then those at its end; p holds θ of profiles
    before the parameters. x holds all entries of g, as matrices, and the parts of n, a, μ, π and the internal state on
    which a step depends. Raises ArgumentError and LagrangianError, the latter with the operation that CasADi does not
    have.
    """
    method = Midpoint() if method is None else method
    require_kinds(system, start, method)
    h, _ = grid(dt, None, 1)
    beginning = begun(system, start, h, method, inputs or {})
    graph = step_graph(beginning, tuple(parameters))
    live = graph.needed(graph.symbols.state)
    after = graph.next()
    found = StepColumns(graph, [], live).of_step({"residual": graph.residual, "next": [after[i] for i in live]})
    names = graph.names()
    numbers = graph.numbers(beginning.state)
    return ExportedStep(found, tuple(names[i] for i in live), numbers[live], len(graph.symbols.unknowns), h)
