"""Runs with constraints: reactions as data, budgets, ensembles, files, steppers, events, gradients."""

from __future__ import annotations

from inspect import isfunction

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.mechanics import constrained_start, reactions
from coadjoint.methods import rattle
from pinned import INERTIA, MASS, PIN, RATES, body, hold, pinned, reference, start

QUIET = {"monitors": False, "accuracy": False}
EPS = np.finfo(float).eps


def run(system=None, dt=0.01, steps=40, **more):
    system = pinned() if system is None else system
    begun = more.pop("start", None)
    more = {"accuracy": False, **more}
    return co.simulate(system, start(system) if begun is None else begun, dt=dt, steps=steps, **more)


@pytest.fixture(scope="module")
def plain():
    return run()


def reaction(g, xi):
    """m(ẍ − g) in the body frame, of the top that turns at ξ about the pin."""
    about = INERTIA + MASS * (PIN @ PIN * np.eye(3) - np.outer(PIN, PIN))
    gravity = g.T @ [0, 0, -9.81]
    turning = np.linalg.solve(about, np.cross(about @ xi, xi) + np.cross(-PIN, MASS * gravity))
    return -MASS * (np.cross(turning, PIN) + np.cross(xi, np.cross(xi, PIN)) + gravity)


def test_reactions_at_nodes_are_those_of_the_nodes_own_place_and_momenta(plain):
    found = plain.dataset
    force = [reaction(g, xi) for g, xi in zip(plain.records.g, found.xi.values, strict=True)]
    assert np.abs(found.reaction_pin.values - force).max() < 1e-12


@pytest.mark.long
@pytest.mark.parametrize(("method", "order"), [(co.Midpoint(), 2), (co.Suzuki4(co.Midpoint()), 4)])
def test_reactions_at_nodes_have_the_order_of_the_method_and_those_of_steps_order_one(method, order):
    exact = reference(1.0).final
    force = reaction(exact.g, exact.xi)
    runs = [run(dt=dt, steps=round(1 / dt), method=method, save_every=round(1 / dt)).dataset for dt in (0.02, 0.01)]
    at_nodes = [np.abs(made.reaction_pin.values[-1] - force).max() for made in runs]
    of_steps = [np.abs(made.reaction_step_pin.values[-1] - force).max() for made in runs]
    assert np.log2(at_nodes[0] / at_nodes[1]) == pytest.approx(order, abs=0.1)
    assert np.log2(of_steps[0] / of_steps[1]) == pytest.approx(1, abs=0.1)


def test_reactions_are_described_in_the_dataset(plain):
    found = plain.dataset
    assert found.reaction_pin.dims == found.reaction_step_pin.dims == ("time", "pin_row")
    assert "φ̈ = 0" in found.reaction_pin.attrs["long_name"]
    assert "first order" in found.reaction_step_pin.attrs["long_name"]


@pytest.mark.long
def test_a_driven_constraint_has_a_line_in_the_energy_budget_which_closes():
    moving = co.Holonomic(lambda n, a, p, *, t: n + p.pin - 0.1 * jnp.sin(3 * t) * a)
    system = body(constraints={"lift": moving})
    begun = system.project(start(system))
    errors = []
    for dt in (0.02, 0.01):
        made = run(system, dt, round(1 / dt), start=begun)
        errors.append(np.ptp(made.monitors["energy_budget"]))
        assert made.extrema["constraint_gap"][1] < 1e-15
        assert made.extrema["balance"][1] < 1e-14
    assert abs(made.monitors["work_lift"][-1]) > 0.9
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)
    assert "lift" in made.certificate.long()


def test_a_constraint_that_reads_a_signal_moves_with_it():
    by_input = co.Holonomic(lambda n, a, p, *, inputs: n + p.pin - inputs.lift * a, size=3)
    system = body(constraints={"pin": by_input})
    end = run(system, 0.02, 10, inputs={"lift": co.mechanics.Signal(lambda t: 0.5 * t**2)}, **QUIET).final
    assert end.n + PIN == pytest.approx(0.5 * 0.2**2 * end.a, abs=1e-15)


def test_redundant_rows_share_the_least_reactions_and_are_reported(plain):
    system = body(constraints={"pin": co.Holonomic(hold), "again": co.Holonomic(lambda n, a, p: (n + p.pin)[:2])})
    made = run(system)
    assert np.abs(made.final.g - plain.final.g).max() < 1e-14
    assert made.dataset.reaction_again.values == pytest.approx(0.5 * plain.dataset.reaction_pin.values[:, :2], abs=1e-9)
    assert "5 rows, of which 2 follow from the others" in str(made)


