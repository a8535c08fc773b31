"""Bodies that are pushed, damped and carried along, against closed forms."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.models import catalogue
from coadjoint.models.general_form import general_vehicle, kinetic, potential

MASS, ADDED = 123.8, np.array([65.0, 70.0, 75.0])
METHODS = {
    "left": co.LeftRectangle(),
    "right": co.RightRectangle(),
    "midpoint": co.Midpoint(),
    "trapezoidal": co.Trapezoidal(),
    "pair": co.methods.LeftRight(),
    "suzuki": co.Suzuki4(co.Midpoint(), negative_substeps="allow"),
}


def paper_vehicle(forces, **parameters) -> co.System:
    """The paper's vehicle with forces and the parameters that they need."""
    plain = catalogue["underwater_vehicle"].make(mass=MASS)
    return co.System(
        plain.group, plain.lagrangian, additional=plain.additional, advected=plain.advected, forces=forces,
        parameters=co.Parameters(**plain.parameters.asdict(), **parameters), units=dict(plain.units),
    )  # fmt: skip


def still(vehicle: co.System, **given) -> co.State:
    return vehicle.state(**{"q": [0, 0, 1], "a0": [0, 0, 1], **given})


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_a_heavy_vehicle_sinks_at_the_speed_at_which_quadratic_drag_carries_it(method):
    """M v̇ = W − c v²: v = v∞ tanh(t/t∞), v∞ = √(W/c), t∞ = M/√(Wc); at v∞ every rule is exact."""
    weight, c, M = 130 * 9.81 - 1215.8, 60.0, 130 + ADDED[2]
    vehicle = paper_vehicle(
        {"drag": lambda motion, p: co.Force(force=co.mechanics.quadratic_drag(p.drag, motion.nu))}, drag=c
    )
    vehicle = vehicle.replace(mass=130.0)
    terminal, time = np.sqrt(weight / c), M / np.sqrt(weight * c)
    run = co.simulate(vehicle, still(vehicle), dt=0.05, steps=int(25 * time / 0.05), method=method, monitors=False)
    np.testing.assert_allclose(run.final.qdot, [0, 0, terminal], atol=1e-10)
    # Momenta, unlike the discrete velocities, belong to the nodes.
    speed = run.records.pi[:, 2] / M
    expected = terminal * np.tanh(run.dataset.time.values / time)
    at_most = {1: 3e-2, 2: 1e-4, 4: 1e-8}[method.order]
    np.testing.assert_allclose(speed, expected, atol=at_most * terminal)


def test_thrust_against_linear_drag_gives_the_terminal_speed_forward():
    """v = T/d (1 − exp(−d t/M)) along the body's own axis, heading 30° to the side."""
    forces = {
        "drag": co.mechanics.rayleigh(lambda motion, p: 0.5 * p.drag * motion.nu @ motion.nu),
        "thrust": lambda motion, p: co.Force(force=jnp.array([1.0, 0, 0]) * p.thrust),
    }
    vehicle = paper_vehicle(forces, drag=40.0, thrust=30.0).replace(mass=1215.8 / 9.81)
    heading = co.attitude.zyx(np.radians(30), 0, 0)
    run = co.simulate(vehicle, still(vehicle, g=heading), dt=0.05, duration=100)
    M = 1215.8 / 9.81 + ADDED[0]
    expected = 30 / 40 * (1 - np.exp(-40 * run.dataset.time.values / M))
    np.testing.assert_allclose(run.records.pi[:, 0] / M, expected, atol=4e-6)
    forward = 0.75 * np.array([np.cos(np.radians(30)), np.sin(np.radians(30)), 0])
    np.testing.assert_allclose(run.final.qdot, forward, atol=1e-8)
    # At the end thrust puts in what drag takes: T v = d v².
    lost, gained = (np.diff(run.monitors[f"work_{name}"][-2:])[0] / 0.05 for name in ("drag", "thrust"))
    assert gained == pytest.approx(30 * 0.75, rel=1e-8)
    assert lost == pytest.approx(-gained, rel=1e-8)


@pytest.mark.cases(1)
@pytest.mark.parametrize("axis", range(3))
def test_a_damped_spin_decays_by_the_factor_of_the_rule_at_every_step(axis):
    """J ω̇ = −d ω: midpoint (1 − ½λh)/(1 + ½λh) a step, which is exp(−λh) to second order."""
    vehicle = paper_vehicle(lambda motion, p: co.Force(torque=-p.damping * motion.xi), damping=5.0)
    vehicle = vehicle.replace(center_of_buoyancy=[0.0, 0.0, 0.0], mass=1215.8 / 9.81)
    spin = np.eye(3)[axis] * 0.3
    run = co.simulate(
        vehicle, still(vehicle, xi=spin), dt=0.02, duration=4, method=co.Midpoint(co.Exponential()), monitors=False
    )
    rate = 5.0 / vehicle.parameters.inertia[axis, axis]
    factor = (1 - 0.01 * rate) / (1 + 0.01 * rate)
    ratios = run.records.mu[1:, axis] / run.records.mu[:-1, axis]
    np.testing.assert_allclose(ratios, factor, rtol=1e-12)
    assert factor == pytest.approx(np.exp(-0.02 * rate), rel=1e-6)


