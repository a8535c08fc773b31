"""Sinks take the records of a run at cadences of their own, and each of them the last one."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

import coadjoint as co
from coadjoint.simulation.accuracy import sample
from coadjoint.simulation.accuracy.sample import KINDS, Sampler
from coadjoint.simulation.driver import Driver
from coadjoint.simulation.event_driver import EventDriver
from coadjoint.simulation.problem import SimulationProblem
from coadjoint.simulation.sinks import Memory, Outputs, Scheduled


@pytest.mark.cases(2)
@pytest.mark.parametrize("events", [None, {"turn": lambda s: s.xi[0]}])
@pytest.mark.parametrize(("every", "common"), [((4, 6), 2), ((3, 5), 1), ((20, 100), 20)])
def test_each_sink_has_the_records_of_its_cadence_and_the_last_one(every, common, events):
    system = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ (p.inertia * xi), parameters={"inertia": [1.0, 2.0, 3.0]})
    start, steps = system.state(xi=[0.3, -0.2, 2.0]), 47
    made = {"dt": 0.05, "steps": steps, "accuracy": False, "progress": False}
    full = co.simulate(system, start, **made).records.mu
    run = SimulationProblem(system, start, co.Midpoint(), 0.05, steps, 1, True, events=events).set_up()
    sinks = [Memory() for _ in every]
    outputs = Outputs([Scheduled(sink, cadence) for sink, cadence in zip(sinks, every, strict=True)])
    assert outputs.every == common
    kind = (lambda *given: EventDriver(*given, run.crossed)) if events else Driver
    kind(run.plan, outputs, False, "run").drive(run.position)
    for sink, cadence in zip(sinks, every, strict=True):
        nodes = [*range(0, steps, cadence), steps]
        np.testing.assert_array_equal(np.concatenate(sink.steps), nodes)
        np.testing.assert_array_equal(np.concatenate([records.mu for records in sink.records]), full[nodes])
        assert len(np.concatenate([rows["energy"] for rows in sink.monitors])) == len(nodes)


class Row(NamedTuple):
    """Records as sinks take them."""

    t: np.ndarray
    xi: np.ndarray
    nu: np.ndarray
    mu: np.ndarray
    pi: np.ndarray


@pytest.mark.parametrize("room", [3000, 1 << 18])
@pytest.mark.parametrize("members", [None, np.array([0, 2])])
def test_the_sample_follows_the_largest_changes_and_momenta_whatever_the_chunks(monkeypatch, members, room):
    monkeypatch.setattr(sample, "ROOM", room)
    count, axes = 5000, () if members is None else (3,)
    random = np.random.default_rng(3)
    fields = [random.normal(size=(count, *axes, size)) for size in (3, 0, 9, 3)]
    fields[0][count // 2] = np.nan
    fields[2][2059:] += 50.0  # between two chunks
    fields[3][3059 if members is None else 2559 :] += 80.0  # between two blocks of a chunk
    for number, place in ((2, 2200), (0, 4000)):  # as large in two places
        fields[0][place - 1 : place + 2] = 0.0
        fields[0][place, ..., number] = 90.0
    records = Row(np.zeros((count, *axes)), *fields)
    kept = SimpleNamespace(sampled=None, last=None)
    sampler = Sampler(kept, count, 1, members)  # type: ignore[arg-type]
    for a, b in pairwise([0, 10, 2058, 2059, count]):
        sampler.append(np.arange(a, b), Row(*(x[a:b] for x in records)), {})  # type: ignore[arg-type]
    found = dict(zip(KINDS, sampler.numbers()["largest"].tolist(), strict=True))
    chosen = dict(zip(Row._fields[1:], (x if members is None else x[:, members] for x in fields), strict=True))
    for field in ("xi", "mu", "pi"):
        change = np.nan_to_num(np.abs(np.diff(chosen[field], axis=0))).reshape(count - 1, -1).max(axis=1)
        assert found[field] == [change.max(), change.argmax()]
    for field in ("mu", "pi"):
        size = np.sqrt(np.sum(chosen[field] ** 2, axis=-1)).reshape(count, -1).max(axis=1)
        assert found[f"largest {field}"] == [size.max(), size.argmax()]
    assert found["nu"] == [-1.0, -1]
