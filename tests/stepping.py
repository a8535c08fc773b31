"""Runs the steps of a method outside the driver, so that every stage of every step can be looked at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np

import coadjoint as co
from coadjoint.kernels.run import native, xla
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods import Step
from coadjoint.methods.program import Constants, StepProgram


class Leap(NamedTuple):
    """One implicit stage: the step, its own h, the record it starts at and the state after it."""

    step: Step
    h: float
    record: co.State
    after: co.State


class Stepper:
    """The steps of a method on a system: the library's Newton and step on NumPy numbers, or native for many steps."""

    def __init__(self, system: co.System, method: co.methods.Method, compiled: bool = False):
        self.system, self.method, self.compiled = system, method, compiled
        self.constants = Constants(system.parameters, None)
        self._solvers: dict[Step, Any] = {}

    def _program(self, step: Any) -> StepProgram:
        """A step as a program of its own; how the run started does not matter to it."""
        return StepProgram(replace_parameters(self.system, None), replace(step, start="momentum"))

    def _solve(self, step: Step, state: co.State, h: float) -> tuple[co.State, co.State, int]:
        if self.compiled:
            chunk = native.run(self._program(step), self.constants, state, h, 1, 1, monitors=False)
            return jax.tree.map(lambda rows: rows[0], chunk.records), chunk.final, int(chunk.code)
        h = np.float64(h)
        if step not in self._solvers:
            program = self._program(step)

            def solve(constants, state, h):
                result = xla.step(program, constants, state, h, certify=False)
                return result.record, result.after, result.code

            self._solvers[step] = tabulate(solve, self.constants, state, h)
        return self._solvers[step](self.constants, state, h)

    def leaps(self, state: co.State, h: float) -> list[Leap]:
        """The stages of one step from a state."""
        found = []
        for step, fraction in self.method.stages:
            record, after, code = self._solve(step, state, fraction * h)
            assert code == 0, f"a stage of {self.method.title} at h = {h} ended with code {code}"
            found.append(Leap(step, fraction * h, record, after))
            state = after
        return found

    def run(self, start: co.State, h: float, steps: int) -> list[Leap]:
        """All stages of `steps` steps, begun as the method begins."""
        state, found = self.method.begin(self.system, start, h), []
        for _ in range(steps):
            found += self.leaps(state, h)
            state = found[-1].after
        return found

    def final(self, start: co.State, h: float, steps: int) -> co.State:
        """The state after `steps` steps."""
        state = self.method.begin(self.system, start, h)
        for _ in range(steps):
            state = self.leaps(state, h)[-1].after
        return state


def tabulated(function: Callable, system: co.System, leaps: list[Leap]) -> list[Any]:
    """function(system, step, record, h) of every leap, traced once for each kind of step."""
    traced, rows = {}, []
    for leap in leaps:
        if leap.step not in traced:
            traced[leap.step] = tabulate(partial(function, system, leap.step), leap.record, leap.h)
        rows.append(traced[leap.step](leap.record, leap.h))
    return rows
