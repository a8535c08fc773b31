"""Mechanics on Q alone, with the group {e}: oscillator and pendulum against their closed forms."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import ellipk

import coadjoint as co

OMEGA = 1.5
H, STEPS = 0.05, 40
OSCILLATOR = co.System(
    co.Translation(0),
    lambda xi, n, nu, p: 0.5 * p.mass * (nu @ nu - p.omega**2 * n @ n),
    additional=co.Trivial(1),
    parameters=co.Parameters(mass=2.0, omega=OMEGA),
    name="oscillator",
)
PENDULUM = co.System(
    co.Translation(0),
    lambda xi, n, nu, p: 0.5 * nu @ nu + p.omega**2 * jnp.cos(n[0]),
    additional=co.Trivial(1),
    parameters=co.Parameters(omega=OMEGA),
    name="pendulum",
)


@pytest.mark.cases(1)
@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_the_midpoint_rule_turns_an_oscillator_by_the_angle_of_cayleys_map(backend):
    """n_k = cos kθ with tan(θ/2) = ωh/2: the rule on an oscillator is Cayley's map of its phase plane."""
    run = co.simulate(OSCILLATOR, OSCILLATOR.state(q=[1.0]), dt=H, steps=STEPS, backend=backend)
    turn = 2 * np.arctan(0.5 * OMEGA * H)
    np.testing.assert_allclose(run.records.n[:, 0], np.cos(turn * np.arange(STEPS + 1)), atol=1e-13)
    assert run.relative_change("energy") < 1e-14


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "method",
    [
        co.methods.LeftRight(),
        co.Trapezoidal(),
        co.Simpson(),
        co.EnergyMomentum(),
        co.Galerkin(degree=2),
        co.Suzuki4(co.Midpoint()),
        co.methods.VariableStep(co.Simpson()),
    ],
    ids=lambda method: method.title,
)
def test_every_method_moves_an_oscillator_within_its_order(method):
    start = OSCILLATOR.state(q=[1.0], qdot=[0.3])
    run = co.simulate(OSCILLATOR, start, dt=H, steps=STEPS, method=method, monitors=False, accuracy=False)
    t = run.final.t
    exact = np.cos(OMEGA * t) + 0.3 / OMEGA * np.sin(OMEGA * t)
    assert abs(run.final.n[0] - exact) < (OMEGA * H) ** method.order * t


@pytest.mark.long
def test_variable_steps_are_the_same_by_xla():
    start, options = OSCILLATOR.state(q=[1.0], qdot=[0.3]), {"dt": H, "steps": 4, "monitors": False, "accuracy": False}
    runs = [
        co.simulate(OSCILLATOR, start, method=co.methods.VariableStep(co.Simpson()), backend=b, **options)
        for b in ("native", "xla")
    ]
    np.testing.assert_allclose(runs[1].final.n, runs[0].final.n, atol=1e-9)


def test_a_pendulum_reaches_the_bottom_after_a_quarter_of_its_period():
    """K(sin²(θ₀/2))/ω, alone and beside others."""
    angles = np.array([0.5, 2.0, 3.0])
    start = PENDULUM.state(q=co.each(angles[:, None]), qdot=[0.0])
    options = {"dt": 0.01, "steps": 300, "method": co.Suzuki4(co.Midpoint()), "accuracy": False}
    run = co.simulate(PENDULUM, start, events={"bottom": lambda s: s.n[0]}, **options, monitors=False)
    quarter = ellipk(np.sin(angles / 2) ** 2) / OMEGA
    np.testing.assert_allclose([states.t[0] for states in run.events["bottom"]], quarter, rtol=1e-8)
    alone = co.simulate(PENDULUM, PENDULUM.state(q=[2.0]), until=lambda s: s.n[0], **options, monitors=False)
    assert alone.event == pytest.approx(quarter[1], rel=1e-9)


@pytest.mark.long
def test_a_run_on_q_alone_is_saved_streamed_stepped_and_told(tmp_path):
    start = PENDULUM.state(q=[1.0], pi=[0.3])
    run = co.simulate(PENDULUM, start, dt=H, steps=STEPS)
    saved = co.load(run.save(tmp_path / "run.nc"))
    assert "pendulum" in str(saved) and co.mechanics.casimirs(PENDULUM) == {}
    with pytest.raises(co.errors.ArgumentError, match="`events` is not in the file"):
        _ = saved.events
    streamed = co.simulate(PENDULUM, start, dt=H, steps=STEPS, store=tmp_path / "run")
    np.testing.assert_array_equal(streamed.dataset.q, run.dataset.q)
    stepper = co.Stepper(PENDULUM, start, dt=H)
    for _ in range(STEPS):
        stepper.step()
    assert np.array_equal(stepper.state.n, run.final.n)