@pytest.mark.long
def test_the_momentum_about_the_vertical_through_a_pin_is_found_and_kept():
    c = np.array([0.7, -0.4, 1.1])

    def lagrangian(xi, n, nu, a, p):
        return 0.5 * xi @ p.inertia @ xi + 0.5 * p.mass * nu @ nu - 9.81 * p.mass * n @ a.down

    system = co.System(
        co.SO3(),
        lagrangian,
        additional=co.Defining(),
        advected={"down": co.Defining(), "c": co.Defining()},
        parameters={"inertia": INERTIA, "mass": MASS, "pin": PIN},
        constraints={"pin": co.Holonomic(lambda n, a, p: n + p.pin - a.c)},
    )
    begun = start(system, q=c - PIN, a0={"down": [0, 0, 1], "c": c})
    made = run(system, dt=0.05, steps=10_000, start=begun, save_every=1000)
    about = made.plan.constants.monitors["symmetries"]
    assert about == pytest.approx(np.array([[0, 0, 1, c[1], -c[0], 0]]), abs=1e-12)
    g, q = made.records.g, made.dataset.q.values
    spin = np.einsum("tij,tj->ti", g, made.records.mu) + np.cross(q - c, np.einsum("tij,tj->ti", g, made.records.pi))
    kept = made.monitors["symmetry_momentum"][:, 0]
    assert kept == pytest.approx(spin[:, 2], abs=1e-12)
    assert np.ptp(kept) < 1e-12
    assert "symmetry" in str(made)


@pytest.mark.long
def test_members_of_an_ensemble_are_their_single_runs_to_round_off(plain):
    system = pinned().replace(mass=co.each([1.0, MASS]))
    made = run(system)
    assert np.abs(made.dataset.mu.values[1] - plain.dataset.mu.values).max() < 1e-14
    assert np.abs(made.dataset.reaction_pin.values[1] - plain.dataset.reaction_pin.values).max() < 1e-12


def test_a_member_off_a_constraint_raises():
    system = pinned()
    rates = co.each([RATES, 2 * RATES])
    off = start(system, xi=rates)
    with pytest.raises(co.errors.ArgumentError, match="velocities of the start must satisfy the constraint `pin`"):
        run(system, start=off, steps=1)


@pytest.mark.long
def test_members_are_projected_as_single_states_and_may_have_redundant_rows():
    system = pinned()
    off = start(system, xi=co.each([RATES, 2 * RATES]))
    assert np.array_equal(system.project(off).mu[0], system.project(start(system)).mu)
    doubled = body(constraints={"pin": co.Holonomic(hold), "again": co.Holonomic(hold)})
    made, single = (run(one, dt=0.01, steps=5) for one in (doubled.replace(mass=co.each([1.0, MASS])), doubled))
    assert "6 rows, of which 3 follow" in " ".join(made.warnings)
    # λ of a step moves a body by h²λ/m, of which round-off is a part.
    for name, most in {"mu": 1e-12, "reaction_pin": 1e-12, "reaction_step_again": 4 * MASS * EPS / 0.01**2}.items():
        assert np.abs(made.dataset[name].values[1] - single.dataset[name].values).max() < most


@pytest.mark.long
def test_stored_and_resumed_runs_keep_reactions(plain, tmp_path):
    stored = run(store=tmp_path / "run")
    for name in ("mu", "reaction_pin", "reaction_step_pin"):
        assert np.array_equal(stored.dataset[name], plain.dataset[name])
    assert np.array_equal(co.resume(tmp_path / "run", pinned()).final.mu, plain.final.mu)


@pytest.mark.long
def test_saved_runs_keep_reactions_and_continue_bitwise(plain, tmp_path):
    system = pinned()
    plain.save(tmp_path / "run.nc")
    loaded = co.load(tmp_path / "run.nc", system)
    assert np.array_equal(loaded.dataset.reaction_pin, plain.dataset.reaction_pin)
    on = [run(start=end, steps=3).final.mu for end in (loaded.final, plain.final)]
    assert np.array_equal(*on)


@pytest.mark.long
def test_a_stepper_takes_the_steps_of_a_run(plain):
    system = pinned()
    stepper = co.Stepper(system, start(system), dt=0.01)
    for _ in range(40):
        stepper.step()
    assert np.array_equal(stepper.state.mu, plain.position.state.mu)


@pytest.mark.long
def test_events_and_dense_output_are_on_the_constraints():
    made = run(until=lambda state: state.g[0, 1] + 0.1, monitors=False)
    assert made.final.g[0, 1] == pytest.approx(-0.1, abs=1e-13)
    assert np.abs(made.final.n + PIN).max() < 1e-15
    assert np.abs(made.at([0.013]).n + PIN).max() < 1e-15


