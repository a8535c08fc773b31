"""ξ and ν of datasets, files, final states, quantities and observations belong to the node."""

from __future__ import annotations

import pickle

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import inverse_legendre
from coadjoint.mechanics.continuous import vector_field
from coadjoint.mechanics.traced_once import traced_once
from coadjoint.methods.program import Constants
from coadjoint.simulation.steppers import engines

INERTIA = np.array([2.0, 2.0, 1.0])
BODY = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ (p.inertia * xi), parameters={"inertia": INERTIA})
START = np.array([1.0, 0.0, 2.0])


def exact(t):
    """ω of a symmetric top that nothing acts on: it turns about the third axis by (I₃ − I₁)/I₁ ω₃."""
    angle = (INERTIA[2] - INERTIA[0]) / INERTIA[0] * START[2] * np.asarray(t)
    return np.stack([np.cos(angle), np.sin(angle), np.full_like(angle, START[2])], axis=-1)


def simulated(dt=0.1, method=None, system=BODY, monitors=False, **more):
    start, settings = system.state(xi=START), {"accuracy": False, "progress": False, "monitors": monitors}
    return co.simulate(system, start, dt=dt, duration=5, method=method, **settings, **more)


def test_velocities_of_a_method_of_order_6_have_order_6():
    errors = {}
    for h in (0.1, 0.05):
        data = simulated(h, co.methods.KahanLi6(co.Midpoint())).dataset
        errors[h] = [np.max(np.abs(data[name].values - exact(data.time.values))) for name in ("xi", "xi_step")]
    (node, step), (finer, _) = errors[0.1], errors[0.05]
    assert node < 3e-7 and 5.5 < np.log2(node / finer) < 6.5
    assert step > 1e-2


def test_the_final_state_has_the_velocities_of_the_last_node_and_goes_on_to_the_same_bits():
    whole, half = simulated(), co.simulate(BODY, BODY.state(xi=START), dt=0.1, steps=20, accuracy=False, monitors=False)
    np.testing.assert_array_equal(half.final.xi, half.dataset.xi[-1])
    np.testing.assert_allclose(half.final.xi, half.final.mu / INERTIA, atol=1e-15)
    assert np.max(np.abs(half.final.xi - half.records.xi[-1])) > 1e-3
    rest = co.simulate(BODY, half.final, dt=0.1, steps=30, accuracy=False, monitors=False)
    for name in ("mu", "xi", "xi_step"):
        np.testing.assert_array_equal(rest.dataset[name][1:], whole.dataset[name][21:])


def test_trajectories_end_with_the_velocities_of_the_last_node_and_go_on_to_the_same_bits():
    path = co.trajectory(BODY, BODY.state(xi=START), dt=0.1, steps=50, accuracy=False)
    np.testing.assert_allclose(path.final.xi, simulated().final.xi, rtol=0, atol=1e-14)
    finer = co.trajectory(BODY, BODY.state(xi=START), dt=0.05, steps=100, accuracy=False)
    errors = [np.max(np.abs(each.final.xi - exact(5))) for each in (path, finer)]
    assert 1.9 < np.log2(errors[0] / errors[1]) < 2.1
    first = co.trajectory(BODY, BODY.state(xi=START), dt=0.1, steps=20, accuracy=False).final
    for start in (first, pickle.loads(pickle.dumps(first)), first.replace(t=first.t)):
        rest = co.trajectory(BODY, start, dt=0.1, steps=30, accuracy=False)
        np.testing.assert_array_equal(rest.final.mu, path.final.mu)


@pytest.mark.long
def test_the_gradient_of_a_final_kinetic_energy_is_that_of_runs():
    driven = co.System(
        co.Translation(0),
        lambda xi, n, nu, p, *, inputs: 0.5 * p.mass * (1 + inputs.load) * nu @ nu - 0.5 * n @ n,
        additional=co.Trivial(1),
        parameters={"mass": 1.0},
    )
    inputs = {"load": lambda motion: 0.5 + motion.t}

    def kinetic(state, mass):
        return 0.5 * mass * state.nu @ state.nu

    def by_trajectory(mass):
        system = driven.replace(mass=mass)
        path = co.trajectory(
            system, system.state(q=[1.0], inputs={"load": 0.5}), dt=0.05, steps=20, accuracy=False, inputs=inputs
        )
        return kinetic(path.final, mass)

    def by_run(mass):
        system = driven.replace(mass=mass)
        run = co.simulate(system, system.state(q=[1.0], inputs={"load": 0.5}), dt=0.05, steps=20, inputs=inputs)
        return kinetic(run.final, mass)

    differences = (by_run(1 + 1e-4) - by_run(1 - 1e-4)) / 2e-4
    assert abs(by_trajectory(1.0) - by_run(1.0)) < 1e-12
    with co.float64():
        value, slope = jax.value_and_grad(by_trajectory)(1.0)
    assert abs(value - by_run(1.0)) < 1e-12 and abs(slope - differences) < 1e-7


