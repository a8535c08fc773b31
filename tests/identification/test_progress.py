"""A long identification says on a terminal, and in the log of a batch job, that it goes on; otherwise nothing."""

from __future__ import annotations

import io
import logging
import sys

import pytest
from tests.identification.test_sensor_model import NEAR, STATE, SYSTEM
from tests.torpedo import NOISE, zigzags

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.identification import Log, identify, synthetic_log
from coadjoint.simulation import progress


@pytest.fixture(scope="module")
def log() -> Log:
    t, inputs = zigzags(20.0)
    signals = {name: co.Held(t, values) for name, values in inputs.items()}
    run = co.simulate(SYSTEM, STATE, dt=0.05, duration=19.9, inputs=signals, save_every=2, monitors=False)
    return synthetic_log(run, noise=NOISE, seed=1)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("asked", "terminal", "shown"), [(None, True, True), (False, True, False), (None, False, False)]
)
def test_a_bar_is_shown_on_a_terminal_alone_unless_it_is_not_wanted(log, monkeypatch, asked, terminal, shown):
    monkeypatch.setattr(progress, "_QUIET_SECONDS", 0.0)
    monkeypatch.setattr(sys, "stderr", Terminal() if terminal else io.StringIO())
    identify(NEAR, log, start=STATE, parameters=["linear[0]"], progress=asked)
    said = sys.stderr.getvalue()
    assert ("simulations" in said and "identification of torpedo" in said) is shown
    assert shown or said == ""


@pytest.mark.long
def test_a_short_identification_shows_none(log, monkeypatch):
    monkeypatch.setattr(progress, "_QUIET_SECONDS", 1e9)
    monkeypatch.setattr(sys, "stderr", Terminal())
    identify(NEAR, log, start=STATE, parameters=["linear[0]"])
    assert sys.stderr.getvalue() == ""


@pytest.mark.long
def test_simulations_are_counted_in_the_log_of_a_batch_job(log, monkeypatch, caplog):
    monkeypatch.setattr(progress, "LOGGED_SECONDS", 0.0)
    with caplog.at_level(logging.INFO, "coadjoint"):
        found = identify(NEAR, log, start=STATE, parameters=["linear[0]"], progress=False)
    said = [record.getMessage() for record in caplog.records if record.name == "coadjoint.simulation.progress"]
    counts = [
        int(text.removeprefix("identification of torpedo: ").split()[0]) for text in said if "simulations" in text
    ]
    assert counts == list(range(1, len(counts) + 1)) and len(counts) > found.iterations


def test_progress_is_true_false_or_none(log):
    with pytest.raises(ArgumentError, match="Argument `progress` must be True or False"):
        identify(NEAR, log, start=STATE, parameters=["linear[0]"], progress="no")
