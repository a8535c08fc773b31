"""Sinks take the records of a run at cadences of their own, and each of them the last one."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
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