@pytest.mark.long
def test_states_between_nodes_and_at_events_have_the_velocities_of_their_momenta():
    run = simulated(events={"level": lambda state: state.xi[0] - 0.3})
    found = run.events["level"]
    assert len(found.t) == 1
    np.testing.assert_allclose(found.xi[:, 0], 0.3, atol=1e-10)
    np.testing.assert_allclose(run.at([0.3, 1.0]).xi, run.dataset.xi[[3, 10]], atol=1e-14)
    between = run.at([0.34])
    np.testing.assert_allclose(between.xi, between.mu / INERTIA, atol=1e-15)
    fleet = BODY.replace(inertia=co.each(np.array([INERTIA, 2 * INERTIA])))
    for at, inertia in zip(
        simulated(system=fleet, events={"turn": lambda s: s.xi[0]}).events["turn"], (1, 2), strict=True
    ):
        np.testing.assert_allclose(at.xi, at.mu / (inertia * INERTIA), atol=1e-15)


def test_the_state_of_a_stepper_has_the_velocities_of_its_node_and_goes_on_to_the_same_bits():
    stepper = co.Stepper(BODY, BODY.state(xi=START), dt=0.1, accuracy=False, until=lambda state: state.xi[0] - 0.3)
    stepper.step(n=5)
    here, run = stepper.state, simulated()
    np.testing.assert_array_equal(here.xi, run.at([0.5]).xi[0])
    after = stepper.trajectory(here, n=3).final
    stepper.step(n=3)
    np.testing.assert_allclose(after.xi, stepper.state.xi, rtol=0, atol=1e-15)
    for state in (here, pickle.loads(pickle.dumps(here)), here.replace(t=here.t)):
        stepper.restore(state)
        stepper.step(n=3)
        np.testing.assert_array_equal(stepper.state.mu, run.records.mu[8])
    stepper.step(n=40)
    assert stepper.event and abs(stepper.state.xi[0] - 0.3) < 1e-10
    fleet = co.Stepper(BODY.replace(inertia=co.each(np.array([INERTIA, 2 * INERTIA]))), BODY.state(xi=START), dt=0.1)
    fleet.step(n=5)
    np.testing.assert_allclose(fleet.state.xi, fleet.state.mu / (INERTIA * [[1], [2]]), atol=1e-15)


def test_files_hold_both_and_give_the_same_final_state(tmp_path):
    run = simulated()
    saved = co.load(run.save(tmp_path / "run.nc"), BODY)
    np.testing.assert_array_equal(saved.dataset.xi, run.dataset.xi)
    np.testing.assert_array_equal(saved.dataset.xi_step, run.records.xi)
    np.testing.assert_array_equal(saved.final.xi, run.final.xi)
    streamed = simulated(store=tmp_path / "run")
    np.testing.assert_array_equal(streamed.dataset.xi, run.dataset.xi)
    np.testing.assert_array_equal(streamed.final.xi, run.final.xi)
    assert "xi_step_2" in (run.save(tmp_path / "run.csv")).read_text().splitlines()[0]


@pytest.mark.parametrize("stored", [False, True])
def test_members_have_the_velocities_of_their_own_parameters(stored, tmp_path):
    fleet = BODY.replace(inertia=co.each(np.array([[2.0, 2.0, 1.0], [1.0, 1.5, 2.0]])))
    runs = simulated(system=fleet, **({"store": tmp_path / "fleet"} if stored else {}))
    for member, inertia in enumerate(([2.0, 2.0, 1.0], [1.0, 1.5, 2.0])):
        of = runs.dataset.isel(member=member)
        np.testing.assert_allclose(of.xi, of.mu / np.array(inertia), atol=1e-15)
        np.testing.assert_allclose(runs.final.xi[member], of.xi[-1], atol=1e-15)
        assert np.max(np.abs(of.xi_step - of.xi)) > 1e-3


@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_quantities_and_observations_see_the_node(backend):
    watched = BODY.watching({"spin": lambda s: s.xi[0]})
    run = simulated(system=watched, backend=backend, monitors=True)
    np.testing.assert_allclose(run.dataset.spin, run.dataset.xi[:, 0], atol=1e-15)
    if backend == "native":
        stepper = co.Stepper(BODY, BODY.state(xi=START), dt=0.1, observe={"xi": lambda s: s.xi})
        stepper.step()
        np.testing.assert_allclose(stepper.observation["xi"], run.dataset.xi[1], atol=1e-15)


