"""Whether the steps of a run resolve its motion: local errors, the turn of a step, rates of the linearised motion."""

from __future__ import annotations

import jax
import numpy as np

from coadjoint.mechanics.state import State
from coadjoint.simulation.accuracy.accuracy import Accuracy
from coadjoint.simulation.accuracy.doubling import Doubling
from coadjoint.simulation.accuracy.explicit_time import unresolved_time
from coadjoint.simulation.accuracy.pulses import unseen_pulses
from coadjoint.simulation.accuracy.rates import fastest_rate
from coadjoint.simulation.accuracy.ruler import packed
from coadjoint.simulation.accuracy.sample import FIRST, Kept, Sampler
from coadjoint.simulation.accuracy.signals import unresolved_inputs
from coadjoint.simulation.accuracy.stretches import with_steps_between
from coadjoint.simulation.accuracy.verdict import sentence, verdict, whose
from coadjoint.simulation.plan import Plan
from coadjoint.simulation.result import Result

STEPS, STEPS_BY_XLA, NODES_OF_MEMBERS, MEMBERS = 20, 6, 5, 8
"""How many steps are judged: of a run in native code, by XLA, of each member of an ensemble, and of how many."""


def chosen_members(run: Result) -> np.ndarray | None:
    """Which members of an ensemble are judged: the first, the last and a random choice; None of a run."""
    if run.members is None:
        return None
    between = np.random.default_rng(0).integers(0, run.members, MEMBERS - 2)
    return np.unique([0, *between, run.members - 1])


def accuracy_warnings(run: Result) -> list[str]:
    """A sentence where the steps do not resolve the motion."""
    found = run.accuracy
    if found is None or found.resolved:
        return []
    return [sentence(run.plan.h, found.reasons, found.resolving)]


def judged(run: Result, sampler: Sampler) -> Accuracy | None:
    """The accuracy of a run at the records that were kept; None where none were, or no step could be judged."""
    many = sampler.members is not None
    alone = STEPS if run.plan.backend == "native" else STEPS_BY_XLA
    kept = sampler.chosen(NODES_OF_MEMBERS if many else alone)
    if kept is None:
        return None
    kept = with_steps_between(kept, sampler.largest, run.plan, run.one[1], sampler.members)
    doubling = Doubling(run.plan, run.one[1])
    steps, rows, members = _finite(kept, sampler.members, np.ravel(doubling.places.xi))
    if not len(rows):
        return None
    records = doubling.probe.layout.unpack(rows)
    paced, h = run.method.over_fixed_steps(records, run.plan.h)
    rows = rows if paced is records else packed(paced)
    errors, sizes = doubling.errors(rows, h, members)
    if not errors.good.any():
        return None
    return _judgement(run, doubling, paced, rows, h, members, steps, errors, sizes)


def unresolved_records(plan: Plan, records: State) -> str | None:
    """What is to be warned of the steps of a plan from some of its records, evenly chosen; None where nothing is."""
    count = len(records.t)
    most = STEPS if plan.backend == "native" else STEPS_BY_XLA
    chosen = np.unique(np.concatenate([np.arange(min(FIRST, count)), np.linspace(0, count - 1, most).astype(int)]))
    some = jax.tree.map(lambda leaf: np.asarray(leaf)[chosen], records)
    paced, h = plan.program.method.over_fixed_steps(some, plan.h)
    doubling = Doubling(plan, jax.tree.map(lambda leaf: leaf[0], some))
    rows = packed(paced)
    errors, sizes = doubling.errors(rows, h)
    if not errors.good.any():
        return None
    found = verdict(doubling, rows, h, None, errors, sizes, plan.h, turns=False)
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
    return Accuracy(
        count=int(good.sum()),
        median=float(np.median(errors.local)),
        worst=found.size,
        part=found.part,
        when=found.when,
        turn=found.turn,
        rate=fastest_rate(doubling, rows[good][worst], float(h[good][worst]), whose(members, good, worst)),
        resolving=min(fine) if fine else None,
        reasons=tuple(reasons),
        steps=steps[good],
        times=times[good],
        local_errors=errors.local,
    )
