"""An event ends a stepper where it ends a run, in its direction, once, however the stepper is copied."""

from __future__ import annotations

import copy

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, LagrangianError, StepError
from coadjoint.models import rigid_body
from pinned import PIN, pinned
from pinned import start as start_pinned

BODY = rigid_body.make(inertia=(1.0, 1.0, 2.0))
START = rigid_body.start(BODY, angular_velocity=(0.5, 0.0, 1.5))
"""μ₁ = ½ cos(ω₃t): a symmetric body with J₃ = 2J₁ turns its momentum about its axis at ω₃ = 1.5 rad/s."""
H, QUARTER = 0.05, 0.5 * np.pi / 1.5


def first_momentum(state):
    return state.mu[0]


def stepper(until, **options) -> co.Stepper:
    return co.Stepper(BODY, START, dt=H, until=until, observe={"mu": lambda s: s.mu, "t": lambda s: s.t}, **options)


def run(until, start=START):
    return co.simulate(BODY, start, dt=H, steps=200, monitors=False, until=until, progress=False)


def to_its_event(body: co.Stepper) -> float:
    while not body.ended:
        body.step(n=7)
    assert body.event is not None
    return body.event


@pytest.fixture(scope="module")
def falling() -> co.Stepper:
    return stepper(first_momentum)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("direction", "quarter", "backend"),
    [
        ("falling", 1, "native"),
        ("rising", 3, "native"),
        ("both", 1, "native"),
        pytest.param("rising", 3, "xla", marks=pytest.mark.long),
    ],
)
def test_an_event_of_a_direction_is_that_of_a_run(direction, quarter, backend):
    until = co.Event(first_momentum, direction)
    body = stepper(until, backend=backend)
    assert to_its_event(body) == pytest.approx(run(until).event, rel=1e-12)
    assert body.event == pytest.approx(quarter * QUARTER, abs=1e-2)
    assert abs(body.observation["mu"][0]) < 1e-13
    assert body.observation["t"] == body.t == body.event


def test_a_stepper_that_goes_on_from_an_event_meets_the_next_one_as_a_run_does(falling):
    body = falling.clone()
    body.reset()
    found = []
    for _ in range(4):
        found.append(to_its_event(body))
        here = body.state
        body.restore(here)
        assert not body.ended
        assert run(first_momentum, here).event == pytest.approx(found[-1] + 2 * QUARTER, abs=1e-2)
    np.testing.assert_allclose(np.diff(found), 2 * QUARTER, atol=1e-2)
    assert run(first_momentum, body.state).event == pytest.approx(to_its_event(body), rel=1e-12)


COPIES = {
    "clone": lambda body: body.clone(),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "restored": lambda body: restored(body),
}


def restored(body: co.Stepper) -> co.Stepper:
    other = body.clone()
    other.reset()
    other.restore(body)
    return other


@pytest.mark.parametrize("name", COPIES)
def test_a_copy_of_one_that_has_ended_stands_at_its_event_and_stays_there(falling, name):
    body = falling.clone()
    body.reset()
    when, mu = to_its_event(body), body.state.mu
    other = COPIES[name](body)
    assert type(other) is co.Stepper
    for one in (other, body):
        with pytest.raises(StepError, match="came at t ="):
            one.step()
        assert one.ended and one.event == when == one.t
        assert np.array_equal(one.state.mu, mu)
    other.reset()
    other.step()
    assert body.ended and not other.ended


def test_each_of_many_stops_at_the_node_before_its_event():
    start = BODY.state(xi=co.each([[0.5, 0.0, 1.5], [0.5, 0.0, 1.1], [0.5, 0.0, 0.0]]))
    many = co.Stepper(BODY, start, dt=H, until=co.Event(first_momentum, "falling"))
    many.step(n=40)
    assert list(many.ended) == [True, True, False]
    events = 0.5 * np.pi / np.array([1.5, 1.1])
    assert np.all(many.t[:2] <= events + 1e-3) and np.all(many.t[:2] > events - H - 1e-3)
    assert many.t[2] == pytest.approx(2.0)
    assert not many.failed.any()


@pytest.mark.parametrize(
    ("direction", "backend"),
    [("rising", "native"), pytest.param("both", "native", marks=pytest.mark.long), ("falling", "xla")],
)
def test_where_the_function_has_no_value_a_step_fails_with_a_sentence(backend, direction):
    body = stepper(co.Event(lambda s: 1.0 + jnp.sqrt(0.52 - s.t), direction), backend=backend)
    with pytest.raises(StepError, match=r"Step 10 .* gave numbers that are not finite.*`until`"):
        body.step(n=40)
    assert body.failed and not body.ended
    assert body.t == pytest.approx(0.5)


def test_what_is_no_event_is_refused():
    for until, error, sentence in [
        (3.0, LagrangianError, "must be a function of the state"),
        (lambda s: s.mu, LagrangianError, "must return one number"),
        (lambda s: jnp.log(s.t - 1.0), LagrangianError, "must be finite at the start"),
    ]:
        with pytest.raises(error, match=sentence):
            stepper(until)
    with pytest.raises(ArgumentError, match="Argument `direction`"):
        co.Event(first_momentum, "up")  # pyright: ignore[reportArgumentType]


@pytest.mark.long
def test_a_pinned_body_stops_where_the_function_of_its_event_vanishes():
    system = pinned()
    stepper = co.Stepper(system, start_pinned(system), dt=0.01, until=lambda state: state.q[0])
    stepper.step(n=200)
    reached = stepper.state
    assert stepper.ended and 0 < stepper.event < 2
    assert abs((reached.g @ reached.n)[0]) < 1e-12
    np.testing.assert_allclose(reached.n, -PIN, atol=1e-14)
