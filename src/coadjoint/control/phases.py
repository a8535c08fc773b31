"""Motions in consecutive phases: each with its own system, steps, costs and constraints, joined at their ends."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.control.guess import Guesses
from coadjoint.control.joints import KEPT, PhaseJoint, carried, phased_program
from coadjoint.control.numbers import shortest_and_longest
from coadjoint.control.phased_optimum import PhasedOptimum, phases_flown
from coadjoint.control.problem import Problem
from coadjoint.control.solve import found_by, settings_of, solver_of
from coadjoint.control.stage import StepGraph
from coadjoint.control.transcribe import begun, transcribe
from coadjoint.control.transcription import Transcription
from coadjoint.errors import ArgumentError, shown
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.simulation.run import Run


@dataclass(frozen=True, eq=False)
class Phases:
    """The motion of least cost in phases, each of which begins at the end of the previous one:

        min Σ_j J_j subject to the constraints of each, (g, q, a₀, t, internal state) of its first node those of the
        previous last node, and the momenta (μ, π) or the velocities (ξ, ν) there the same.

        journey = co.control.Phases({"loaded": first, "empty": second}, keep="velocity").solve()

    Arguments:
        phases: name → `co.control.Problem`, in their order. The start of the first is the start; that of a later one
            only gives its system and internal state.
        keep: "momentum" or "velocity", the continuous quantity at a joint, or one of these for each joint: velocities
            where a payload is dropped, momenta where a body changes its shape. By default momenta, where all phases
            have the same system.
        shared: names of `parameters` that are one number in all phases that choose them, by default none.
        total_duration: (shortest, longest) of all phases together, s, by default free.

    Raises ArgumentError for other arguments.
    """

    phases: Mapping[str, Problem]
    keep: Any = None
    shared: tuple[str, ...] = ()
    total_duration: tuple[float, float] | None = None
    joints: tuple[PhaseJoint, ...] = field(init=False)

    def __post_init__(self):
        named = isinstance(self.phases, Mapping) and all(isinstance(name, str) for name in self.phases)
        fits = named and len(self.phases) >= 2 and all(isinstance(one, Problem) for one in self.phases.values())
        checks.expect(
            fits, self.phases, "phases", "a dictionary of name → co.control.Problem(…), of two phases at least"
        )
        self._require_one_after_the_other()
        kept = self._kept()
        pairs = zip(pairwise(self.phases), kept, strict=True)
        object.__setattr__(self, "joints", tuple(PhaseJoint(*names, one) for names, one in pairs))
        self._require_shared()
        self._require_total()

    def solve(
        self,
        guess: Mapping[str, Run | str] | str | None = None,
        *,
        solver: str = "ipopt",
        tolerance: float = 1e-9,
        max_iterations: int = 500,
        verbose: bool = False,
        options: Mapping[str, object] | None = None,
    ) -> PhasedOptimum:
        """The optimum, each phase simulated by `co.simulate` from the end of the previous run.

        Arguments:
            guess: the start of the solver: name of a phase → a run, "interpolate" or "simulate", as in `Problem.solve`,
                one of these words for all phases, or None; a phase's guess begins at the end of the previous one.
            solver, tolerance, max_iterations, verbose, options: as in `Problem.solve`.

        Raises the errors of `Problem.solve`.
        """
        settings = settings_of(solver, tolerance, max_iterations, verbose, options)
        guesses = self._guesses(guess)
        began = time.perf_counter()
        parts = self._transcribed()
        program = phased_program(parts, self.joints, self.shared, self.total_duration)
        function = solver_of(program.joined, settings)
        built = time.perf_counter() - began
        first = self._first(parts, guesses)
        found = found_by(function, program.joined, first, settings)
        return phases_flown(parts, self.joints, program, found, built)

    def _kept(self) -> list[str]:
        problems, count = list(self.phases.values()), len(self.phases) - 1
        if self.keep is None:
            if any(one.system is not problems[0].system for one in problems):
                raise ArgumentError(
                    'The phases have different systems: choose what continues at the joints by keep="momentum" or '
                    'keep="velocity".'
                )
            return ["momentum"] * count
        kept = [self.keep] * count if isinstance(self.keep, str) else self.keep
        fits = isinstance(kept, (list, tuple)) and len(kept) == count and all(one in KEPT for one in kept)
        checks.expect(
            fits, self.keep, "keep", f'"momentum" or "velocity", or one of these for each of the {count} joints'
        )
        for name, kind in zip(list(self.phases)[1:], kept, strict=True):
            if kind == "velocity" and not self.phases[name].system.additional.flat:
                raise ArgumentError('A q on a manifold continues with its momenta alone: use keep="momentum".')
        return list(kept)

    def _require_one_after_the_other(self) -> None:
        (first, one), *rest = self.phases.items()
        free = one.free_duration is not None
        for name, other in rest:
            if other.system.places != one.system.places:
                raise ArgumentError(
                    f"Phase `{name}` has another group or other spaces than phase `{first}`: all must have the same."
                )
            if other.free_start:
                raise ArgumentError(
                    f"Phase `{name}` begins at the end of the previous one: give `free_start` to the first phase alone."
                )
            if other.method.start == "velocity":
                raise ArgumentError(
                    f"Phase `{name}` begins with the momenta or velocities of the last node of the previous one: give "
                    'its method start="momentum".'
                )
            if other.measured and free:
                raise ArgumentError(
                    f"Phase `{name}` was measured at times, but a phase before it has a free duration: fix it."
                )
            free = free or other.free_duration is not None

    def _require_shared(self) -> None:
        checks.texts(self.shared, "shared", 'names, such as ("mass",)')
        for name in self.shared:
            if sum(name in one.parameters for one in self.phases.values()) < 2:
                raise ArgumentError(
                    f"Argument `shared` names {shown(name)}, but fewer than two phases have it in their `parameters`."
                )

    def _require_total(self) -> None:
        given = self.total_duration
        if given is None:
            return
        low, high = shortest_and_longest(given, "total_duration")
        limits = [one.free_duration or (one.length, one.length) for one in self.phases.values()]
        least, most = (sum(float(limit[side]) for limit in limits) for side in (0, 1))
        if high < least - 1e-12 or low > most + 1e-12:
            raise ArgumentError(
                f"Argument `total_duration` is ({low:g}, {high:g}) s, but the phases last {least:g} to {most:g} s "
                "together."
            )

    def _guesses(self, guess: object) -> dict[str, object]:
        if guess is None or isinstance(guess, str):
            return dict.fromkeys(self.phases, guess)
        if not isinstance(guess, Mapping) or not set(guess) <= set(self.phases):
            names = ", ".join(f"`{name}`" for name in self.phases)
            raise ArgumentError(
                f"Argument `guess` must be a dictionary of phases, {names}, or a word for all, but is {shown(guess)}."
            )
        return {name: guess.get(name) for name in self.phases}

    def _transcribed(self) -> dict[str, Transcription]:
        """The functions of all phases; the x of each include the numbers that the next one needs."""
        found: dict[str, Transcription] = {}
        begins = self._begins()
        into = {joint.after: joint for joint in self.joints}
        out = {joint.before: joint for joint in self.joints}
        for name in reversed(list(self.phases)):
            problem = self.phases[name]
            if begins[name] != float(problem.start.t):
                start = problem.start.replace(t=begins[name])
                problem = replace(problem, duration=None, start=start)

            def wanted(graph: StepGraph, name: str = name) -> list[Expr]:
                roots = [joint.velocities(graph) for joint in (into.get(name), out.get(name)) if joint]
                if name in out:
                    roots.append(out[name].linear(graph, found[out[name].after]))
                return list(chain.from_iterable(roots))

            found[name] = transcribe(problem, name in into, wanted)
        return {name: found[name] for name in self.phases}

    def _begins(self) -> dict[str, float]:
        """The start time of each phase, s, if no earlier one has a free duration."""
        t, found = float(next(iter(self.phases.values())).start.t), {}
        for name, problem in self.phases.items():
            found[name] = t
            t += problem.length
        return found

    def _first(self, parts: dict[str, Transcription], guesses: dict[str, PyTree]) -> np.ndarray:
        """The initial variables of the solver: each phase from the end of the previous one."""
        rows: list[np.ndarray] = []
        before: tuple[System, State] | None = None
        kept: dict[str, str] = {joint.after: joint.keep for joint in self.joints}
        for name, transcription in parts.items():
            problem = transcription.problem
            if before is not None:
                start = carried(*before, problem.system, kept[name])
                problem = replace(problem, duration=None, start=start)
                beginning = begun(problem.system, start, problem.dt, problem.method, problem.inputs)
                transcription = replace(transcription, problem=problem, beginning=beginning)
            own = Guesses(transcription)
            states, inputs = own.motion(problem, guesses[name])
            first = transcription.graph.numbers(transcription.beginning.state)[transcription.live]
            rows.append(own.of_motion(problem, states, inputs, first))
            before = problem.system, states
        return np.concatenate(rows)
