"""A run keeps what it says: nodes, extrema between nodes, files, and goes on exactly where another ended."""

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.simulation.certificate_forms import rows
from paper_vehicle import start, system

VEHICLE = system()
START = start(VEHICLE)


def test_a_run_that_goes_on_from_a_record_is_the_same_run():
    whole = co.simulate(VEHICLE, START, dt=0.01, steps=200, monitors=False)
    first = co.simulate(VEHICLE, START, dt=0.01, steps=120, monitors=False)
    second = co.simulate(VEHICLE, first.final, dt=0.01, steps=80, monitors=False)
    for one, other in zip(jax.tree.leaves(whole.final), jax.tree.leaves(second.final), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(("steps", "save_every"), [(100, 7), (100, 1), (100, 100), (5, 100)])
def test_every_kth_node_and_the_last_are_kept(steps, save_every):
    run = co.simulate(VEHICLE, START, dt=0.01, steps=steps, save_every=save_every, monitors=False)
    expected = sorted({*range(0, steps, save_every), steps})
    np.testing.assert_array_equal(run.steps_saved, expected)
    np.testing.assert_allclose(run.dataset.time, 0.01 * np.array(expected), rtol=0, atol=1e-15)
    full = co.simulate(VEHICLE, START, dt=0.01, steps=steps, monitors=False)
    np.testing.assert_array_equal(run.records.q, full.records.q[expected])


def test_extrema_are_taken_over_every_step_although_few_are_saved():
    sparse = co.simulate(VEHICLE, START, dt=0.01, steps=500, save_every=250)
    dense = co.simulate(VEHICLE, START, dt=0.01, steps=500)
    for name, values in dense.monitors.items():
        low, high = sparse.extrema[name]
        np.testing.assert_array_equal(low, values.min(axis=0))
        np.testing.assert_array_equal(high, values.max(axis=0))


@pytest.mark.long
def test_both_backends_agree_to_round_off():
    native = co.simulate(VEHICLE, START, dt=0.01, steps=100, backend="native")
    xla = co.simulate(VEHICLE, START, dt=0.01, steps=100, backend="xla")
    assert native.position.iterations <= 2 * xla.position.iterations, "chords shrink by a factor"
    for one, other in zip(jax.tree.leaves(native.records), jax.tree.leaves(xla.records), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


def test_a_saved_run_is_read_back_as_it_was_and_never_overwritten(tmp_path):
    run = co.simulate(VEHICLE, START, dt=0.01, steps=20)
    path = run.save(tmp_path / "dive.nc")
    back = co.load(path)
    assert str(back) == str(run)
    for name, values in run.dataset.data_vars.items():
        np.testing.assert_array_equal(back.dataset[name], values)
    with pytest.raises(co.errors.FileError, match="exists already"):
        run.save(path)
    with pytest.raises(co.errors.FileError, match="There is no file"):
        co.load(tmp_path / "none.nc")
    with pytest.raises(co.errors.FileError, match="does not exist"):
        run.save(tmp_path / "nowhere" / "dive.nc")
    assert [p.name for p in tmp_path.iterdir()] == ["dive.nc"]


def test_the_dataset_carries_what_people_plot():
    data = co.simulate(VEHICLE, START, dt=0.01, steps=20).dataset
    R, n = data.R.values, data.n.values
    np.testing.assert_allclose(data.q, np.einsum("tij,tj->ti", R, n), atol=1e-15)
    np.testing.assert_allclose(data.xi_spatial, np.einsum("tij,tj->ti", R, data.xi), atol=1e-15)
    angles = [co.attitude.zyx(*row) for row in data.euler_angles.values]
    np.testing.assert_allclose(angles, R, atol=1e-14)


def test_inputs_are_held_over_each_step_and_recorded():
    """A constant thrust u along e₁ for a body without weight: q̈ = u/m, exact for every variational rule."""

    def free(xi, n, nu, a, p):
        return 0.5 * p.mass * nu @ nu + 0.5 * xi @ p.inertia @ xi + 0.0 * n @ a

    def forces(motion, p):
        return co.Force(force=motion.inputs.thrust)

    body = system(free, forces=forces)
    run = co.simulate(
        body,
        start(body, xi=[0, 0, 0], qdot=[0, 0, 0]),
        dt=0.01,
        steps=100,
        inputs=lambda motion: co.Parameters(thrust=[2.0, 0.0, 0.0]),
        monitors=False,
    )
    expected = 0.5 * 2.0 / 123.8 * run.dataset.time**2
    np.testing.assert_allclose(run.dataset.q[:, 0], expected, atol=1e-14)
    np.testing.assert_array_equal(run.dataset.inputs_thrust[3], [2.0, 0.0, 0.0])


def test_the_certificate_says_what_the_run_did_in_five_lines_and_in_all():
    certificate = co.simulate(VEHICLE, START, dt=0.01, steps=20).certificate
    titles = [title for title, _ in rows(str(certificate))]
    assert titles == ["system", "steps", "accuracy", "conserved", "time"]
    for word in ("energy to ", "Kelvin–Noether to ", "balance to ", "group defect to ", "steps/s", "order 2"):
        assert word in str(certificate)
    for word in ("energy, discrete", "Kelvin–Noether", "balance", "Newton", "group defect", "iterations"):
        assert dict(rows(certificate.long()))[word]


def test_a_lagrangian_that_reads_a_global_number_is_traced_again_when_the_number_changes():
    world = {"mass": 1.0}

    def free(xi, n, nu, a, p):
        return 0.5 * world["mass"] * nu @ nu + 0.5 * xi @ xi + world["mass"] * n @ a

    def momentum():
        body = system(free)
        return co.simulate(body, start(body, qdot=[0, 0, 0.8]), dt=0.01, steps=2, monitors=False).records.pi[0, 2]

    light = momentum()
    world["mass"] = 3.0
    assert momentum() == pytest.approx(3 * light, rel=1e-14)


def test_time_stays_right_to_the_last_digit_over_millions_of_steps():
    """A plain running sum of 0.1 would be off by 1e-5 s here, and forces of t by as much."""
    top = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi)
    run = co.simulate(top, top.state(xi=[0, 0, 1], t=3.0), dt=0.1, steps=2_000_000, save_every=500_000, monitors=False)
    np.testing.assert_allclose(run.records.t, 3.0 + 0.1 * run.steps_saved, rtol=1e-15, atol=0)


def test_a_step_that_does_not_resolve_the_motion_is_told_on_the_card():
    def heavy(xi, a):
        return 0.5 * xi @ (np.array([5.0, 5.0, 1.0]) * xi) - 20 * a[2]

    top = co.System(co.SO3(), heavy, advected=co.Defining())
    begun = top.state(g=co.attitude.zyx(0, 0, 0.3), xi=[0, 0, 15.0], a0=[0, 0, 1])
    assert "nothing changes, is off by 13%" in str(co.simulate(top, begun, dt=0.2, steps=500))
    assert "nothing changes, is off by" not in str(co.simulate(top, begun, dt=0.05, steps=500))


def test_parameters_and_systems_survive_copying_and_pickling():
    import copy
    import pickle

    back = pickle.loads(pickle.dumps(VEHICLE))
    again = copy.deepcopy(VEHICLE)
    for other in (back, again):
        run = co.simulate(other, start(other), dt=0.01, steps=5)
        np.testing.assert_array_equal(run.final.q, co.simulate(VEHICLE, START, dt=0.01, steps=5).final.q)
