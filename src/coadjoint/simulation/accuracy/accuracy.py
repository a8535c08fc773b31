"""The result of judging the accuracy of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Accuracy:
    """The accuracy of a run at the judged steps, one row each.

    `steps` are their indices, `times` in s, `local_errors` relative to the motion of the run over a step (empty if a
    finished run was read again); `count` is their number, `median` and `worst` are of the errors, `part` of the state
    and time `when` belong to the worst; `turn` is the largest h‖ξ‖ as an angle, rad; `rate` is h times the fastest
    excited rate of the linearised motion, if known; `resolving` is a dt that resolves the motion, None if dt does;
    `reasons` say why dt does not. With accuracy="full": `trajectory` is the largest error of the trajectory, relative
    to the extent of the motion, and `holds` the time up to which it is below 10 %, None if it always is.
    """

    count: int
    median: float
    worst: float
    part: str
    when: float
    turn: float
    rate: float | None = None
    resolving: float | None = None
    reasons: tuple[str, ...] = ()
    trajectory: float | None = None
    holds: float | None = None
    steps: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    local_errors: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def resolved(self) -> bool:
        """Whether dt resolves the motion."""
        return not self.reasons

    def numbers(self) -> dict[str, Any]:
        """The values for a summary and a file, under plain names."""
        found = {key: getattr(self, name) for name, key in NAMES.items() if getattr(self, name) is not None}
        return {**found, "unresolved": "; ".join(self.reasons), "resolved": int(self.resolved)}


NAMES = {
    "count": "local_error_steps",
    "median": "local_error_median",
    "worst": "local_error_max",
    "part": "local_error_part",
    "when": "local_error_time",
    "turn": "turn_max",
    "rate": "fastest_rate",
    "resolving": "dt_resolving",
    "trajectory": "trajectory_error_max",
    "holds": "trajectory_holds_until",
}
"""The names of the fields of an `Accuracy` in a summary."""


def accuracy_from(numbers: Mapping[str, Any]) -> Accuracy | None:
    """The accuracy that `Accuracy.numbers` wrote; None if `numbers` lack it."""
    if "local_error_max" not in numbers:
        return None
    reasons = tuple(filter(None, str(numbers.get("unresolved", "")).split("; ")))
    return Accuracy(**{name: numbers[key] for name, key in NAMES.items() if key in numbers}, reasons=reasons)
