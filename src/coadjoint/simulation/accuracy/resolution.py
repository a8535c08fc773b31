"""Whether the steps of a run resolve its motion: local errors, the turn of a step, rates, the error of a trajectory."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.kernels import packing
from coadjoint.kernels.packing import layout
from coadjoint.mechanics.state import State
from coadjoint.simulation.accuracy.local_error import differences, relative, sizes_of
from coadjoint.simulation.accuracy.ruler import Doubling, ruler_of
from coadjoint.simulation.accuracy.sample import FIRST, Kept, Sampler, with_steps_between
from coadjoint.simulation.accuracy.time_dependence import unresolved_inputs, unresolved_time, unseen_pulses
from coadjoint.simulation.accuracy.verdict import Accuracy, largest_turn, sentence, verdict, whose
from coadjoint.simulation.plan import Plan
from coadjoint.simulation.result import Result

STEPS, STEPS_BY_XLA, NODES_OF_MEMBERS, MEMBERS = 20, 6, 5, 8
"""The number of judged steps: of a run in native code, by XLA, of each member of an ensemble; and of members."""


def chosen_members(run: Result) -> np.ndarray | None:
    """The judged members of an ensemble: the first, the last and a random choice; None for a run."""
    if run.members is None:
        return None
    between = np.random.default_rng(0).integers(0, run.members, MEMBERS - 2)
    return np.unique([0, *between, run.members - 1])


def accuracy_warnings(run: Result) -> list[str]:
    """A message if the steps do not resolve the motion."""
    found = run.accuracy
    if found is None or found.resolved:
        return []
    return [sentence(run.plan.h, found.reasons, found.resolving)]


def judged_run(run: Result, sampler: Sampler) -> Accuracy | None:
    """The accuracy of a run at the kept records; None if no records were kept or no step could be judged."""
    many = sampler.members is not None
    alone = STEPS if run.plan.backend == "native" else STEPS_BY_XLA
    kept = sampler.chosen(NODES_OF_MEMBERS if many else alone)
    if kept is None:
        return None
    kept = with_steps_between(kept, sampler.changing, run.plan, run.one[1], sampler.members)
    doubling = Doubling(run.plan, run.one[1])
    steps, rows, members = _finite(kept, sampler.members, np.ravel(doubling.places.xi))
    if not len(rows):
        return None
    records = doubling.probe.layout.unpack(rows)
    paced, taken = run.method.over_fixed_steps(records, run.plan.h)
    h = np.asarray(taken)
    rows = rows if paced is records else packing.rows(paced)
    errors, sizes = doubling.errors(rows, h, members)
    if not errors.good.any():
        return None
    return _judgement(run, doubling, paced, rows, h, members, steps, errors, sizes)


def unresolved_records(plan: Plan, records: State) -> str | None:
    """The warning about the steps of a plan, judged from evenly spaced records; None if dt resolves them."""
    count = len(records.t)
    most = STEPS if plan.backend == "native" else STEPS_BY_XLA
    chosen = np.unique(np.concatenate([np.arange(min(FIRST, count)), np.linspace(0, count - 1, most).astype(int)]))
    some = jax.tree.map(lambda leaf: np.asarray(leaf)[chosen], records)
    paced, taken = plan.program.method.over_fixed_steps(some, plan.h)
    h = np.asarray(taken)
    doubling = Doubling(plan, jax.tree.map(lambda leaf: leaf[0], some))
    rows = packing.rows(paced)
    errors, sizes = doubling.errors(rows, h)
    if not errors.good.any():
        return None
    found = verdict(doubling, rows, h, None, errors, sizes, plan.h)
    return sentence(plan.h, found.reasons, min(found.fine)) if found.reasons else None


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
    found = verdict(doubling, rows, h, members, errors, sizes, run.plan.h)
    reasons, fine, worst = found.reasons, found.fine, found.worst
    for name, dt in unresolved_inputs(run, records, h) or unseen_pulses(run):
        reasons.append(f"the input{name} varies within a step")
        fine.append(dt)
    if (dt := unresolved_time(doubling, rows, h, members)) is not None:
        reasons.append("what depends on time varies within a step")
        fine.append(dt)
    fastest = doubling, rows[good][worst], float(h[good][worst]), whose(members, good, worst)
    accuracy = Accuracy(
        count=int(good.sum()),
        median=float(np.median(errors.local)),
        worst=found.size,
        part=found.part,
        when=found.when,
        turn=found.turn or 0.0,
        rate=None,
        resolving=min(fine) if fine else None,
        reasons=tuple(reasons),
        steps=steps[good],
        times=times[good],
        local_errors=errors.local,
    )
    later = {} if found.turn is not None else {"turn": partial(largest_turn, doubling, rows, h)}
    return accuracy.postponed(rate=partial(fastest_rate, *fastest), **later)


SHORT = 1e-3
"""The part of a step over which the flow is linearised: its rates are those of the equations, not of the method."""


NUDGE = 1e-6
"""The difference, relative to each kind of coordinate, by which it is linearised."""


SLOWEST = 1e-9
"""Rates below this, over that part of a step, are round-off."""


EXCITED = 1e-3
"""The distance of a mode from its equilibrium, relative to the state, above which it counts as excited."""


LARGEST = 24
"""The most coordinates (μ, n, π, a) of a system whose rates are given."""


def fastest_rate(doubling: Doubling, row: np.ndarray, h: float, whose: PyTree) -> float | None:
    """h·max|λ| over the excited modes of ẋ = Ax + f at a record, x = (μ, n, π, a); None if unknown.

    A mode v with eigenvalue λ is excited by |c|/|λ|, f = Σ c v: its distance from its equilibrium. Where ℓ is linear in
    the velocities (μ, π) follow from the place, and no other x moves.
    """
    places, system = doubling.places, doubling.plan.program.skeleton
    kinds = [np.ravel(x).astype(int) for x in (places.mu, places.n, places.pi, places.a) if np.size(x)]
    index = np.concatenate(kinds)
    follow = system.lagrangian is not None and not doubling.plan.program.method.regular
    if follow or doubling.plan.backend != "native" or not system.additional.flat or len(index) > LARGEST:
        return None
    sizes = np.concatenate([np.full(len(kind), np.max(np.abs(row[kind])) or 1.0) for kind in kinds])
    step, count = SHORT * h, len(index)
    rows = np.repeat(row[None], 2 * count + 1, axis=0)
    each = np.arange(count)
    rows[each, index] += NUDGE * sizes
    rows[count + each, index] -= NUDGE * sizes
    members = None if whose is None else np.repeat(whose, len(rows))
    after, good = doubling.over(rows, np.full(len(rows), step), (1.0,), members)
    if not good.all():
        return None
    ends = after[:, index] / sizes
    flow = (ends[:count] - ends[count:-1]).T / (2 * NUDGE)
    return _excited(flow, (ends[-1] - row[index] / sizes), SHORT)


def _excited(flow: np.ndarray, moved: np.ndarray, short: float) -> float | None:
    """The largest |λ|h of the flow over short·h whose mode has a share in the motion; None if LAPACK finds no modes."""
    try:
        values, modes = np.linalg.eig(flow)
        # The flow of every method of order 1 and more is (1 + z/2)/(1 − z/2) up to small terms, z = short·hλ.
        z = 2 * (values - 1) / (values + 1)
        shares = np.linalg.solve(modes, moved.astype(complex))
    except np.linalg.LinAlgError:
        return None
    away = np.abs(shares) * np.max(np.abs(modes), axis=0) / np.maximum(np.abs(z), SLOWEST)
    excited = (np.abs(z) > SLOWEST) & (away > EXCITED)
    return float(np.max(np.abs(z[excited]), initial=0.0) / short)


HOLDS = 0.1
"""The error, relative to the extent of the motion, up to which a trajectory counts as accurate."""


def require_full(many: bool, variable: bool, stored: bool, watched: bool) -> None:
    """Raise ArgumentError for runs whose nodes a second run with half the step does not share."""
    for wrong, what in ((many, "an ensemble"), (variable, "a method with steps of its own"), (stored, "`store`")):
        if wrong:
            raise ArgumentError(f'accuracy="full" compares two runs in memory, so it does not go with {what}.')
    if watched:
        raise ArgumentError('accuracy="full" compares whole runs: leave out `until` and `events`.')


def with_trajectory_error(run: Result, finer: Result) -> None:
    """Put the error of the trajectory of `run` into its accuracy; finer: the same run with half the step."""
    if run.accuracy is None:
        return
    errors, times = trajectory_errors(run, finer.records), np.asarray(run.records.t)
    late = np.flatnonzero(errors > HOLDS)
    holds = float(times[max(late[0] - 1, 0)]) if len(late) else None
    run.accuracy = replace(run.accuracy, trajectory=float(errors.max()), holds=holds)


def trajectory_errors(run: Result, others: State, ratio: float = 2.0) -> np.ndarray:
    """The error at every node, from the difference to records of steps h/ratio: divided by 1 − ratio^{−p}.

    It is relative to the largest distance of each part of the state from its start; for momenta to their own size.
    """
    count = min(len(run.records.t), len(others.t))
    ours, theirs = (jax.tree.map(lambda leaf: leaf[:count], records) for records in (run.records, others))
    begun = jax.tree.map(lambda leaf: np.broadcast_to(leaf[:1], leaf.shape), ours)
    ruler = ruler_of(layout(jax.tree.map(lambda leaf: leaf[0], ours)), ours.places)
    found = differences(ruler, *(packing.rows(states) for states in (begun, theirs, ours)))
    first = run.method.start == "velocity" or run.system.takes("internal")
    return relative(found, sizes_of(found))[0] / (1 - ratio ** -(1 if first else run.method.order))
