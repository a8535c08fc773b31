"""Whether the steps of a run resolve its motion: local errors, the turn of a step, rates of the linearised motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from coadjoint.groups import Power
from coadjoint.groups.matrix_coordinates import MatrixCoordinates
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.simulation.accuracy.doubling import Doubling
from coadjoint.simulation.accuracy.explicit_time import unresolved_time
from coadjoint.simulation.accuracy.pulses import unseen_pulses
from coadjoint.simulation.accuracy.rates import fastest_rate
from coadjoint.simulation.accuracy.sample import Kept, Sampler
from coadjoint.simulation.accuracy.signals import unresolved_inputs
from coadjoint.simulation.accuracy.stretches import with_steps_between

if TYPE_CHECKING:
    from coadjoint.simulation.ensemble import Ensemble
    from coadjoint.simulation.run import Run

TOO_MUCH, TOO_MUCH_OF_ORDER_ONE = 0.05, 0.1
"""The local error, relative to the motion over a step, from which on a motion is not resolved."""

ENVELOPE = 1.0
"""The angle, rad, by which a step may turn a body (the supported envelope), unless its local error is small."""

EXACT = 0.02
"""The local error, relative to the limit, below which a step may turn further: about a fixed axis, or of high order."""

HALVINGS = 24
"""How often dt is halved at most in search of one that would do."""

STEPS, STEPS_BY_XLA, NODES_OF_MEMBERS, MEMBERS = 20, 6, 5, 8
"""How many steps are judged: of a run in native code, by XLA, of each member of an ensemble, and of how many."""


@dataclass(frozen=True)
class Accuracy:
    """The accuracy of a run at the steps that were judged, a row each.

    `steps` their indices, `times` in s, `local_errors` relative to the motion of the run over a step (empty where a
    finished run was read again); `count` how many, `median` and `worst` of the errors, `part` of the state and time
    `when` of the worst; `turn` the largest h‖ξ‖ as an angle, rad; `rate` h times the fastest rate of the linearised
    motion that is excited, where known; `resolving` the dt that would do where the motion is not resolved, None where
    it is; `reasons` why it is not. With accuracy="full": `trajectory` the largest error of the trajectory, relative to
    how far the run goes, and `holds` the time up to which it is below 10 %, None where it is all along.
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
        """Whether nothing speaks against dt."""
        return not self.reasons

    def numbers(self) -> dict[str, Any]:
        """What goes into a summary and into a file, under plain names."""
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
"""What the fields of an `Accuracy` are called in a summary."""


def accuracy_from(numbers: Mapping[str, Any]) -> Accuracy | None:
    """The accuracy that `Accuracy.numbers` wrote; None where there is none."""
    if "local_error_max" not in numbers:
        return None
    reasons = tuple(filter(None, str(numbers.get("unresolved", "")).split("; ")))
    return Accuracy(**{name: numbers[key] for name, key in NAMES.items() if key in numbers}, reasons=reasons)


def chosen_members(run: Run | Ensemble) -> np.ndarray | None:
    """Which members of an ensemble are judged, evenly among all; None of a run."""
    members = getattr(run, "members", None)
    if members is None:
        return None
    return np.unique(np.linspace(0, members.count - 1, MEMBERS).astype(int))


def accuracy_warnings(run: Run | Ensemble) -> list[str]:
    """A sentence where the steps do not resolve the motion."""
    found = run.accuracy
    if found is None or found.resolved:
        return []
    return [
        f"dt = {run.plan.h:g} does not resolve this motion: {'; '.join(found.reasons)}. Take dt = "
        f"{found.resolving:.2g} or less. What is conserved does not tell."
    ]


def judged(run: Run | Ensemble, sampler: Sampler) -> Accuracy | None:
    """The accuracy of a run at the records that were kept; None where none were, or no step could be judged."""
    many = sampler.members is not None
    alone = STEPS if run.plan.backend == "native" else STEPS_BY_XLA
    kept = sampler.chosen(NODES_OF_MEMBERS if many else alone)
    if kept is None:
        return None
    axes, count = (run.axes, run.members.count) if many else (None, 1)  # pyright: ignore[reportAttributeAccessIssue]
    kept = with_steps_between(kept, sampler.largest, run.plan, run.one[1], sampler.members, axes, count)
    doubling = Doubling(run.plan, run.one[1], axes, count)
    steps, rows, members = _finite(kept, sampler.members, np.ravel(doubling.places.xi))
    if not len(rows):
        return None
    records = doubling.probe.layout.unpack(rows)
    paced, h = run.method.over_fixed_steps(records, run.plan.h)
    rows = rows if paced is records else doubling.packed(paced)
    errors, sizes = doubling.errors(rows, h, members)
    if not errors.good.any():
        return None
    return _judgement(run, doubling, paced, rows, h, members, steps, errors, sizes)