@pytest.mark.cases(1)
@pytest.mark.parametrize("damping", [0.5, 2.0])
def test_small_pitch_swings_decay_at_the_rate_of_the_damped_oscillator(damping):
    """J₂ θ̈ + d θ̇ + B l θ = 0: θ = θ₀ exp(−γt)(cos ωt + (γ/ω) sin ωt), γ = d/2J₂, ω² = Bl/J₂ − γ²."""
    vehicle = paper_vehicle(lambda motion, p: co.Force(torque=-p.damping * motion.xi), damping=damping).replace(
        mass=1215.8 / 9.81
    )
    J, stiffness, first = 5.29, 1215.8 * 0.007, 1e-4
    gamma = damping / (2 * J)
    omega = np.sqrt(stiffness / J - gamma**2)
    run = co.simulate(vehicle, still(vehicle, g=co.attitude.zyx(0, first, 0)), dt=0.005, duration=10, monitors=False)
    t = run.dataset.time.values
    expected = first * np.exp(-gamma * t) * (np.cos(omega * t) + gamma / omega * np.sin(omega * t))
    np.testing.assert_allclose(run.dataset.euler_angles[:, 1], expected, atol=3e-4 * first)


OFFSET = {
    "mass": MASS,
    "inertia": [5.46, 5.29, 5.72],
    "added_mass": [65, 70, 75, 1.0, 2.0, 1.5],
    "buoyancy": 1200.0,
    "center_of_mass": [0.05, -0.02, 0.03],
    "center_of_buoyancy": [0.02, 0.01, -0.007],
}


def in_a_current(forces) -> co.System:
    """The general vehicle, its mass centre off the origin, in water that moves at u: b = R⁻¹u in all of the kinetic
    energy, and nowhere else."""
    plain = general_vehicle(**OFFSET)

    def lagrangian(xi, n, nu, a, p):
        return kinetic(xi, nu - a.current, p) - potential(n @ a.down, a.down, p)

    parameters = co.Parameters(**plain.parameters.asdict(), drag=[20.0, 60.0, 60.0], damping=5.0, thrust=25.0)
    spaces = {"down": co.Defining(), "current": co.Defining()}
    return co.System(
        co.SO3(), lagrangian, additional=co.Defining(), advected=spaces, parameters=parameters, forces=forces
    )


def drag(motion, p):
    relative = motion.nu - motion.a.current
    return co.Force(torque=-p.damping * motion.xi, force=-p.drag * jnp.abs(relative) * relative)


def thrust(motion, p):
    push = p.thrust * (1 + 0.5 * jnp.sin(motion.t))
    return co.Force(torque=jnp.array([0.0, 0.0, 0.02]) * push, force=jnp.array([1.0, 0.0, 0.0]) * push)


def begun(vehicle: co.System, current: np.ndarray) -> co.State:
    velocity = np.array([0.1, 0.1, 0.8]) + current
    return vehicle.state(
        q=[0, 0, 1], xi=np.radians([10, 0, 20]), qdot=velocity, a0={"down": [0, 0, 1], "current": current}
    )


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("forces", [None, {"drag": drag, "thrust": thrust}], ids=["free", "damped with thrust"])
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_who_drifts_with_the_water_sees_the_same_motion(method, forces):
    """R is that in still water and q = q' + t u, on the grid to round-off, with weight and buoyancy."""
    vehicle, u, steps = in_a_current(forces), np.array([0.3, -0.1, 0.05]), 400
    carried, calm = (
        co.simulate(vehicle, begun(vehicle, current), dt=0.05, steps=steps, method=method, monitors=False)
        for current in (u, 0 * u)
    )
    np.testing.assert_allclose(carried.records.g, calm.records.g, atol=2e-15 * steps)
    drift = carried.dataset.q.values - carried.dataset.time.values[:, None] * u
    np.testing.assert_allclose(drift, calm.dataset.q.values, atol=2e-14 * steps)


def gap(run) -> float:
    (low, high), first = run.extrema["energy_budget"], run.ends["energy_budget"][0]
    return float(max(high - first, first - low))


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["left", "midpoint", "trapezoidal", "pair", "suzuki"])
def test_a_damped_vehicle_with_thrust_in_a_current_keeps_its_balances(name):
    """Theorem 7 with forces at round-off, at every step and over the run; the energy budget to the method's order."""
    method = METHODS[name]
    vehicle = in_a_current({"drag": drag, "thrust": thrust})
    start = begun(vehicle, np.array([0.3, -0.1, 0.0]))
    about = [co.mechanics.KelvinNoether(axis) for axis in np.eye(3)]
    runs = [
        co.simulate(vehicle, start, dt=dt, duration=20, method=method, kelvin_noether=about) for dt in (0.05, 0.025)
    ]
    for run in runs:
        assert run.largest("balance") < 3e-15
        assert run.relative_change("kelvin_noether") > 0.1
        assert run.summary()["kelvin_noether_budget_error_max"] < 2e-13
        assert run.ends["work_drag"][1] < -100 and run.ends["work_thrust"][1] > 50
    assert np.log2(gap(runs[0]) / gap(runs[1])) == pytest.approx(method.order, abs=0.2)


def test_a_body_that_loses_mass_keeps_its_momentum_and_gains_the_energy_of_time():
    """ℓ = ½ m(t) q̇²: p = m q̇ exactly; Ė = −∂_tℓ = −½ ṁ q̇², so that E = p²/2m."""

    def lagrangian(xi, x, v, *, t):
        return 0.5 * xi @ xi + 0.5 * (2 - t) * v @ v

    body = co.System(co.SO2(), lagrangian, additional=co.Trivial(1))
    start = body.state(q=[0], qdot=[1.0])
    method = co.Suzuki4(co.Midpoint())
    run = co.simulate(body, start, dt=0.02, steps=50, method=method)
    assert run.final.pi[0] == pytest.approx(2, abs=1e-14)
    assert run.final.q[0] == pytest.approx(2 * np.log(2), abs=1e-9)
    assert run.ends["work_time"][1] == pytest.approx(1.0, abs=1e-8)