@pytest.mark.long
@pytest.mark.parametrize("backend", ["native", "xla"])
def test_events_are_where_the_velocities_of_the_nodes_cross(backend):
    """Where ω₁ vanishes so does μ₁ = I₁ω₁, and not half a step earlier."""
    functions = {"velocity": lambda s: s.xi[0], "momentum": lambda s: s.mu[0]}
    found = simulated(events=functions, backend=backend).events
    assert len(found["momentum"].t) == 2
    np.testing.assert_allclose(found["velocity"].t, found["momentum"].t, rtol=1e-12)
    if backend == "native":
        steppers = [co.Stepper(BODY, BODY.state(xi=START), dt=0.1, until=f, accuracy=False) for f in functions.values()]
        for stepper in steppers:
            stepper.step(n=50)
        assert steppers[0].t == steppers[1].t


def test_additional_velocities_and_the_space_frame_are_of_the_node():
    inertia, mass = np.array([1.0, 2.0, 3.0]), np.array([1.0, 3.0, 2.0])
    system = co.System(
        co.SO3(),
        lambda xi, n, nu, a: 0.5 * xi @ (inertia * xi) + 0.5 * nu.hull @ (mass * nu.hull) - n.hull @ a,
        additional={"hull": co.Defining()},
        advected=co.Defining(),
        units={"xi": "rad/s", "nu": "m/s"},
    )
    start = system.state(xi=[0.3, -0.2, 0.5], q={"hull": [1, 0, 0]}, qdot={"hull": [0.2, 0.1, 0]}, a0=[0, 0, 1])
    data = co.simulate(system, start, dt=0.1, steps=4, accuracy=False, monitors=False).dataset
    np.testing.assert_allclose(data.nu_hull, data.pi_hull / mass, atol=1e-15)
    np.testing.assert_allclose(data.qdot_hull, np.einsum("tij,tj->ti", data.R, data.nu_hull), atol=1e-15)
    np.testing.assert_allclose(data.xi_spatial, np.einsum("tij,tj->ti", data.R, data.mu / inertia), atol=1e-15)
    assert data.nu_step_hull.attrs["units"] == "m/s" and "of the step" in data.nu_step_hull.attrs["long_name"]
    assert "at the node" in data.xi.attrs["long_name"] and data.xi_step.attrs["units"] == "rad/s"


def test_where_only_steps_have_velocities_these_are_shown_and_said_to_be_so():
    system = co.System(co.SO3(), discrete_lagrangian=lambda xi, h: 0.5 * h * xi @ (INERTIA * xi))
    start = system.state(xi=START)
    method = co.Variational(co.Cayley(), start="velocity")
    data = co.simulate(system, start, dt=0.1, steps=3, method=method, monitors=False).dataset
    assert "xi_step" not in data and "of the step that starts" in data.xi.attrs["long_name"]


def test_the_velocities_of_the_node_are_sought_only_where_an_observation_reads_them(monkeypatch):
    sought, at_node, state = [], engines.at_node, BODY.state(xi=START)
    monkeypatch.setattr(engines, "at_node", lambda *given: sought.append(given) or at_node(*given))
    for observe, reads in (({"mu": lambda s: 2 * s.mu}, False), ({"speed": lambda s: s.xi @ s.xi}, True)):
        seen, _ = engines.watch(BODY, observe, state)
        evaluate(seen, Constants(BODY.parameters, None), state)
        assert bool(sought) is reads


@pytest.mark.long
def test_a_stepper_traces_the_velocities_of_a_lagrangian_that_is_not_quadratic_once(monkeypatch):
    calls, solve = [], inverse_legendre._velocities.__wrapped__

    def counted(system, state):
        calls.append(state)
        return solve(system, state)

    monkeypatch.setattr(inverse_legendre, "_velocities", traced_once(counted))
    system = co.System(
        co.Translation(1),
        lambda xi: 0.5 * xi @ xi + 0.0625 * (xi @ xi) ** 2,
        forces=lambda motion: co.Force(torque=-0.1 * motion.inputs.spin),
    )
    start = system.state(xi=[0.3])
    co.Stepper(
        system, start, dt=0.01, inputs={"spin": lambda motion: motion.xi}, observe={"xi": lambda s: s.xi},
        accuracy=False,
    )  # fmt: skip
    assert len(calls) == 1


def test_the_equations_that_several_observations_read_are_traced_once():
    def reads(count):
        calls = []

        def lagrangian(xi, p):
            calls.append(xi)
            return 0.5 * xi @ (p.inertia * xi)

        body = co.System(co.SO3(), lagrangian, parameters={"inertia": INERTIA})
        observe = {f"part{i}": lambda s, i=i: vector_field(body, s).mu[i] for i in range(count)}
        co.Stepper(body, body.state(xi=START), dt=0.1, observe=observe, accuracy=False)
        return len(calls)

    reads(3)  # what is traced once in a process
    reads(1)
    assert reads(3) == reads(1)
