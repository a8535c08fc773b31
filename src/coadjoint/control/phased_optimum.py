"""An optimal motion in phases: the solution of the solver, each phase simulated from the end of the previous run."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from coadjoint.control.joints import PhasedProgram, PhaseJoint, carried
from coadjoint.control.library import casadi
from coadjoint.control.optimum import (
    ROUND_OFF,
    SADDLE,
    STATIONARY,
    UNSTABLE,
    chosen_system,
    difference,
    flight,
    soft_lines,
    violation,
)
from coadjoint.control.solve import FoundOptimum
from coadjoint.control.transcription import Transcription
from coadjoint.control.within_steps import WorstWithin, lines, worst_within
from coadjoint.simulation.run import Run


@dataclass(frozen=True, eq=False)
class PhasedOptimum:
    """The result of `Phases.solve`; `print` shows a summary, with the certificates of the runs below.

    runs: phase → the motion, simulated by `co.simulate` from the end of the previous run. inputs, parameters: phase →
    name → values, as of `co.control.Optimum`. costs, durations (s): of each phase; cost, duration (s): of all.
    violation: the largest violation of the constraints. difference: the largest |x − x of the run| of any number of the
    state. iterations, and seconds of building, solving: of the solver. within: phase → name → the largest violation of
    a constraint of the path between the nodes of its run; violated: phase → name → the violation of each soft
    constraint at its nodes; minimum: whether the solver saw a strict minimum; as of `co.control.Optimum`.
    """

    runs: dict[str, Run]
    inputs: dict[str, dict[str, np.ndarray]]
    parameters: dict[str, dict[str, np.ndarray]]
    costs: dict[str, float]
    durations: dict[str, float]
    violation: float
    difference: float
    iterations: int
    build_seconds: float
    solve_seconds: float
    solver: str
    joints: tuple[PhaseJoint, ...]
    within: dict[str, dict[str, WorstWithin]]
    violated: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    minimum: bool = True

    @property
    def cost(self) -> float:
        """The least value found."""
        return sum(self.costs.values())

    @property
    def duration(self) -> float:
        """Of all phases together, s."""
        return sum(self.durations.values())

    def __str__(self) -> str:
        count = {name: len(run.records.t) - 1 for name, run in self.runs.items()}
        rows = [("optimum", f"cost {self.cost:.9g} over {self.duration:.6g} s, {len(self.runs)} phases")]
        begins = {joint.after: joint for joint in self.joints}
        for name, run in self.runs.items():
            row = f"cost {self.costs[name]:.9g} over {self.durations[name]:.6g} s, {len(run.records.t) - 1} steps"
            if name in begins:
                kept = "momenta" if begins[name].keep == "momentum" else "velocities"
                row += f", begins with the {kept} of `{begins[name].before}`"
            rows.append((f"phase {name}", row))
            rows += [
                (f"parameter {one}", f"{np.array2string(value, precision=6)} in `{name}`")
                for one, value in self.parameters[name].items()
            ]
        rows += [
            ("solver", f"{self.solver}, {self.iterations} iterations in {self.solve_seconds:.3g} s, "
                       f"built in {self.build_seconds:.3g} s"),
            ("constraints", f"violated by at most {self.violation:.1e}; the runs differ from the optimum by at most "
                            f"{self.difference:.1e}"),
        ]  # fmt: skip
        for phase, soft in self.violated.items():
            named = {f"{name} in {phase}": one for name, one in soft.items()}
            rows += soft_lines(named, float(self.runs[phase].records.t[0]), self.durations[phase])
        found = {f"{name} in {phase}": one for phase, each in self.within.items() for name, one in each.items()}
        rows += lines(found, 0)
        if self.difference > 10 * sum(count.values()) * max(self.violation, ROUND_OFF):
            rows.append(("warning", UNSTABLE))
        if not self.minimum:
            rows.append(("warning", SADDLE.partition(";")[0]))
        if self.iterations == 0:
            rows.append(("warning", STATIONARY))
        runs = "\n\n".join(f"{name}\n{run}" for name, run in self.runs.items())
        return "\n".join(f"{name:<18}{text}" for name, text in rows) + f"\n\n{runs}"


def phases_flown(
    parts: dict[str, Transcription],
    joints: tuple[PhaseJoint, ...],
    program: PhasedProgram,
    found: FoundOptimum,
    built: float,
) -> PhasedOptimum:
    """The optimum from the solution of the solver."""
    into, numbers = {joint.after: joint for joint in joints}, program.split(found.numbers["x"])
    runs: dict[str, Run] = {}
    inputs, parameters, costs, durations, gaps, within, violated = {}, {}, {}, {}, [], {}, {}
    for name, transcription in parts.items():
        split, start = transcription.split(numbers[name]), None
        if name in into:
            before = runs[into[name].before]
            start = carried(before.system, before.final, chosen_system(transcription, split), into[name].keep)
        runs[name], inputs[name], parameters[name] = flight(transcription, split, start)
        own = program.each[name]
        costs[name] = float(casadi().Function("f", [own.w], [own.f])(numbers[name]))
        durations[name] = split.h * transcription.problem.count
        gaps.append(difference(transcription, runs[name], split))
        within[name], violated[name] = worst_within(transcription.problem, runs[name]), transcription.violated(split)
    left = violation(program.joined, found.numbers["g"])
    return PhasedOptimum(
        runs, inputs, parameters, costs, durations, left, max(gaps), found.iterations, built, found.seconds,
        found.words, joints, within, violated, found.minimum,
    )  # fmt: skip
