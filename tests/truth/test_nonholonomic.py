"""Nonholonomic systems in closed form: Suslov's body, Chaplygin's sleigh, a knife edge on a slope, a rolling ball."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import reactions

CROSS = np.eye(3)


class Motion(NamedTuple):
    """A system, its start, and the exact values of what `read` reads of a state at time t."""

    system: co.System
    start: co.State
    read: Callable[[co.State], np.ndarray]
    exact: Callable[[float], np.ndarray]


def suslov(begin: float = -2.0) -> Motion:
    """ξ₃ = 0: J₁₁ẋ = −J₁₃xy, J₂₂ẏ = J₁₃x²; (x, y) = (A sech kt, B tanh kt), J₂₂B² = J₁₁A², kJ₁₁ = J₁₃B."""
    J = np.array([[2.0, 0, 0.6], [0, 1.2, 0], [0.6, 0, 1.0]])
    B = np.sqrt(J[0, 0] / J[1, 1])
    k = J[0, 2] * B / J[0, 0]

    def exact(t):
        return np.array([1 / np.cosh(k * (begin + t)), B * np.tanh(k * (begin + t)), 0])

    axis = {"axis": co.Nonholonomic(lambda p: [[0, 0, 1]])}
    system = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ p.J @ xi, parameters={"J": J}, constraints=axis)
    return Motion(system, system.state(xi=exact(0)), lambda state: state.xi, exact)


def sleigh(begin: float = -1.0) -> Motion:
    """mu̇ = maω², (I + ma²)ω̇ = −mauω; (ω, u) = (W sech kt, U tanh kt), mU² = (I + ma²)W², k(I + ma²) = maU."""
    mass, inertia, lever, W = 1.0, 0.5, 0.3, 1.2
    about = inertia + mass * lever**2
    U = W * np.sqrt(about / mass)
    k = mass * lever * U / about

    def kinetic(xi):
        return 0.5 * about * xi[0] ** 2 + 0.5 * mass * xi[1:] @ xi[1:] + mass * lever * xi[0] * xi[2]

    def exact(t):
        return np.array([W / np.cosh(k * (begin + t)), U * np.tanh(k * (begin + t)), 0])

    system = co.System(co.SE2(), kinetic, constraints={"blade": co.Nonholonomic(lambda: [[0, 0, 1]])})
    return Motion(system, system.state(xi=exact(0)), lambda state: state.xi, exact)


def edge() -> Motion:
    """A knife edge on a slope that turns at 1 rad/s, from rest: x = sin²t/2, y = (t − sin t cos t)/2, a cycloid."""
    system = co.System(
        co.SO2(),
        lambda xi, n, nu, a: 0.5 * xi @ xi + 0.5 * nu @ nu + n @ a,
        additional=co.Defining(),
        advected=co.Defining(),
        constraints={"edge": co.Nonholonomic(lambda n, a: [[0, 0, 1]])},
    )
    start = system.state(q=[0, 0], xi=[1.0], a0=[1, 0])
    return Motion(
        system, start, lambda state: state.q, lambda t: np.array([np.sin(t) ** 2, t - np.sin(t) * np.cos(t)]) / 2
    )


def ball(rate: float = 2.0, radius: float = 0.3) -> Motion:
    """A homogeneous ball that rolls on a table turning at Ω: q̈ = (2/7)Ω e_z × q̇, circles (Earnshaw)."""

    def rows(n, a, p):
        return jnp.concatenate([p.radius * jnp.stack([jnp.cross(a, e) for e in CROSS], axis=1), np.eye(3)], axis=1)

    rolling = co.Nonholonomic(rows, right=lambda n, a, p: p.rate * jnp.cross(a, n))
    system = co.System(
        co.SO3(),
        lambda xi, n, nu, a, p: 0.2 * p.radius**2 * xi @ xi + 0.5 * nu @ nu,
        additional=co.Defining(),
        advected=co.Defining(),
        parameters={"radius": radius, "rate": rate},
        constraints={"rolling": rolling},
    )
    start = system.project(system.state(q=[1, 0, radius], qdot=[0, 0.5, 0], a0=[0, 0, 1]))
    x, v, w = start.q, start.qdot, 2 / 7 * rate

    def exact(t):
        along, across = np.sin(w * t) / w, (1 - np.cos(w * t)) / w
        return x + np.array([along * v[0] - across * v[1], along * v[1] + across * v[0], 0])

    return Motion(system, start, lambda state: state.q, exact)


MOTIONS = {one.__name__: one for one in (suslov, sleigh, edge, ball)}
MIDPOINT, SUZUKI = co.Midpoint(), co.Suzuki4(co.Midpoint())
CHEAP = {("suslov", MIDPOINT)}
"""Pairs that are run by default; the next test runs the ball, and those of RATTLE other rules."""
PAIRS = [(name, method) for name in MOTIONS for method in (MIDPOINT, co.Trapezoidal(), co.methods.LeftRight(), SUZUKI)]


@pytest.mark.parametrize(
    ("name", "method"),
    [
        pytest.param(*pair, marks=() if pair in CHEAP else pytest.mark.long, id=f"{pair[0]}, {pair[1].title}")
        for pair in PAIRS
    ],
)
def test_closed_forms_are_met_with_the_order_of_the_method_and_rows_hold_to_round_off(name, method):
    system, start, read, exact = MOTIONS[name]()
    errors = []
    for dt in (0.05, 0.025):
        run = co.simulate(system, start, dt=dt, duration=2.0, method=method, accuracy=False)
        errors.append(np.abs(read(run.final) - exact(2.0)).max())
        assert run.extrema["constraint_rate"][1] < 1e-14
        assert run.extrema["balance"][1] < 1e-14
    assert np.log2(errors[0] / errors[1]) == pytest.approx(method.order, abs=0.1)


def test_a_ball_starts_with_the_velocity_of_the_table_and_takes_the_power_of_its_reaction():
    system, start, *_ = ball()
    one, at = system.constraints[0], reactions.site(start)
    table = 2.0 * np.cross([0, 0, 1], start.q)
    assert np.abs(start.qdot + np.cross(start.g @ start.xi, [0, 0, -0.3]) - table).max() < 1e-15
    assert evaluate(lambda: one.power(system, at, np.array([1.0, 2.0, 3.0]))) == pytest.approx([1, 2, 3] @ table)


@pytest.mark.long
def test_the_reaction_of_a_turning_table_closes_the_energy_budget():
    system, start, *_ = ball()
    gaps = [
        np.ptp(co.simulate(system, start, dt=dt, duration=1.0, accuracy=False).monitors["energy_budget"])
        for dt in (0.1, 0.05)
    ]
    assert gaps[0] / gaps[1] == pytest.approx(4, rel=0.1)


@pytest.mark.long
def test_reactions_without_a_right_side_do_no_work_and_enter_the_momentum_budget():
    held = suslov()
    run = co.simulate(held.system, held.start, dt=0.1, steps=20, accuracy=False)
    assert not {"work_axis", "energy_budget"} & set(run.monitors)
    budget = run.monitors["kelvin_noether_budget"]
    assert np.abs(budget - budget[0]).max() < 1e-14
    assert np.abs(run.monitors["kelvin_noether"][-1] - budget[0]).max() > 0.1


@pytest.mark.parametrize(("dt", "band"), [pytest.param(0.1, 1.5e-3, marks=pytest.mark.long), (0.5, 3e-2)])
def test_energy_of_suslovs_body_stays_in_its_band(dt, band):
    held = suslov()
    run = co.simulate(held.system, held.start, dt=dt, steps=100_000, save_every=100, accuracy=False)
    low, high = run.extrema["energy"]
    assert max(abs(low - 1), abs(high - 1)) < band


@pytest.mark.long
@pytest.mark.parametrize(("motion", "dt", "band"), [(suslov, 0.1, 1.5e-3), (suslov, 0.5, 3e-2), (edge, 0.1, 1e-2)])
def test_energy_stays_in_its_band_over_a_million_steps(motion, dt, band):
    held = motion()
    run = co.simulate(held.system, held.start, dt=dt, steps=1_000_000, save_every=1000, accuracy=False)
    low, high = run.extrema["energy"]
    assert max(abs(low - run.monitors["energy"][0]), abs(high - run.monitors["energy"][0])) < band


def test_integrable_rows_are_reported_and_run():
    def system(row):
        return co.System(
            co.SO2(),
            lambda xi, n, nu, a: 0.5 * xi @ xi + 0.5 * nu @ nu,
            additional=co.Defining(),
            advected=co.Defining(),
            constraints={"slot": co.Nonholonomic(row)},
        )

    straight = system(lambda n, a: [[0, -a[1], a[0]]])  # across a fixed direction: the derivative of −n₁a₂ + n₂a₁
    begun = {"q": [0, 0], "xi": [1.0], "a0": [1, 0]}
    assert any("integrable (Frobenius)" in said for said in straight.check(straight.state(**begun)))
    blade = system(lambda n, a: [[0, 0, 1]])
    assert blade.check(blade.state(**begun)) == []