@pytest.mark.long
@pytest.mark.parametrize("derivative", [jax.grad, jax.jacfwd])
def test_gradients_go_through_reactions(derivative):
    def end(mass):
        system = pinned().replace(mass=mass)
        return co.trajectory(system, start(system), dt=0.01, steps=5, accuracy=False).final.g[0, 1]

    with co.float64():
        slope = derivative(end)(2.0)
    assert slope == pytest.approx((end(2.0 + 1e-4) - end(2.0 - 1e-4)) / 2e-4, rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize(
    "method",
    [pytest.param(co.Midpoint(), marks=pytest.mark.long), co.HamiltonianMidpoint()],
    ids=lambda method: method.title,
)
def test_a_hamiltonian_has_the_steps_of_its_lagrangian(method, plain):
    def hamiltonian(mu, n, pi, a, p):
        return 0.5 * mu @ (mu / np.diag(INERTIA)) + 0.5 * pi @ pi / p.mass + 9.81 * p.mass * n @ a

    parameters = {"mass": MASS, "pin": PIN}
    spaces = {"additional": co.Defining(), "advected": co.Defining()}
    held = {"pin": co.Holonomic(hold)}
    system = co.System(co.SO3(), hamiltonian=hamiltonian, parameters=parameters, constraints=held, **spaces)
    made = run(system, method=method, monitors=False)
    assert np.abs(made.final.g - plain.final.g).max() < 1e-14
    assert np.abs(made.dataset.reaction_pin.values - plain.dataset.reaction_pin.values).max() < 1e-12


@pytest.mark.parametrize(
    "method",
    [
        co.Galerkin(),
        co.methods.VariableStep(co.Midpoint()),
        co.EnergyMomentum(),
        co.IsospectralMidpoint(),
        co.LeftRectangle(start="velocity"),
    ],
    ids=lambda method: method.title,
)
def test_methods_that_take_no_constraints_raise_one_clear_error(method):
    with pytest.raises(co.errors.ArgumentError, match=r"takes no constraints: use|leave out start="):
        run(method=method, steps=1)


@pytest.mark.long
def test_an_optimal_motion_of_a_pinned_body_is_a_run():
    pytest.importorskip("casadi")
    pin = {"pin": co.Holonomic(hold)}
    system = body(constraints=pin, forces=lambda motion, p: co.Force(torque=motion.inputs.torque))
    problem = co.control.Problem(
        system,
        start(system, xi=[0, 0, 0], qdot=[0, 0, 0]),
        dt=0.05,
        steps=10,
        inputs={"torque": co.control.Input((3,), lower=-20.0, upper=20.0)},
        cost=lambda motion, p: 0.5 * motion.inputs.torque @ motion.inputs.torque,
        end=co.control.End(g=co.attitude.zyx(0.3, 0, 0), xi=np.zeros(3)),
    )
    found = problem.solve().run
    assert np.abs(found.final.g - co.attitude.zyx(0.3, 0, 0)).max() < 1e-9
    assert found.extrema["constraint_gap"][1] < 1e-14


def test_a_stepper_of_redundant_constraints_keeps_the_rows_of_its_start():
    """Two blades at one place: the second follows from the first."""
    blade = co.Nonholonomic(lambda: [[0, 0, 1]])
    sleigh = co.System(
        co.SE2(), lambda xi: 0.5 * xi @ xi + 0.3 * xi[0] * xi[2], constraints={"one": blade, "two": blade}
    )
    with pytest.warns(UserWarning, match="1 follow from the others"):
        stepper = co.Stepper(sleigh, sleigh.state(xi=[1.2, -0.5, 0]), dt=0.05)
    stepper.step(n=3)
    assert abs(stepper.state.xi[2]) < 1e-15 and stepper.state.xi[0] > 1.2


@pytest.mark.long
def test_setting_up_and_projecting_a_pinned_body_trace_its_constraint_a_few_times():
    calls = []

    def counted(n, a, p):
        calls.append(1)
        return hold(n, a, p)

    system = body(constraints={"pin": co.Holonomic(counted)})
    begun = start(system)
    calls.clear()
    run(system, steps=2, start=begun)
    assert len(calls) <= 8
    calls.clear()
    system.project(begun)
    assert len(calls) <= 6


ALWAYS = ("constrained", "around", "kept", "redundancy")
"""What asks whether a system has constraints."""


@pytest.mark.long
def test_a_free_body_runs_none_of_the_code_of_constraints(monkeypatch):
    def refused(*given, **named):
        raise AssertionError

    for module in (reactions, rattle, constrained_start):
        for name, value in vars(module).copy().items():
            if isfunction(value) and value.__module__ == module.__name__ and name not in ALWAYS:
                monkeypatch.setattr(module, name, refused)
    monkeypatch.setattr(rattle.Rattle, "__init__", refused)
    free = body()
    assert run(free, steps=2).good_steps == 2