def _finite(kept: Kept, members: np.ndarray | None, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Steps, records and members, a row each; a member that has failed has none from there on: its ξ is NaN."""
    if members is None:
        return kept.steps, kept.rows, None
    rows = kept.rows.reshape(-1, kept.rows.shape[-1])
    seen = np.isfinite(rows[:, xi]).all(axis=1)
    steps, whose = np.repeat(kept.steps, len(members)), np.tile(members, len(kept.steps))
    return steps[seen], rows[seen], whose[seen]


def _judgement(run, doubling, records, rows, h, members, steps, errors, sizes) -> Accuracy:
    good, times = errors.good, np.asarray(records.t)
    worst = int(np.argmax(errors.largest))
    turns = np.abs(h) * turning(run.system.group, np.asarray(records.xi))
    limit = TOO_MUCH if run.method.order > 1 else TOO_MUCH_OF_ORDER_ONE
    size, part, when = float(errors.largest[worst]), errors.part[worst], float(times[good][worst])
    reasons, fine = [], []
    if not size < limit:
        reasons.append(f"one step is off by {size:.0%} of what it moves ({part}, t = {when:.4g} s)")
        fine.append(
            _resolving(doubling, rows[good][[worst]], h[good][[worst]], _whose(members, good, worst), limit, sizes)
        )
    if turns.max() > ENVELOPE and size > EXACT * limit:
        reasons.append(f"a step turns by {turns.max():.2g} rad")
        fine.append(abs(run.plan.h) * 0.25 * ENVELOPE / turns.max())
    for name, dt in unresolved_inputs(run, records, h) or unseen_pulses(run):
        reasons.append(f"the input{name} varies within a step")
        fine.append(dt)
    if (dt := unresolved_time(doubling, rows, h, members)) is not None:
        reasons.append("what depends on time varies within a step")
        fine.append(dt)
    return Accuracy(
        count=int(good.sum()),
        median=float(np.median(errors.local)),
        worst=size,
        part=part,
        when=when,
        turn=float(turns.max()),
        rate=fastest_rate(doubling, rows[good][worst], float(h[good][worst]), _whose(members, good, worst)),
        resolving=min(fine) if fine else None,
        reasons=tuple(reasons),
        steps=steps[good],
        times=times[good],
        local_errors=errors.local,
    )


def _whose(members: Any, good: np.ndarray, worst: int) -> Any:
    return None if members is None else np.asarray(members)[good][[worst]]


def _resolving(doubling: Doubling, row, h, whose, limit: float, sizes: dict[str, float]) -> float:
    """The largest dt = h/2^j whose local error, and that of the half of it, is under half the limit."""
    well = 0
    for halving in range(1, HALVINGS):
        step = h / 2**halving
        errors, _ = doubling.errors(row, step, whose, _local_sizes(sizes, halving), at_least=True)
        well = well + 1 if errors.good.all() and errors.largest[0] < 0.5 * limit else 0
        if well == 2:
            return float(abs(2 * step[0]))
    return float(abs(h[0]) / 2**HALVINGS)


def _local_sizes(sizes: dict[str, float], halving: int) -> dict[str, float]:
    """What is moved over a step shrinks with it, momenta do not."""
    return {name: size if name.startswith("momentum") else size / 2**halving for name, size in sizes.items()}


def turning(group: Any, xi: np.ndarray) -> np.ndarray:
    """The largest frequency of ad_ξ, rad/s, of every row: |ω| for rotations and rigid motions."""
    if isinstance(group, MatrixCoordinates) and not group.dense:
        return np.array([_spread(evaluate(group.hat, row)) for row in xi])
    if isinstance(group, Power):
        links = np.reshape(xi, (len(xi) * group.count, group.factor.dim))
        return turning(group.factor, links).reshape(len(xi), group.count).max(axis=1)
    structure = _structure(group)
    if not structure.any():
        return np.zeros(len(xi))
    return np.max(np.abs(np.linalg.eigvals(np.einsum("ijk,rj->rik", structure, xi)).imag), axis=1)


def _spread(matrix: np.ndarray) -> float:
    """The largest difference of the imaginary parts of two eigenvalues: eigenvalues of ad_ξ are differences of ξ̂'s."""
    return float(np.ptp(np.linalg.eigvals(matrix).imag))


_structures: dict[Any, np.ndarray] = {}


def _structure(group: Any) -> np.ndarray:
    """c with [ξ, η]_i = c_ijk ξ_j η_k."""
    if group not in _structures:
        eye = np.eye(group.dim)
        rows = evaluate(lambda e: jax.vmap(lambda x: jax.vmap(lambda y: group.ad(x, y))(e))(e), eye)
        _structures[group] = np.transpose(rows, (2, 0, 1))
    return _structures[group]
