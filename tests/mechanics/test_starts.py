"""Starts given by momenta, and what momenta a run starts from; Hamiltonians that have no Lagrangian."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.mechanics import phase_space, restart_checks
from coadjoint.mechanics.restart_checks import continued
from coadjoint.simulation.arguments import damping_rate

GAMMA = np.array([1.0, 2.0])
RIGID = co.System(
    co.SO3(), lambda xi, p: 0.5 * xi @ p.inertia @ xi, parameters=co.Parameters(inertia=np.diag([1.0, 2.0, 3.0]))
)


def test_a_start_by_momenta_is_the_start_by_their_velocities():
    by_velocity = RIGID.state(xi=[0.3, -0.2, 0.5])
    by_momentum = RIGID.state(mu=by_velocity.mu)
    np.testing.assert_allclose(by_momentum.xi, by_velocity.xi, rtol=1e-14)
    ends = [co.simulate(RIGID, s, dt=0.1, steps=50, progress=False).final for s in (by_velocity, by_momentum)]
    np.testing.assert_allclose(ends[0].mu, ends[1].mu, rtol=1e-13)


def test_a_start_by_momenta_of_a_lagrangian_that_is_not_quadratic_finds_its_velocities():
    """ℓ = −√(1 − |ξ|²): μ = ξ/√(1 − |ξ|²), and ξ = μ/√(1 + |μ|²)."""
    system = co.System(co.SO3(), lambda xi: -jnp.sqrt(1.0 - xi @ xi))
    mu = np.array([0.6, 0.3, -0.2])
    np.testing.assert_allclose(system.state(mu=mu).xi, mu / np.sqrt(1 + mu @ mu), rtol=1e-12)


def test_momenta_of_additional_dynamics_and_of_all_members_are_given_likewise():
    vehicle = co.System(
        co.SO3(),
        lambda xi, n, nu, p: 0.5 * xi @ xi + 0.5 * p.mass * nu @ nu,
        additional=co.Defining(),
        parameters=co.Parameters(mass=4.0),
    )
    turned = co.attitude.zyx(0.3, 0.2, 0.1)
    start = vehicle.state(g=turned, q=[0, 0, 1], mu=[0.1, 0, 0.2], pi=[1.0, 2.0, 3.0])
    np.testing.assert_allclose(start.nu, [0.25, 0.5, 0.75], rtol=1e-14)
    np.testing.assert_allclose(start.qdot, turned @ [0.25, 0.5, 0.75], rtol=1e-14)
    many = RIGID.state(mu=co.each([[1.0, 0, 0], [0, 2.0, 0]]))
    np.testing.assert_allclose(many.xi, [[1.0, 0, 0], [0, 1.0, 0]], rtol=1e-14)
    fleet = co.simulate(RIGID, many, dt=0.1, steps=5, progress=False, monitors=False)
    np.testing.assert_allclose(fleet.final.mu, many.mu, atol=1e-14)


def test_velocities_that_belong_to_two_momenta_are_refused():
    """ℋ = ¼μ₁⁴ − ½μ₁² + ½μ₂² + ½μ₃²: ξ₁ = μ₁³ − μ₁ has three momenta near zero, and one at ξ₁ = 6, μ₁ = 2."""

    def double_well(mu):
        return 0.25 * mu[0] ** 4 - 0.5 * mu[0] ** 2 + 0.5 * mu[1:] @ mu[1:]

    system = co.System(co.SO3(), hamiltonian=double_well)
    with pytest.raises(co.errors.ArgumentError, match=r"belong to one momentum, but belong to .* system.state\(mu=…\)"):
        system.state(xi=[0.1, 0.0, 0.0])
    assert system.state(xi=[6.0, 0.0, 0.0]).mu[0] == pytest.approx(2.0, rel=1e-12)
    np.testing.assert_allclose(system.state(mu=[0.9, 0.0, 0.0]).xi, [0.9**3 - 0.9, 0, 0], rtol=1e-14)


def test_a_run_starts_from_the_momentum_that_its_start_shows():
    """ℋ = ½|μ − u|² with an input u: with u = 0 the momentum is ξ, and stays so when u is 2.4 from the first step."""

    def hamiltonian(mu, *, inputs):
        return 0.5 * (mu - inputs.u) @ (mu - inputs.u)

    system = co.System(co.SO3(), hamiltonian=hamiltonian)
    start = system.state(xi=[0.3, 0.0, 0.1], inputs={"u": np.zeros(3)})
    run = co.simulate(
        system,
        start,
        dt=0.1,
        steps=5,
        inputs={"u": lambda motion: jnp.array([0, 2.4, 0]) + 0 * motion.t},
        progress=False,
        monitors=False,
    )
    np.testing.assert_array_equal(run.records.mu[0], start.mu)
    given = system.state(mu=[1.0, 0.2, 0.0], inputs={"u": np.zeros(3)})
    again = co.simulate(
        system, given, dt=0.1, steps=5, inputs={"u": lambda motion: 2.4 * jnp.ones(3)}, progress=False, monitors=False
    )
    np.testing.assert_array_equal(again.records.mu[0], [1.0, 0.2, 0.0])


def test_members_start_from_the_momenta_that_their_own_starts_show():
    """ℓ = ½|ξ|² + u·ξ with an input u: μ = ξ + u at the start, whatever u is from the first step."""
    system = co.System(co.SO3(), lambda xi, *, inputs: 0.5 * xi @ xi + inputs.u @ xi)
    xi, u = np.array([[0.3, 0.0, 0.1], [0.0, 0.5, 0.2]]), np.array([0.0, 0.0, 1.0])
    start = system.state(xi=co.each(xi), inputs={"u": u})
    later = {"u": lambda motion: jnp.array([0, 2.4, 0]) + 0 * motion.t}
    fleet = co.simulate(system, start, dt=0.1, steps=5, inputs=later, progress=False, monitors=False)
    np.testing.assert_allclose(fleet.records.mu[:, 0], xi + u, atol=1e-15)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"mu": [1, 0, 0.0], "xi": [1, 0, 0.0]}, "by velocities `xi` and `qdot` or by momenta"),
        ({"mu": [1.0, 0.0]}, r"Argument `mu` must have shape \(3,\)"),
        ({"pi": [1.0]}, "no additional dynamics: leave out `pi`"),
    ],
)
def test_a_start_that_is_given_twice_or_in_another_shape_is_refused(given, sentence):
    with pytest.raises(co.errors.ArgumentError, match=sentence):
        RIGID.state(**given)


def test_no_momenta_of_no_additional_dynamics_may_be_given():
    assert RIGID.state(mu=[1, 0, 0.0], pi=[]).pi.shape == (0,)


def on_sphere(mu, p):
    x, y = mu[:3] / p.gamma[0], mu[3:] / p.gamma[1]
    return -p.gamma[0] * p.gamma[1] / (4 * jnp.pi) * jnp.log(2 - 2 * x @ y)


def on_plane(mu, p):
    apart = mu[:2] / p.gamma[0] - mu[3:5] / p.gamma[1]
    return -p.gamma[0] * p.gamma[1] / (4 * jnp.pi) * jnp.log(apart @ apart)


def turned(angle, x):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ x


def sphere():
    """Both vortices turn about M = Γ₁x₁ + Γ₂x₂ with −M/(2π|x₁ − x₂|²)."""
    x, y = np.array([0, 0.6, 0.8]), np.array([0.8, 0, -0.6])
    whole = GAMMA[0] * x + GAMMA[1] * y
    rate, axis = -np.linalg.norm(whole) / (2 * np.pi * (2 - 2 * x @ y)), whole / np.linalg.norm(whole)

    def exact(t):
        c, s = np.cos(rate * t), np.sin(rate * t)
        ends = [c * v + s * np.cross(axis, v) + (1 - c) * (axis @ v) * axis for v in (x, y)]
        return np.concatenate([gamma * end for gamma, end in zip(GAMMA, ends, strict=True)])

    return co.DirectProduct(co.SO3(), co.SO3()), on_sphere, exact


def plane():
    """(x_i, y_i) = μ_i/Γ_i with the central momentum Γ_i of a Heisenberg group: they turn about the centre of vorticity

    at (Γ₁ + Γ₂)/(2πd²), clockwise by the sign of this bracket.
    """
    x, y = np.array([1.0, 0.0]), np.array([-0.3, 0.4])
    centre, rate = (GAMMA[0] * x + GAMMA[1] * y) / 3.0, -3.0 / (2 * np.pi * (x - y) @ (x - y))

    def exact(t):
        ends = [centre + turned(rate * t, v - centre) for v in (x, y)]
        return np.concatenate([[*(gamma * end), gamma] for gamma, end in zip(GAMMA, ends, strict=True)])

    return co.DirectProduct(co.groups.Heisenberg(1), co.groups.Heisenberg(1)), on_plane, exact


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("make", [plane, sphere])
def test_point_vortices_turn_as_their_closed_forms_say(make):
    group, hamiltonian, exact = make()
    system = co.System(group, hamiltonian=hamiltonian, parameters=co.Parameters(gamma=GAMMA))
    start, errors = system.state(mu=exact(0.0)), []
    for steps in (100, 200):
        method = co.HamiltonianMidpoint()
        run = co.simulate(system, start, dt=20.0 / steps, steps=steps, method=method, progress=False)
        errors.append(np.max(np.abs(run.final.mu - exact(20.0))))
        assert run.relative_change("energy") < 1e-13 and run.relative_change("kelvin_noether") < 1e-13
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)
    fourth = co.Suzuki4(co.HamiltonianMidpoint())
    run = co.simulate(system, start, dt=0.1, steps=200, method=fourth, progress=False)
    assert np.max(np.abs(run.final.mu - exact(20.0))) < 2e-6


def test_without_a_legendre_transform_other_methods_name_the_one_that_runs():
    group, hamiltonian, exact = plane()
    system = co.System(group, hamiltonian=hamiltonian, parameters=co.Parameters(gamma=GAMMA))
    with pytest.raises(co.errors.LagrangianError, match="HamiltonianMidpoint"):
        co.simulate(system, system.state(mu=exact(0.0)), dt=0.1, steps=5)


@pytest.mark.long
def test_where_the_hamiltonian_is_regular_its_steps_are_those_of_the_midpoint_rule():
    """A heavy body with additional dynamics and a torque."""

    def hamiltonian(mu, n, pi, a, p):
        return 0.5 * mu @ (mu / p.inertia) + 0.5 * pi @ pi / p.mass + a @ n + 0.1 * (pi @ mu) + 0.2 * n @ n

    system = co.System(
        co.SO3(),
        hamiltonian=hamiltonian,
        additional=co.Defining(),
        advected=co.Defining(),
        parameters=co.Parameters(inertia=[1.0, 2.0, 3.0], mass=2.0),
        forces=lambda motion, p: co.Force(torque=-0.1 * motion.xi, force=-0.2 * motion.nu),
    )
    start = system.state(q=[0.1, 0.2, 0.3], mu=[0.3, 1.0, 0.2], pi=[0.5, 0.1, -0.4], a0=[0, 0, 1])
    ends = [
        co.simulate(system, start, dt=0.05, steps=100, method=method, progress=False)
        for method in (co.Midpoint(), co.HamiltonianMidpoint())
    ]
    for name in ("mu", "pi", "n", "a", "g"):
        np.testing.assert_allclose(getattr(ends[1].final, name), getattr(ends[0].final, name), atol=1e-12)
    np.testing.assert_allclose(ends[1].monitors["energy_budget"], ends[0].monitors["energy_budget"], atol=1e-12)


def sphere_of(mass):
    """A ball in free flight, ℓ = ½|ω|² + ½m|v|²."""
    return co.System(
        co.SO3(),
        lambda xi, n, nu, p: 0.5 * xi @ xi + 0.5 * p.mass * nu @ nu,
        additional=co.Defining(),
        parameters=co.Parameters(mass=mass),
    )


@pytest.fixture(scope="module")
def flight():
    ball = sphere_of(2.0)
    return co.simulate(ball, ball.state(q=[0, 0, 0], qdot=[1.5, 0, 0]), dt=0.1, steps=10, progress=False)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("keep", "speed"), [("momentum", 3.0), ("velocity", 1.5)])
def test_what_stays_when_a_payload_is_dropped_is_said_and_stands_on_the_card(flight, keep, speed):
    between = jax.tree.map(lambda leaf: leaf[0], flight.at([0.55]))
    for start in (flight.final, between):
        run = co.simulate(sphere_of(1.0), start, dt=0.1, steps=10, keep=keep, progress=False)
        np.testing.assert_allclose(run.records.nu[:, 0], speed, rtol=1e-13)
        np.testing.assert_allclose(run.records.pi[:, 0], speed, rtol=1e-13)
        assert f"continues with the {keep} of a record; `mass` changed" in str(run)


def test_a_run_that_goes_on_with_other_parameters_refuses_to_guess(flight):
    with pytest.raises(co.errors.ArgumentError, match="`mass` changed: say what stays, keep="):
        co.simulate(sphere_of(1.0), flight.final, dt=0.1, steps=10)
    with pytest.raises(co.errors.ArgumentError, match="`mass` changed"):
        co.trajectory(sphere_of(1.0), flight.final, dt=0.1, steps=10)
    with pytest.raises(co.errors.ArgumentError, match='must be "momentum" or "velocity", but is \'speed\''):
        co.simulate(sphere_of(1.0), flight.final, dt=0.1, steps=10, keep="speed")


def test_with_the_same_parameters_a_run_goes_on_as_ever(flight):
    again = co.simulate(sphere_of(2.0), flight.final, dt=0.1, steps=10, progress=False)
    whole = co.simulate(sphere_of(2.0), flight.start, dt=0.1, steps=20, progress=False)
    np.testing.assert_allclose(again.final.q, whole.final.q, rtol=1e-14)
    assert not again.warnings


def test_the_motion_that_does_not_enter_is_named_by_its_largest_component_in_any_units():
    """Along (1, 2, 3) of ω = (·)×, along (0, 1, ⅓, ⅔) of another, and none of a regular one."""
    cross = np.array([[0.0, -3, 2], [3, 0, -1], [-2, 1, 0]])
    regular = np.array([[0.0, 1e-6], [-1e-6, 0.0]])
    assert phase_space._singular(regular[None]) is None
    assert phase_space._singular(cross[None]) == pytest.approx([0.333, 0.667, 1], abs=0)
    units = np.array([1e-4, 1.0, 1.0])
    assert phase_space._singular((cross * units * units[:, None])[None]) == pytest.approx([1, 0, 0], abs=1e-3)
    both = np.stack([np.kron(np.eye(2), regular), np.zeros((4, 4))])
    assert phase_space._singular(both) is not None and phase_space._singular(both[:1]) is None


@pytest.mark.parametrize(
    ("forces", "rate"),
    [
        (lambda motion: co.Force(-6 * motion.xi, -2 * motion.nu), 3.0),
        (lambda motion: co.Force(-motion.xi, -4 * motion.nu), 1.0),
        (lambda motion: co.Force(6 * motion.xi, 2 * motion.nu), 0.0),
        (lambda motion: co.Force(-3 * motion.xi + 4 * motion.nu, -4 * motion.xi - 6 * motion.nu), 1.5),
    ],
    ids=["of the group", "of the place", "driven", "gyroscopic"],
)
def test_forces_damp_at_the_fastest_real_part_of_their_slope_by_the_mass(forces, rate):
    """M⁻¹ ∂F/∂v with M = diag(2, 4)."""
    system = co.System(
        co.SO2(), lambda xi, n, nu: xi @ xi + 2 * nu @ nu - n @ n, additional=co.Trivial(1), forces=forces
    )
    assert damping_rate(system, system.state(q=[0.3], xi=[0.2], qdot=[0.1])) == pytest.approx(rate, abs=1e-12)


def test_a_run_goes_on_with_the_momentum_or_the_velocity_of_a_record_of_other_parameters(monkeypatch):
    before, after = (SimpleNamespace(parameters=co.Parameters(mass=m, drag=1.0)) for m in (2.0, 3.0))
    start: Any = SimpleNamespace(origin=SimpleNamespace(system=before), from_velocities=False)
    plain: Any = SimpleNamespace(replace=lambda **changes: changes)
    monkeypatch.setattr(restart_checks, "going_on", lambda start: plain)
    monkeypatch.setattr(restart_checks, "_velocities", lambda system, state: ("xi", "nu") if system is before else None)
    said = "The run continues with the {} of a record; `mass` changed."
    assert continued(cast(Any, after), start, "momentum") == (plain, said.format("momentum"))
    moved = {"xi": "xi", "nu": "nu", "from_velocities": True}
    assert continued(cast(Any, after), start, "velocity") == (moved, said.format("velocity"))
    assert continued(cast(Any, before), start, None) == continued(cast(Any, before), start, "velocity") == (plain, None)
    with pytest.raises(co.errors.ArgumentError, match="other parameters, `mass` changed: say what stays"):
        continued(cast(Any, after), start, None)
    start.origin.system = None
    assert continued(cast(Any, after), start, "momentum") == continued(cast(Any, after), start, None) == (plain, None)
    with pytest.raises(co.errors.ArgumentError, match="of this start only the momentum is known"):
        continued(cast(Any, after), start, "velocity")
    start.from_velocities = True
    assert continued(cast(Any, after), start, "velocity") == (plain, None)
