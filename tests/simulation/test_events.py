"""Runs that an event ends, and the motion between the nodes."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.noether import spatial_momentum


@pytest.fixture(scope="module")
def top():
    entry = co.models.catalogue["heavy_top"]
    system = entry.make()
    return system, entry.start(system)


@pytest.fixture(scope="module")
def vehicle():
    entry = co.models.catalogue["underwater_vehicle"]
    system = entry.make()
    return system, entry.start(system)


DEPTH = 12.0


def deep(state):
    return state.q[2] - DEPTH


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "method", [co.LeftRectangle(), co.Midpoint(), co.methods.KahanLi6(co.methods.LeftRight())], ids=repr
)
@pytest.mark.parametrize("backend", ["native", "xla"])
def test_a_dive_ends_at_its_depth(vehicle, method, backend):
    if backend == "xla" and not isinstance(method, co.Midpoint):
        pytest.skip("one method is enough for the second path")
    system, start = vehicle
    run = co.simulate(
        system, start, dt=0.05, duration=100.0, method=method, save_every=7, until=deep, progress=False, backend=backend
    )
    assert run.event is not None and 1.0 < run.event < 100.0
    assert run.final.q[2] == pytest.approx(DEPTH, abs=1e-11)
    assert float(run.final.t) == run.event
    assert run.event - 0.05 < float(run.records.t[-2]) + 7 * 0.05
    assert f"ended the run at t = {run.event:.10g} s" in str(run)
    assert run.relative_change("kelvin_noether") < 1e-12
    before = run.records.q[:-1, 2]
    assert np.all(before < DEPTH)
    np.testing.assert_allclose(run.dataset.time[:-1], 0.35 * np.arange(run.count - 1), rtol=1e-15)
    assert float(run.dataset.time[-1]) == run.event


@pytest.mark.long
def test_the_event_is_located_to_the_order_of_the_method(vehicle):
    system, start = vehicle
    fine = co.simulate(
        system,
        start,
        dt=0.01,
        duration=100.0,
        method=co.methods.KahanLi8(co.Midpoint()),
        until=deep,
        progress=False,
        monitors=False,
    ).event
    errors = [
        abs(co.simulate(system, start, dt=dt, duration=100.0, until=deep, progress=False, monitors=False).event - fine)
        for dt in (0.2, 0.1)
    ]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.15)


def test_an_event_that_never_occurs_lets_the_run_end_and_says_so(vehicle):
    system, start = vehicle
    run = co.simulate(system, start, dt=0.1, steps=50, until=lambda state: state.q[2] + 1e6, progress=False)
    assert run.event is None and run.good_steps == 50
    assert "never happened" in str(run)
    assert run.summary()["event"] is None


def test_a_run_may_start_where_its_event_is_zero(vehicle):
    system, start = vehicle
    run = co.simulate(
        system, start, dt=0.1, steps=20, until=lambda state: state.q[2] - 1.0, progress=False, monitors=False
    )
    assert run.event is None


@pytest.mark.long
def test_an_event_is_kept_in_files_and_found_again_after_an_interruption(vehicle, tmp_path):
    system, start = vehicle
    plain = co.simulate(system, start, dt=0.05, duration=100.0, until=deep, progress=False, save_every=3)
    stored = co.simulate(
        system, start, dt=0.05, duration=100.0, until=deep, progress=False, save_every=3, store=tmp_path / "dive"
    )
    assert stored.event == plain.event
    assert np.array_equal(stored.dataset["q"].values, plain.dataset["q"].values)
    assert float(stored.dataset.time[-1]) == float(plain.dataset.time[-1]) == plain.event
    assert float(co.load(tmp_path / "dive").dataset.time[-1]) == plain.event
    again = co.resume(tmp_path / "dive", system, until=deep)
    assert again.event == plain.event
    with pytest.raises(co.errors.ArgumentError, match="begun with `until`"):
        co.resume(tmp_path / "dive", system)
    plain.save(tmp_path / "dive.nc")
    loaded = co.load(tmp_path / "dive.nc")
    assert "ended the run" in str(loaded) and loaded.event == plain.event


@pytest.mark.parametrize(
    ("until", "sentence"),
    [
        (3.0, "must be a function of the state"),
        (lambda state: state.q, "must return one number"),
        (lambda state: state.q[2] > 3.0, "must return one number"),
        (lambda state: {"depth": state.q[2]}, "must return one number"),
        (lambda state: jnp.sqrt(-1.0 - state.q[2] ** 2), "must be finite"),
        (lambda state: state.depth, "until"),
    ],
)
def test_a_function_that_is_no_event_is_refused(vehicle, until, sentence):
    system, start = vehicle
    with pytest.raises(co.errors.LagrangianError, match=sentence):
        co.simulate(system, start, dt=0.1, steps=5, until=until, progress=False)


@pytest.mark.parametrize("given", [None, 3.0, "depth"])
def test_a_named_event_without_a_function_is_refused_and_not_passed_over(vehicle, given):
    system, start = vehicle
    with pytest.raises(co.errors.LagrangianError, match=r"The event `a` must be a function of the state, but is "):
        co.simulate(system, start, dt=0.1, steps=2, events={"a": given}, progress=False)


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", [co.Midpoint(), co.Suzuki4(co.methods.LeftRight(co.Exponential()))], ids=repr)
def test_dense_output_keeps_momenta_and_meets_the_nodes(top, method):
    system, start = top
    run = co.simulate(system, start, dt=0.01, steps=30, method=method, save_every=10, progress=False, monitors=False)
    times = np.array([0.0, 0.1, 0.1034, 0.1999999, 0.2, 0.25, 0.3])
    found = run.at(times)
    assert found.t == pytest.approx(times, abs=1e-12)
    for row, index in ((0, 0), (1, 1), (4, 2), (6, 3)):
        assert np.max(np.abs(found.g[row] - run.records.g[index])) < 1e-12
        assert np.max(np.abs(found.xi[row] - run.dataset.xi.values[index])) < 1e-12 * np.max(np.abs(found.xi[row]))
    assert np.max(np.abs(np.einsum("tij,tkj->tik", found.g, found.g) - np.eye(3))) < 1e-13
    momenta = np.array([evaluate(lambda s: spatial_momentum(system, s), state) for state in _rows(found)])
    vertical = momenta @ np.asarray(evaluate(lambda s: system.advected.act(system.group, s.g, s.a), start))
    assert np.ptp(vertical) < 1e-12 * np.max(np.abs(momenta))


def _rows(records):
    import jax

    return [jax.tree.map(lambda leaf, i=i: leaf[i], records) for i in range(len(records.t))]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "method",
    [co.Midpoint(co.Exponential()), co.Suzuki4(co.methods.LeftRight())],
    ids=repr,
)
def test_dense_output_has_the_order_of_the_method(top, method):
    system, start = top
    times = np.array([0.0137, 0.0311])
    exact = co.simulate(
        system,
        start,
        dt=0.0002,
        duration=0.04,
        method=co.methods.KahanLi8(co.Midpoint()),
        progress=False,
        save_every=50,
        monitors=False,
    ).at(times)
    errors = [
        np.max(
            np.abs(
                co.simulate(system, start, dt=dt, duration=0.04, method=method, progress=False, monitors=False)
                .at(times)
                .g
                - exact.g
            )
        )
        for dt in (0.004, 0.002)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(method.order, abs=0.2)


def test_between_nodes_the_inputs_are_those_that_the_run_held(top):
    """A feedback −kξ, held over each step: steps taken again from a record hold what the record holds."""
    body = co.System(
        co.SO3(), lambda xi, p: 0.5 * xi @ p.inertia @ xi, parameters=co.Parameters(inertia=np.diag([1.0, 2.0, 3.0])),
        forces=lambda motion, p: co.Force(torque=motion.inputs),
    )  # fmt: skip
    start = body.state(xi=[0.3, 1.0, 0.2])
    every, tenth = (
        co.simulate(
            body, start, dt=0.1, steps=20, inputs=lambda m: -2.0 * m.xi, save_every=n, progress=False, monitors=False
        )
        for n in (1, 10)
    )
    found, there = tenth.at(every.records.t), every.records.replace(xi=every.dataset.xi.values)
    for name in ("g", "mu", "xi", "inputs"):
        np.testing.assert_allclose(getattr(found, name), getattr(there, name), rtol=1e-14, atol=1e-15)
    at_start = np.abs(tenth.at([1.0 + 1e-7]).mu[0] - every.records.mu[10])
    assert np.max(at_start) < 1e-6, "the motion is continuous at a node"


def test_a_time_between_nodes_whose_step_has_no_solution_is_told_in_one_sentence():
    """Rigid bodies in group form bound the momentum by 1/h: a part of a fast step need not exist."""
    body = co.System(
        co.SO3(), group_lagrangian=lambda F, p, h: jnp.trace((F - jnp.eye(3)) @ p.shape) / h,
        parameters=co.Parameters(shape=np.diag([2.0, 1.0, 0.5])),
    )  # fmt: skip
    start, method = body.state(xi=[20.0, 5.0, 0.3]), co.methods.GroupVariational(start="velocity")
    with pytest.raises(co.errors.StepError, match="take a smaller dt"):
        co.simulate(body, start, dt=0.1, steps=20, method=method, until=lambda s: s.t - 1.234, progress=False)


@pytest.mark.parametrize("times", [-0.1, [0.1, 5.0], [[0.1]], [], "soon", np.nan])
def test_times_outside_the_run_are_refused(top, times):
    system, start = top
    run = co.simulate(system, start, dt=0.01, steps=10, progress=False)
    with pytest.raises(co.errors.ArgumentError, match="`times`"):
        run.at(times)


@pytest.mark.long
def test_locating_an_event_compiles_nothing_more_than_the_run(monkeypatch):
    """Held inputs and an internal state stay as they are within a step by a flag of the one kernel."""
    from coadjoint.kernels.run import native

    def rule(motion, h, p):
        return {"angle": motion.internal.angle + 0.2 * h * (motion.inputs - motion.internal.angle)}

    def torque(motion, p):
        return co.Force(torque=jnp.stack([0.0 * motion.xi[0], 0.0 * motion.xi[0], motion.internal.angle]))

    def lagrangian(xi, p):
        return 0.5 * xi @ p.inertia @ xi

    top = co.System(
        co.SO3(), lagrangian, parameters={"inertia": np.diag([1.0, 2.0, 3.0])}, forces=torque, internal=rule
    )
    start = top.state(xi=[0.3, 0.1, -0.5], internal={"angle": 0.5})
    planned = []
    monkeypatch.setattr(native, "plan", lambda *given, _plan=native.plan: planned.append(given) or _plan(*given))
    run = co.simulate(
        top,
        start,
        dt=0.1,
        steps=300,
        inputs=lambda motion: jnp.cos(motion.xi[0] + motion.t),
        until=lambda state: 12.0 - state.t + state.xi[2],
        events={"spin": lambda state: state.xi[2]},
        progress=False,
    )
    assert run.event is not None and len(run.events["spin"].t) > 0
    assert len(planned) == 1
