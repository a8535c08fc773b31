"""Members of an ensemble are the single runs, and one that fails does not touch the others."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from paper_vehicle import PARAMETERS, start, system

VEHICLE = system()
MASSES = np.linspace(110.0, 140.0, 6)
RANDOM = np.random.default_rng(2025)


def same(one, other, tolerance=0.0):
    for left, right in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_allclose(left, right, rtol=0, atol=tolerance)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("backend", "tolerance"), [("native", 0.0), ("xla", 1e-12)])
def test_each_member_is_the_single_run_with_its_own_mass(backend, tolerance):
    settings = {"dt": 0.02, "steps": 100, "save_every": 7}
    fleet = co.simulate(VEHICLE.replace(mass=co.each(MASSES)), start(VEHICLE), backend=backend, **settings)
    for index, mass in enumerate(MASSES):
        alone = co.simulate(VEHICLE.replace(mass=mass), start(VEHICLE), **settings)
        same(jax.tree.map(lambda rows, i=index: rows[i], fleet.records), alone.records, tolerance)
        np.testing.assert_array_equal(fleet.steps_saved, alone.steps_saved)


@pytest.mark.long
def test_each_member_is_the_single_run_from_its_own_start():
    count = 2
    attitudes = co.attitude.zyx(RANDOM.normal(size=count), 0.2, 0.1)
    places, spins = RANDOM.normal(size=(count, 3)), RANDOM.normal(size=(count, 3))
    begun = start(VEHICLE, g=co.each(attitudes), q=co.each(places), xi=co.each(spins))
    fleet = co.simulate(VEHICLE, begun, dt=0.02, steps=50, monitors=False)
    for index in range(count):
        one = start(VEHICLE, g=attitudes[index], q=places[index], xi=spins[index])
        same(
            jax.tree.map(lambda rows, i=index: rows[i], fleet.records),
            co.simulate(VEHICLE, one, dt=0.02, steps=50, monitors=False).records,
            1e-14,
        )


@pytest.mark.long
def test_members_with_different_directions_of_gravity_each_conserve_their_own_momentum():
    down = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 1.0, 0.0]])
    fleet = co.simulate(VEHICLE, start(VEHICLE, a0=co.each(down)), dt=0.02, steps=200)
    assert np.max(fleet.relative_changes("kelvin_noether")) < 1e-11
    assert np.max(fleet.extrema["balance"][1]) < 1e-13
    top = co.System(co.SO3(), lambda xi, a: 0.5 * xi @ (xi * jnp.arange(1.0, 4.0)) - 2e9 * a[2], advected=co.Defining())
    fleet = co.simulate(top, top.state(xi=[0.3, 0.2, 5.0], a0=co.each(1e-9 * down)), dt=0.02, steps=200)
    assert np.max(fleet.relative_changes("kelvin_noether")) < 1e-11, "whatever the unit of a0"


@pytest.mark.long
def test_changes_of_members_that_begin_at_round_off_of_zero_energy_are_relative_to_their_motion():
    top = co.System(co.SO3(), lambda xi, a: 0.5 * xi @ (xi * jnp.arange(1.0, 4.0)) - a[2], advected=co.Defining())
    begun = np.array([[1.0, 0.0, 1e-25], [0.0, 0.6, 0.8]])
    fleet = co.simulate(top, top.state(xi=np.zeros(3), a0=co.each(begun)), dt=0.1, steps=50, accuracy=False)
    for index, a0 in enumerate(begun):
        alone = co.simulate(top, top.state(xi=np.zeros(3), a0=a0), dt=0.1, steps=50, accuracy=False)
        assert fleet.relative_changes("energy")[index] == pytest.approx(alone.relative_change("energy"), rel=1e-12)
    assert 1e-6 < np.max(fleet.relative_changes("energy")) < 1e-1
    mu = fleet.records.mu[0]
    assert fleet.sizes("energy")[0] == pytest.approx(np.max(0.5 * mu**2 @ (1 / np.arange(1.0, 4.0))), rel=1e-2)
    assert "energy          largest relative change: median" in fleet.certificate.long()


@pytest.mark.long
def test_a_member_that_fails_is_reported_and_masked_and_the_others_finish():
    parameters = co.Parameters(**{**PARAMETERS.asdict(), "until": 1.0})
    vehicle = system(
        parameters=parameters, forces=lambda motion, p: co.Force(torque=motion.xi * jnp.log(p.until - motion.t))
    )
    fleet = co.simulate(vehicle.replace(until=co.each([9.0, 0.0525, 8.0])), start(vehicle), dt=0.01, steps=30)
    assert fleet.failures == {1: "not finite at step 5"}
    assert list(fleet.steps_done) == [30, 5, 30]
    assert "member 1" in fleet.certificate.long()
    height = fleet.dataset.q.values[:, :, 2]
    assert (
        np.all(np.isfinite(height[[0, 2]])) and np.all(np.isfinite(height[1, :5])) and np.all(np.isnan(height[1, 5:]))
    )
    alone = co.simulate(vehicle.replace(until=8.0), start(vehicle), dt=0.01, steps=30)
    np.testing.assert_allclose(fleet.dataset.q[2], alone.dataset.q, rtol=0, atol=1e-14)


def test_ensembles_that_cannot_be_counted_are_refused():
    both = VEHICLE.replace(mass=co.each(MASSES), buoyancy=co.each([1.0, 2.0]))
    with pytest.raises(co.errors.ArgumentError, match="equally many values"):
        co.simulate(both, start(VEHICLE), dt=0.01, steps=2)
    begun = start(VEHICLE, q=co.each(np.zeros((3, 3))))
    with pytest.raises(co.errors.ArgumentError, match="equally many members"):
        co.simulate(VEHICLE.replace(mass=co.each(MASSES)), begun, dt=0.01, steps=2)
    with pytest.raises(co.errors.ArgumentError, match="leading axis"):
        co.each(3.0)
    with pytest.raises(co.errors.ArgumentError, match="`q` must have shape"):
        start(VEHICLE, q=co.each(np.zeros((3, 2))))
    with pytest.raises(co.errors.ArgumentError, match="must lie in SO3"):
        start(VEHICLE, g=co.each(np.stack([np.eye(3), 1.1 * np.eye(3)])))


def test_members_whose_first_step_leaves_the_chart_are_named():
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ (jnp.array([1.0, 2.0, 3.0]) * xi))
    start = body.state(xi=co.each([[1.0, 0, 0], [900.0, 1, 0], [2.0, 0, 0]]))
    words = r"of 1 of 3 members \(1\) would leave the chart of Cayley\(\) by a factor up to 1\.43; take dt < 0\.00698"
    with pytest.raises(co.errors.ArgumentError, match=words):
        co.simulate(body, start, dt=0.01, steps=2, accuracy=False)


def test_starting_momenta_are_those_of_each_member_s_own_parameters():
    masses = np.array([110.0, 140.0])
    vehicle = system().replace(mass=co.each(masses))
    begun = start(vehicle, xi=co.each([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]]))
    for index, mass in enumerate(masses):
        alone = start(system().replace(mass=mass), xi=[0.0, 0.0, index + 1.0])
        np.testing.assert_array_equal(begun.mu[index], alone.mu)
        np.testing.assert_array_equal(begun.pi[index], alone.pi)


@pytest.mark.long
def test_members_move_alike_whether_they_are_watched_or_not():
    fleet = VEHICLE.replace(mass=co.each(MASSES))
    watched = co.simulate(fleet, start(VEHICLE), dt=0.02, steps=30)
    alone = co.simulate(fleet, start(VEHICLE), dt=0.02, steps=30, monitors=False)
    same(watched.records.g, alone.records.g, 1e-14)
    assert alone.monitors == {}


@pytest.mark.long
def test_the_records_of_one_run_are_no_start_of_an_ensemble():
    """Each of them stands at its own time; members have one."""
    settings = {"dt": 0.02, "steps": 5, "accuracy": False}
    run = co.simulate(VEHICLE, start(VEHICLE), **settings)
    fleet = co.simulate(VEHICLE, start(VEHICLE, xi=co.each(RANDOM.normal(size=(3, 3)))), **settings)
    for records in (run.records, run.at([0.01, 0.05]), fleet.records):
        with pytest.raises(co.errors.ArgumentError, match=r"records from t = .* s: of one run take `run.final`"):
            co.simulate(VEHICLE, records, **settings)
    with pytest.raises(co.errors.ArgumentError, match=r"6 records from t = 0 s to 0.1 s: of one run take"):
        co.trajectory(VEHICLE, run.records, dt=0.02, steps=2)


@pytest.mark.long
def test_records_of_members_at_one_node_and_of_several_runs_at_one_time_are_a_start():
    settings = {"dt": 0.02, "steps": 5, "accuracy": False}
    fleet = co.simulate(VEHICLE, start(VEHICLE, xi=co.each(RANDOM.normal(size=(3, 3)))), **settings)
    whole = co.simulate(VEHICLE, fleet.start, dt=0.02, steps=8, accuracy=False)
    middle = jax.tree.map(lambda rows: rows[:, 3], whole.records)
    same(co.simulate(VEHICLE, middle, **settings).final, whole.final, 1e-13)
    same(co.simulate(VEHICLE, fleet.final, dt=0.02, steps=3, accuracy=False).final, whole.final, 1e-13)
    runs = [co.simulate(VEHICLE, start(VEHICLE, xi=xi), **settings).final for xi in np.eye(3)]
    together = jax.tree.map(lambda *leaves: np.stack(leaves), *runs)
    assert len(co.simulate(VEHICLE, together, **settings).codes) == 3
    finer = co.simulate(VEHICLE, start(VEHICLE), dt=0.01, duration=0.3, accuracy=False).final
    coarser = co.simulate(VEHICLE, start(VEHICLE), dt=0.1, duration=0.3, accuracy=False).final
    assert finer.t != coarser.t, "the same time but for how it was added up"
    together = jax.tree.map(lambda *leaves: np.stack(leaves), finer, coarser)
    assert len(co.simulate(VEHICLE, together, **settings).codes) == 2


@pytest.mark.long
def test_members_that_ended_at_several_times_go_on_from_one_time():
    many = start(VEHICLE, xi=co.each(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]])))
    ended = co.simulate(VEHICLE, many, dt=0.02, steps=50, until=lambda s: s.g[0, 0] - 0.9, accuracy=False).final
    assert ended.t[0] != ended.t[1]
    with pytest.raises(co.errors.ArgumentError, match=r"get one time by start\.replace\(t=np\.zeros\(2\)\)\.$"):
        co.simulate(VEHICLE, ended, dt=0.02, steps=5)
    on = co.simulate(VEHICLE, ended.replace(t=np.zeros(2)), dt=0.02, steps=5, accuracy=False)
    np.testing.assert_allclose(on.final.t, 0.1)


@pytest.mark.parametrize("patience", [1e-9, 1.0])
def test_the_nodes_of_members_that_end_at_events_do_not_depend_on_how_a_run_is_cut_into_chunks(monkeypatch, patience):
    monkeypatch.setattr("coadjoint.simulation.driver.PATIENCE", patience)
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi)
    start = body.state(xi=co.each([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]]))
    run = co.simulate(body, start, dt=0.01, duration=2.0, until=lambda state: state.g[1, 0] - 0.2, accuracy=False)
    longest = int(np.arcsin(0.2) / 0.01)  # the slower member turns by arcsin 0.2 at 1 rad/s
    assert run.records.t.shape == (2, longest + 2)  # its nodes, 0 to the last before the event, and the end of all
    assert np.isfinite(run.records.t[0, :-1]).all() and np.isnan(run.records.t[:, -1]).all()
