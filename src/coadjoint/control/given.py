"""The numbers of a problem that may change from one solution to the next: its goal, its start, and parameters.

They are arguments of the program, so that it is traced and built once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.control.boundary_conditions import end_values, start_values
from coadjoint.control.numbers import spread
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.problem_parts import End, Input
from coadjoint.control.stage import numbers_of
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.start_arguments import ON_GROUP
from coadjoint.mechanics.system import System


def given_values(problem: ProblemData) -> dict[str, dict[str, PyTree]]:
    """The values of the goal, with g⁻¹ for g, the commands in force before the start, and the values of the start that
    equations read, by their names."""
    return {
        "goal": _goal_values(problem),
        "previous": previous_values(problem, {}),
        "start": start_values(problem, problem.start),
    }


def previous_values(problem: ProblemData, given: Mapping[str, object]) -> dict[str, np.ndarray]:
    """The commands in force before the start, of the inputs that have one; raises ArgumentError for others."""
    known = {name: one for name, one in problem.inputs.items() if isinstance(one, Input) and one.previous is not None}
    checks.mapping(given, "previous", "a dictionary of name → command")
    checks.all_known(given, known, "input with `previous`", "The problem")
    return {name: spread(given.get(name, one.previous), one.shape, "previous") for name, one in known.items()}


def with_previous(problem: ProblemData) -> ProblemData:
    """The problem whose inputs count from a command in force, where rates, costs of changes or courses need one."""

    def counts(one: object) -> bool:
        if not isinstance(one, Input) or one.previous is not None:
            return False
        return bool(np.isfinite(one.rate).any() or np.any(one.change_cost) or one.course != "held")

    inputs = {name: replace(one, previous=one.guess) if counts(one) else one for name, one in problem.inputs.items()}
    return replace(problem, duration=None, inputs=inputs)


def given_numbers(problem: ProblemData, system: System, values: PyTree) -> np.ndarray:
    """The parameters of a system that may change, then the numbers of the goal and of the start."""
    parameters = [numbers_of(getattr(system.parameters, name)) for name in problem.changing]
    return np.concatenate([*parameters, numbers_of(values)])


def changed(problem: ProblemData, system: System, values: Mapping[str, object], what: str) -> System:
    """A system with other values of parameters that `changing` names; raises ArgumentError for others.

    what: the object that was built for the problem, as "this controller".
    """
    for name in values:
        checks.known(name, list(system.parameters or ()), "parameter", "The system")
        if name not in problem.changing:
            where = "problem.controller" if "controller" in what else "co.control.Problem"
            raise ArgumentError(f"Parameter `{name}` is fixed in {what}: name it in `changing` of {where}.")
    found = system.replace(**values) if values else system
    for name in values:
        new, old = (getattr(one.parameters, name) for one in (found, problem.system))
        shapes, known = (list(map(np.shape, jax.tree.leaves(one))) for one in (new, old))
        if shapes != known:
            raise ArgumentError(f"Parameter `{name}` must keep its shape, but is {shown(new)}.")
    return found


def _goal_values(problem: ProblemData) -> dict[str, PyTree]:
    if not isinstance(problem.end, End) or not problem.end.given:
        return {}
    found, group = end_values(problem, problem.end), problem.system.group
    return found | ({"g": evaluate(group.inverse, found["g"])} if "g" in found else {})


def goal_place(problem: ProblemData) -> tuple[Element, np.ndarray]:
    """g and q of the goal, those of the start where it leaves them free."""
    end, start = problem.end, problem.start
    group, Q, _ = problem.system.places
    g = None if not isinstance(end, End) else end.g
    q = None if not isinstance(end, End) else end.q
    there = start.g if g is None else _element(start.g, g)
    if not Q.dim(group):
        return there, np.zeros(0)
    return there, np.asarray(start.q if q is None else Q.point(group, q, "q"))


def _element(like: Element, g: Any) -> Element:
    """g with the structure and the shapes of another element; other forms of it raise ValueError or TypeError."""
    leaves, structure = jax.tree.flatten(like)
    given = [g] if len(leaves) == 1 else jax.tree.leaves(g)
    found = [np.asarray(leaf, float) for leaf in given]
    if [leaf.shape for leaf in found] != [np.shape(leaf) for leaf in leaves]:
        raise ValueError("another shape")
    for leaf in found:
        checks.expect(np.all(np.isfinite(leaf)), g, "g` of the goal `end", "finite")
    return jax.tree.unflatten(structure, found)


class Goals:
    """The values of other goals of a problem, of the same names and shapes."""

    def __init__(self, problem: ProblemData, values: Mapping[str, PyTree]):
        self.problem, self._inverse = problem, None
        self._shapes = {name: np.shape(value) for name, value in values.items() if name != "g"}

    def __call__(self, goal: Any) -> dict[str, PyTree]:
        """The values of a goal; raises ArgumentError for other names or shapes than those of the problem's `end`."""
        end = self.problem.end
        if not isinstance(end, End) or end.function is not None:
            raise ArgumentError(
                "Argument `goal` replaces the values of co.control.End(…), which this problem does not have: let its "
                "functions read parameters, and name these in `changing`."
            )
        if not isinstance(goal, End) or goal.given != end.given:
            names = ", ".join(f"{name}=…" for name in end.given)
            raise ArgumentError(f"Argument `goal` must give what the problem's `end` gives: co.control.End({names}).")
        plain = {name: getattr(goal, name) for name in self._shapes}
        if not all(_fits(value, self._shapes[name]) for name, value in plain.items()):
            return _goal_values(replace(self.problem, duration=None, end=goal))
        found = {name: np.asarray(value, float) for name, value in plain.items()}
        return found if goal.g is None else found | {"g": self._back(goal)}

    def _back(self, goal: End) -> PyTree:
        """g⁻¹; an element that is not in the group raises the error of a state."""
        group = self.problem.system.group
        if self._inverse is None:
            self._inverse = tabulate(lambda g: (group.outside(g), group.inverse(g)), self.problem.start.g)
        try:
            outside, back = self._inverse(_element(self.problem.start.g, goal.g))
        except (TypeError, ValueError):
            outside, back = np.inf, None
        if not outside <= ON_GROUP:
            return _goal_values(replace(self.problem, duration=None, end=goal))["g"]
        return back


def _fits(value: object, shape: tuple[int, ...]) -> bool:
    """Whether a value is finite numbers of a shape, so that it needs no further check."""
    try:
        found = np.asarray(value, float)
    except (TypeError, ValueError):
        return False
    return found.shape == shape and bool(np.all(np.isfinite(found)))
