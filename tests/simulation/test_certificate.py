"""The certificate: five lines or all, changes that are absolute near zero, budgets of forced runs, named events."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.simulation import energy_budget
from coadjoint.simulation.certificate_forms import MEANINGS, Certificate, aligned, glossary, linked, rows

RUN: dict[str, Any] = {"dt": 0.05, "progress": False, "accuracy": False}
PENDULUM = co.System(co.SO3(), lambda xi, a: 0.5 * xi @ xi - 10.0 * a[0], advected=co.Defining(), name="pendulum")


def lines(run: Any) -> dict[str, str]:
    return dict(rows(run.certificate.long()))


@pytest.fixture(scope="module")
def near_zero():
    """A pendulum at rest, level with its pivot but for 1e-2: its energy is 0.1, its motion has one of 10."""
    return co.simulate(PENDULUM, PENDULUM.state(xi=[0, 0, 0], a0=[1e-2, 0, 1]), steps=60, **RUN)


def test_texts_begin_in_one_column_behind_the_longest_title():
    assert aligned([("dt", "0.1 s"), ("method", "midpoint")]) == "dt      0.1 s\nmethod  midpoint"


@pytest.fixture(scope="module")
def level():
    return co.simulate(PENDULUM, PENDULUM.state(xi=[0, 0, 0], a0=[0, 0, 1]), steps=60, **RUN)


def test_changes_are_absolute_where_the_start_is_smaller_than_they_are(level):
    watching = PENDULUM.watching({"height": lambda state, p: state.a[0]})
    run = co.simulate(watching, watching.state(xi=[0, 0, 0], a0=[0, 0, 1]), steps=60, **RUN)
    assert run.size("height") == 0 and run.relative_change("height") == np.ptp(run.extrema["height"])
    assert "largest absolute change" in lines(run)["height"]


def test_the_change_of_an_energy_near_zero_is_relative_to_the_kinetic_energy(near_zero, level):
    """0.03 of 10 is no error, whatever the energy at the start is; of a step of 0.8 s, it is one."""
    for run in (near_zero, level):
        change, motion = float(np.ptp(run.extrema["energy"])), float(run._kinetic())
        assert 1e-2 < change < 0.1 and 9 < motion < 11 and run.size("energy") == motion
        assert run.relative_change("energy") == pytest.approx(change / motion, rel=0.1)
        assert "of the largest kinetic energy" in lines(run)["energy"] and run.warnings == []
        assert re.search(r"energy to \d\.\de-03, ", str(run))
        (axes,) = run.plot.energy().axes
        assert "E(t) - E(0)" in axes.get_ylabel()
    fleet = co.simulate(PENDULUM, PENDULUM.state(xi=[0, 0, 0], a0=co.each([[1e-2, 0, 1], [0, 0, 1]])), steps=60, **RUN)
    np.testing.assert_allclose(
        fleet.relative_changes("energy"), [one.relative_change("energy") for one in (near_zero, level)], rtol=1e-9
    )
    coarse = co.simulate(PENDULUM, PENDULUM.state(xi=[0, 0, 0], a0=[1e-2, 0, 1]), steps=50, **RUN | {"dt": 0.8})
    (told,) = [sentence for sentence in coarse.warnings if "The energy, which nothing changes, is off by " in sentence]
    assert "too large" in told and "diamond" not in told
    for resolved, end in ((True, "; print it for the certificate>"), (False, "; unresolved: print it for the reason>")):
        coarse.accuracy = SimpleNamespace(resolved=resolved)
        assert repr(coarse).endswith(end)
    coarse.accuracy = SimpleNamespace(resolved=True)
    (told,) = energy_budget._changed(coarse)
    assert "too large" not in told and "line `accuracy`" in told


def test_changes_follow_the_extrema_of_a_run_that_goes_on(level, monkeypatch):
    before, (low, high) = level.relative_change("energy"), level.extrema["energy"]
    monkeypatch.setattr(level.position, "extrema", level.extrema | {"energy": (low, high + 1.0)})
    assert level.relative_change("energy") > before


def test_the_energy_of_a_forced_run_is_a_budget_and_not_an_error():
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(-0.1 * motion.xi))
    run = co.simulate(body, body.state(xi=[0, 0, 1]), steps=100, **RUN)
    told = lines(run)
    for title in ("energy", "energy, discrete", "Kelvin–Noether"):
        assert "change it" in told[title] and "largest" not in told[title]
    assert re.match(r"momentum budget to \de?.*, energy budget to ", dict(rows(str(run)))["conserved"])
    fleet = co.simulate(body, body.state(xi=co.each([[0, 0, 1.0], [0, 1.0, 0]])), steps=20, **RUN)
    assert "energy" not in lines(fleet) and "energy budget" in lines(fleet)


def crossing(state):
    return state.mu[0] + 0.05


@pytest.mark.parametrize(
    ("until", "name"),
    [
        (crossing, "crossing"),
        (co.Event(crossing, name="apogee"), "apogee"),
        (lambda state: crossing(state), "the event"),
    ],
)
def test_an_event_is_named(until, name):
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ (jnp.array([1.0, 1.0, 2.0]) * xi))
    run = co.simulate(body, body.state(xi=[0.1, 0, 3]), steps=60, until=until, **RUN)
    assert f"{name} ended the run at t = {run.event:.10g} s" in lines(run)["event"]
    assert f"{name} ended the run" in dict(rows(str(run)))["steps"]
    assert run.summary().get("event_name", "the event") == name


def test_each_line_leads_to_its_meaning(near_zero):
    text = near_zero.certificate.long()
    anchors = re.findall(r'<a href="#([^"]+)">', linked(text))
    assert len(anchors) == len(rows(text)) and all(f'id="{anchor}"' in glossary([text]) for anchor in anchors)
    shown = near_zero.certificate._repr_html_()
    assert shown.count("<tr>") == shown.count("<th ") == len(rows(text)) + len(rows(str(near_zero)))
    assert f'title="{MEANINGS["balance"].split(",")[0]}' in shown and "<details>" in shown


def test_files_of_earlier_versions_have_the_long_form_alone():
    assert Certificate.held({}) is None
    assert Certificate.held({"card": "all"}) == Certificate("all", "all")
    assert Certificate.held({"card": "all", "certificate": "five"}) == Certificate("five", "all")
