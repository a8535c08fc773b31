"""Reactions of constraints in functions of states: events, quantities, and refusals."""

from __future__ import annotations

import pytest

import coadjoint as co
from pinned import body, pinned, start

LEVEL = -20.0


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
