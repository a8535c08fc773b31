"""The solution of a predictive controller for a state, and the record of solutions."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, eq=False)
class MpcSolution:
    """The solution of a controller for a state.

    command: name → value, for the step that starts now, of a linear input the one at its end. inputs: name → (m,
    *shape), for each of the m steps of the period, (m + 1, *shape) at the nodes of a linear one. status: "solved";
    "planned", the inputs of the last plan for these steps; "fallback", those of the function `fallback`; or "guess",
    those of the inputs' guesses. sentence: the reason, or empty if it is solved. plan: name → (N, *shape), or (N + 1,
    *shape), the inputs from t + delay on. nodes: (N + 1, nx), the numbers of the planned states, whose names are the
    controller's `names`. times: (N + 1,), of the nodes, s. duration: of the plan, s. t: of the state, s.
    preparation_seconds, feedback_seconds: before the state was read, and after. violated: name → the violation of each
    soft constraint by the plan, (N + 1, rows), "end g" and so on of the end, (1, rows).
    """

    command: dict[str, np.ndarray]
    inputs: dict[str, np.ndarray]
    status: str
    sentence: str
    plan: dict[str, np.ndarray]
    nodes: np.ndarray
    times: np.ndarray
    duration: float
    t: float
    preparation_seconds: float
    feedback_seconds: float
    violated: dict[str, np.ndarray] = field(default_factory=dict)


@dataclass
class Record:
    """The counts of each status, and the seconds of both phases."""

    statuses: Counter[str] = field(default_factory=Counter)
    last_failure: str = ""
    preparation: list[float] = field(default_factory=list)
    feedback: list[float] = field(default_factory=list)

    def note(self, answer: MpcSolution) -> None:
        self.statuses[answer.status] += 1
        self.last_failure = answer.sentence or self.last_failure
        self.preparation.append(answer.preparation_seconds)
        self.feedback.append(answer.feedback_seconds)

    def rows(self) -> list[tuple[str, str]]:
        """Names and texts to print."""
        calls = sum(self.statuses.values())
        counts = ", ".join(f"{count} {name}" for name, count in self.statuses.items())
        rows = [("calls", f"{calls}: {counts}" if calls else "none")]
        for name, seconds in (("preparation", self.preparation), ("feedback", self.feedback)):
            if seconds:
                median, high = 1e3 * np.percentile(seconds, [50, 99])
                rows.append((name, f"{median:.3g} ms, {high:.3g} ms at the 99th percentile"))
        if self.last_failure:
            rows.append(("last failure", self.last_failure))
        return rows
