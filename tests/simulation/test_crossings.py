"""Crossings: every one between two nodes is found, once, with its direction; collected over runs and ensembles."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.models import rigid_body
from coadjoint.simulation.events import candidates, crossings

BODY = rigid_body.make(inertia=(1.0, 1.0, 2.0))
START = rigid_body.start(BODY, angular_velocity=(0.5, 0.0, 1.5))
"""μ₁ = ½ cos(ω₃t): a symmetric body with J₃ = 2J₁ turns its momentum about its axis at ω₃ = 1.5 rad/s."""


def first_momentum(state):
    return state.mu[0]


def second_momentum(state):
    return state.mu[1] ** 2 - 0.09


def simulate(**arguments):
    given = {"dt": 0.05, "duration": 40.0, "method": co.methods.KahanLi8(co.Midpoint()), "progress": False, **arguments}
    return co.simulate(BODY, START, **given)


@pytest.fixture(scope="module")
def watched():
    events = {
        "both": first_momentum,
        "rising": co.Event(first_momentum, "rising"),
        "falling": co.Event(first_momentum, "falling"),
    }
    return simulate(events=events, save_every=100)


def test_every_crossing_is_collected_at_its_time_with_its_state_and_direction(watched):
    zeros = (0.5 + np.arange(19)) * np.pi / 1.5
    np.testing.assert_allclose(watched.events["both"].t, zeros, atol=2e-9)
    np.testing.assert_allclose(watched.events["falling"].t, zeros[::2], atol=2e-9)
    np.testing.assert_allclose(watched.events["rising"].t, zeros[1::2], atol=2e-9)
    sections = watched.events["both"]
    assert np.max(np.abs(sections.mu[:, 0])) < 1e-12
    np.testing.assert_allclose(np.abs(sections.mu[:, 1]), 0.5, atol=1e-9)
    assert watched.good_steps == 800 and watched.count == 9 and watched.event is None
    assert "both: 19, rising: 9, falling: 10" in watched.certificate.long()


@pytest.mark.long
def test_events_change_nothing_else(watched):
    plain = simulate(save_every=100)
    for name in ("mu", "g", "t", "xi"):
        np.testing.assert_array_equal(getattr(watched.records, name), getattr(plain.records, name))
    assert watched.extrema.keys() == plain.extrema.keys() and watched.monitors.keys() == plain.monitors.keys()
    silent = simulate(save_every=100, monitors=False, events={"both": first_momentum})
    assert not silent.extrema and not silent.monitors and len(silent.events["both"].t) == 19


@pytest.mark.cases(1)
@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_a_run_that_goes_on_from_an_event_comes_to_the_next_one(backend):
    run, times = START, []
    for _ in range(6):
        found = co.simulate(
            BODY, run, dt=0.1, duration=10.0, until=first_momentum, backend=backend, progress=False, monitors=False
        )
        run = found.final
        times.append(found.event)
    # The midpoint rule turns the momentum by the same angle in all steps; parts of steps differ by O(h²).
    np.testing.assert_allclose(np.diff(times), np.pi / 1.5, rtol=0.03)


@pytest.mark.long
def test_the_first_of_two_crossings_in_one_step_ends_the_run():
    def twice(state):
        return jnp.cos(4.0 * (state.t - 0.05)) - jnp.cos(4.0 * 0.0214)

    found = simulate(until=twice, dt=0.1)
    assert found.event == pytest.approx(0.0286, abs=1e-12) and found.good_steps == 1
    pair = simulate(events={"twice": twice}, dt=0.1, duration=1.0).events["twice"].t
    np.testing.assert_allclose(pair, [0.0286, 0.0714], atol=1e-12)
    falling = simulate(until=co.Event(twice, "falling"), dt=0.1)
    assert falling.event == pytest.approx(0.0714, abs=1e-12)


@pytest.mark.parametrize("first", [0, 3, 6])
@pytest.mark.parametrize("top", [0.2, 0.37, 0.8])
@pytest.mark.parametrize("gap", [1e-1, 1e-2, 1e-3])
def test_near_crossings_are_told_from_crossings(gap, top, first):
    """cos 0.9(x − top) − 1 ± gap², whose maximum between two nodes is just over and just under zero."""
    nodes = np.arange(8.0) - first
    for sign in (-1, 1):

        def f(x, sign=sign):
            return np.cos(0.9 * (x - top)) - 1 + sign * gap**2

        found = [
            c
            for i in candidates(f(nodes), 7)
            for c in crossings(f(nodes), int(i), lambda theta, i=i, f=f: float(f(i - first + theta)))
            if i == first
        ]
        assert [c.rises for c in found] == ([True, False] if sign > 0 else [])
        half = np.arccos(1 - gap**2) / 0.9
        assert [c.theta for c in found] == pytest.approx([top - half, top + half][: len(found)], abs=1e-10)


def test_three_crossings_in_one_step_are_three():
    nodes = np.arange(6.0)

    def f(x):
        return (x - 0.2) * (x - 0.5) * (x - 0.7) * (1 + 0.01 * x)

    assert 0 in candidates(f(nodes), 1)
    found = crossings(f(nodes), 0, f)
    assert [c.theta for c in found] == pytest.approx([0.2, 0.5, 0.7], abs=1e-12)
    assert [c.rises for c in found] == [True, False, True]


def test_an_event_that_is_not_finite_fails_in_a_sentence_and_is_no_event():
    def root(state):
        return jnp.sqrt(0.1234 - state.t) + 1.0

    for given in ({"until": root}, {"events": {"root": root}}):
        with pytest.raises(co.errors.StepError, match=r"the function `(until|root)` is not finite there"):
            simulate(**given)


@pytest.fixture(scope="module")
def fleet():
    spins = np.array([1.5, 2.0, 0.0, 3.0])
    starts = BODY.state(xi=co.each(np.stack([[0.5, 0.1, spin] for spin in spins])))
    events = {"second": co.Event(second_momentum, "rising")}
    many = co.simulate(BODY, starts, dt=0.1, duration=5.0, until=first_momentum, events=events, progress=False)
    alone = [
        co.simulate(
            BODY,
            BODY.state(xi=[0.5, 0.1, spin]),
            dt=0.1,
            duration=5.0,
            until=first_momentum,
            events=events,
            progress=False,
        )
        for spin in spins
    ]
    return many, alone


def test_every_member_of_an_ensemble_ends_at_its_own_event_as_it_would_alone(fleet):
    many, alone = fleet
    expected = [np.nan if run.event is None else run.event for run in alone]
    np.testing.assert_allclose(many.event, expected, rtol=1e-12)
    assert np.isnan(many.event[2]) and np.all(np.isfinite(many.event[[0, 1, 3]]))
    assert not many.failures and "ended 3 of 4" in str(many)
    for index, run in enumerate(alone):
        np.testing.assert_allclose(many.final.mu[index], run.final.mu, atol=1e-12)
        kept = int(np.sum(np.isfinite(many.records.t[index])))
        assert kept == run.count - (run.event is not None)
        np.testing.assert_allclose(many.records.mu[index, :kept], run.records.mu[:kept], atol=1e-12)
        np.testing.assert_allclose(many.relative_changes("energy")[index], run.relative_change("energy"), atol=1e-13)


def test_every_member_of_an_ensemble_has_its_own_events(fleet):
    many, alone = fleet
    for index, run in enumerate(alone):
        np.testing.assert_allclose(many.events["second"][index].t, run.events["second"].t, rtol=1e-12)
    assert sum(len(rows.t) for rows in many.events["second"]) > 0


@pytest.mark.parametrize(
    ("given", "error", "sentence"),
    [
        ({"events": first_momentum}, co.errors.ArgumentError, "`events` must be a dictionary of names and functions"),
        ({"events": {"section": 3.0}}, co.errors.LagrangianError, "must be a function of the state"),
        ({"events": {"section": lambda s: s.mu}}, co.errors.LagrangianError, "`section` must return one number"),
        ({"events": {"s": first_momentum}, "store": "folder"}, co.errors.ArgumentError, "leave out `store`"),
        (
            {"until": first_momentum, "method": co.methods.VariableStep(co.Midpoint())},
            co.errors.ArgumentError,
            "parts of a step",
        ),
    ],
)
def test_what_is_no_event_is_refused(given, error, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=sentence):
        simulate(**given)


def test_a_direction_is_one_of_three():
    with pytest.raises(co.errors.ArgumentError, match='"rising", "falling" or "both", but is \'up\''):
        co.Event(first_momentum, "up")


def test_a_run_with_events_is_saved_with_their_counts(watched, tmp_path):
    found = co.load(watched.save(tmp_path / "run.nc"))
    assert {name: found.dataset.attrs[f"events_{name}"] for name in watched.events} == {
        name: len(states.t) for name, states in watched.events.items()
    }


def test_a_wrong_event_is_told_by_its_name():
    with pytest.raises(
        co.errors.LagrangianError, match="The event `section` must be a function of the state, but is 3"
    ):
        simulate(events={"section": 3})
    with pytest.raises(co.errors.ArgumentError, match="The name `until` in `events`"):
        simulate(events={"until": first_momentum})
