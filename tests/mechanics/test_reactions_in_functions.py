"""Reactions of constraints in functions of states: events, quantities, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from pinned import MASS, body, pinned, start

LEVEL = -20.0


def test_the_reaction_of_a_hanging_body_is_its_weight():
    system = pinned().replace(pin=[0.0, 0.0, 0.5])
    hanging = system.state(q=[0, 0, -0.5], a0=[0, 0, 1])
    found = evaluate(lambda state: co.mechanics.reactions_at(system, state)["pin"], hanging)
    np.testing.assert_allclose(found, [0, 0, 9.81 * MASS], atol=1e-12)


@pytest.mark.long
def test_an_event_reads_the_reaction_that_the_dataset_shows():
    system = pinned()

    def pull(state):
        return co.mechanics.reactions_at(system, state)["pin"][2] - LEVEL

    options = {"monitors": False, "accuracy": False, "backend": "native"}
    run = co.simulate(system, start(system), dt=0.01, duration=1.0, until=pull, **options)
    seen = run.dataset.reaction_pin.values[:, 2]
    assert run.event is not None and seen[0] > LEVEL and seen[-1] == pytest.approx(LEVEL, abs=1e-9)
    assert all(seen[:-1] > LEVEL)


def test_a_system_without_constraints_has_no_reactions():
    free = body()
    with pytest.raises(co.errors.ArgumentError, match="has no constraints that could have reactions"):
        co.mechanics.reactions_at(free, start(free))
