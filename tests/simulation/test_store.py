"""Runs that stream to disk and are killed: the finished result is the same to the bit, and nothing is lost."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import interrupted
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.run import backend as kernels
from coadjoint.simulation import store as streaming
from coadjoint.simulation.progress import Progress

SEED = int(os.environ.get("COADJOINT_SEED", "20251121"))
RUN = {"dt": 0.01, "steps": 3001, "save_every": 7, "progress": False}


@pytest.fixture(scope="module")
def vehicle():
    return interrupted.system()


@pytest.fixture(scope="module")
def whole():
    """The run that nobody interrupted, in memory."""
    return interrupted.simulate()


def assert_same(run, whole):
    """Every value, to the bit, and the certificate but for times."""
    expected = whole.dataset
    assert list(run.dataset.data_vars) == list(expected.data_vars)
    assert set(run.dataset.coords) == set(expected.coords)
    for name, values in expected.variables.items():
        found = run.dataset[name]
        assert found.dims == values.dims and found.attrs == values.attrs
        assert found.values.dtype == values.dtype
        np.testing.assert_array_equal(found.values, values.values, err_msg=str(name))
    times = {"certificate", "card", "seconds", "set_up_seconds"}
    for name in set(expected.attrs) - times:
        np.testing.assert_array_equal(run.dataset.attrs[name], expected.attrs[name], err_msg=name)
    assert set(run.dataset.attrs) == set(expected.attrs)


def child(folder: Path) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, interrupted.__file__, str(folder)], stderr=subprocess.PIPE)


def killed(folder: Path, wait: float, from_birth: bool = False) -> bool:
    """Start the run, kill it `wait` seconds after it began to stream; whether that interrupted it."""
    process = child(folder)
    try:
        while not from_birth and not folder.exists() and process.poll() is None:
            time.sleep(0.002)
        time.sleep(wait)
        process.send_signal(signal.SIGKILL)
    finally:
        errors = process.communicate()[1]
    assert process.returncode in (0, -signal.SIGKILL), errors.decode()
    return process.returncode != 0


def kill_and_resume(tmp_path, vehicle, whole, moments):
    interrupted_in_earnest = 0
    for i, (wait, from_birth) in enumerate(moments):
        folder = tmp_path / f"run{i}"
        cut = killed(folder, wait, from_birth)
        if not folder.exists():
            continue  # killed before the run began: there is nothing to go on with
        before = co.load(folder).dataset
        np.testing.assert_array_equal(before.xi, whole.dataset.xi[: len(before.time)])
        interrupted_in_earnest += cut and len(before.time) < whole.count
        run = co.resume(folder, vehicle, progress=False)
        assert_same(run, whole)
        assert not list(folder.rglob("*.partial"))
        shutil.rmtree(folder)
    return interrupted_in_earnest


@pytest.mark.long
def test_runs_killed_at_random_moments_go_on_to_the_same_bits(tmp_path, vehicle, whole):
    generator = random.Random(SEED)
    moments = [(generator.uniform(0, 1.0), False) for _ in range(5)]
    assert kill_and_resume(tmp_path, vehicle, whole, moments) >= 2


@pytest.mark.long
def test_runs_killed_at_fifty_random_moments_go_on_to_the_same_bits(tmp_path, vehicle, whole):
    generator = random.Random(SEED + 1)
    moments = [(generator.uniform(0, 1.2), False) for _ in range(40)]
    moments += [(generator.uniform(0, 4.0), True) for _ in range(10)]
    assert kill_and_resume(tmp_path, vehicle, whole, moments) >= 20


def stopped_after(monkeypatch, looks: int) -> None:
    """Interrupt the next run in this process when it has reported its progress `looks` times."""
    seen = iter(range(looks))

    def advance(self, steps, seconds):
        if next(seen, None) is None:
            raise KeyboardInterrupt

    monkeypatch.setattr(Progress, "advance", advance)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("method", "backend"),
    [
        (co.Midpoint(co.Cayley()), "native"),
        (co.Midpoint(co.Cayley()), "xla"),
        (co.LeftRectangle(co.Exponential(), start="velocity"), "native"),
        pytest.param(co.LeftRectangle(co.Exponential(), start="velocity"), "xla", marks=pytest.mark.long),
    ],
    ids=lambda part: getattr(part, "title", part),
)
def test_an_interrupted_run_goes_on_to_the_same_bits(tmp_path, vehicle, monkeypatch, backend, method):
    monkeypatch.setattr(streaming, "PERIOD", 0.0)
    monkeypatch.setattr(streaming, "BURDEN", 0.0)
    given = {**RUN, "steps": 60_001, "backend": backend, "method": method}
    whole = co.simulate(vehicle, interrupted.start(vehicle), **given)
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        stopped_after(patched, 4)
        co.simulate(vehicle, interrupted.start(vehicle), **given, store=tmp_path / "run")
    assert 0 < len(co.load(tmp_path / "run").dataset.time) < whole.count
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        stopped_after(patched, 3)
        co.resume(tmp_path / "run", vehicle)
    assert_same(co.resume(tmp_path / "run", vehicle), whole)


@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_a_run_does_not_depend_on_its_chunks(vehicle, backend):
    run = co.simulate(vehicle, interrupted.start(vehicle), **{**RUN, "steps": 500}, backend=backend)
    plan, state = run.plan, run.start
    state = run.method.begin(vehicle, state, plan.h)
    generator, done, iterations = random.Random(SEED), 0, 0
    lows = {}
    while done < 500:
        length = min(generator.randint(1, 90), 500 - done)
        chunk = kernels.run(plan.backend, plan.program, plan.constants, state, plan.h, 1, length, True)
        state, done, iterations = chunk.final, done + chunk.steps, iterations + chunk.iterations
        lows = {name: np.minimum(lows.get(name, np.inf), low) for name, (low, _) in chunk.extrema.items()}
    for name in ("mu", "pi", "n", "a", "g", "t"):
        np.testing.assert_array_equal(getattr(state, name), getattr(run.final, name))
    assert iterations == run.position.iterations


@pytest.mark.long
def test_memory_stays_flat_while_records_stream(tmp_path):
    """Ten times the records, 70 MB of them, in the same memory."""
    script = f"""
import resource, sys
sys.path.insert(0, {str(Path(interrupted.__file__).parent)!r})
import interrupted
peaks = []
for i, steps in enumerate((20_000, 200_000)):
    interrupted.simulate({str(tmp_path)!r} + f"/run{{i}}", steps=steps, save_every=1)
    peaks.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
print(*peaks)
"""
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    first, second = (int(word) / 1024 for word in found.stdout.split())
    size = sum(file.stat().st_size for file in (tmp_path / "run1").rglob("*")) / 2**20
    assert size > 60
    assert second - first < 15, f"{first:.0f} MB, then {second:.0f} MB"


@pytest.mark.long
def test_a_finished_run_is_returned_and_read_lazily(tmp_path, vehicle):
    whole = co.simulate(vehicle, interrupted.start(vehicle), **RUN)
    run = co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=tmp_path / "run")
    assert_same(run, whole)
    assert not isinstance(run.dataset["xi"].variable._data, np.ndarray)
    again = co.resume(tmp_path / "run", vehicle)
    assert_same(again, whole)
    assert str(again) == str(run) == str(co.load(tmp_path / "run"))
    np.testing.assert_array_equal(again.final.pi, whole.final.pi)
    assert again.relative_change("energy") == whole.relative_change("energy")
    saved = co.load(run.save(tmp_path / "run.nc"))
    np.testing.assert_array_equal(saved.dataset.q, whole.dataset.q)


@pytest.mark.long
def test_a_streamed_run_that_fails_keeps_what_was_computed(tmp_path):
    """A step size at which Newton's iteration fails some steps into the run."""

    def stiffening(xi, p):
        return 0.5 * xi @ p.inertia @ xi

    def torque(motion, p):
        return co.Force(torque=10.0 * motion.xi * (motion.xi @ motion.xi))

    body = co.System(co.SO3(), stiffening, parameters={"inertia": np.diag([1.0, 2.0, 3.0])}, forces=torque)
    given = {"dt": 0.05, "steps": 1000, "progress": False}
    with pytest.raises(co.errors.StepError) as kept:
        co.simulate(body, body.state(xi=[0.1, 0.2, 0.3]), **given)
    with pytest.raises(co.errors.StepError) as stored:
        co.simulate(body, body.state(xi=[0.1, 0.2, 0.3]), **given, store=tmp_path / "run")
    assert str(stored.value) == str(kept.value)
    assert stored.value.run.count > 3
    assert_same(stored.value.run, kept.value.run)
    with pytest.raises(co.errors.StepError) as again:
        co.resume(tmp_path / "run", body)
    assert str(again.value) == str(kept.value)


@pytest.mark.long
def test_inputs_and_chosen_quantities_are_given_again(tmp_path, vehicle, monkeypatch):
    def pushed(motion, p):
        return co.Force(force=motion.inputs.thrust * np.array([1.0, 0, 0]))

    def inputs(motion):
        return {"thrust": 0.1 * motion.t}

    body = co.System(
        co.SO3(),
        interrupted.lagrangian,
        additional=co.Defining(),
        advected=co.Defining(),
        parameters=vehicle.parameters,
        forces=pushed,
    )
    given = {**RUN, "steps": 300, "inputs": inputs}
    whole = co.simulate(body, interrupted.start(body), **given)
    run = co.simulate(body, interrupted.start(body), **given, store=tmp_path / "run")
    assert_same(run, whole)
    with pytest.raises(co.errors.ArgumentError, match="begun with `inputs`"):
        co.resume(tmp_path / "run", body)
    with pytest.raises(co.errors.ArgumentError, match="equations differ"):
        co.resume(tmp_path / "run", body, inputs=lambda motion: {"thrust": 0.2 * motion.t})
    assert_same(co.resume(tmp_path / "run", body, inputs=inputs), whole)


@pytest.mark.parametrize(
    "method",
    [
        co.LeftRectangle(co.Cayley(), start="velocity"),
        co.Midpoint(co.Exponential()),
        co.Trapezoidal(co.difference_maps.Squared(co.Cayley())),
        co.Suzuki4(co.methods.LeftRight()),
    ],
    ids=lambda method: method.title,
)
def test_methods_are_written_as_names_and_fields(method):
    from coadjoint.simulation.configuration import method_form, method_from

    form = json.loads(json.dumps(method_form(method)))
    assert method_from(form) == method


def test_a_method_of_ones_own_is_asked_for():
    from dataclasses import dataclass

    from coadjoint.simulation.configuration import method_form

    @dataclass(frozen=True)
    class Own(co.Midpoint):
        pass

    assert method_form(Own()) is None


def rigid_body():
    body = co.System(co.SE3(), lambda xi: 0.5 * xi @ (np.arange(1.0, 7.0) * xi))
    return body, body.state(xi=[0.3, 0.2, 0.1, 1.0, 2.0, 3.0])


def two_arrows():
    spaces = {"up": co.Defining(), "north": co.Defining()}
    body = co.System(co.SO3(), lambda xi, a: xi @ xi - a.up[2] - 2 * a.north[0] * a.up[1], advected=spaces)
    return body, body.state(xi=[0.3, 0.2, 0.1], a0={"up": [0, 0, 1], "north": [1, 0, 0]})


def pendulum():
    body = co.System(co.SO2(), lambda xi, n, nu: xi @ xi + nu @ nu - n @ n, additional=co.Trivial(1))
    return body, body.state(xi=[0.3], q=[1.0], qdot=[0.0])


def unitary():
    group = co.DirectProduct(co.Un(2), co.SO2())  # elements of U(n) are tuples with names
    body = co.System(group, lambda xi: 0.5 * xi @ (np.arange(1.0, 6.0) * xi))
    return body, body.state(xi=[0.3, 0.2, 0.1, 0.5, 1.0])


@pytest.mark.cases(1)
@pytest.mark.parametrize("make", [rigid_body, two_arrows, pendulum, unitary])
@pytest.mark.parametrize("monitors", [True, False])
def test_every_kind_of_state_streams(tmp_path, make, monitors):
    body, start = make()
    given = {"dt": 0.01, "steps": 50, "save_every": 4, "monitors": monitors, "progress": False}
    whole = co.simulate(body, start, **given)
    run = co.simulate(body, start, **given, store=tmp_path / "run")
    assert_same(run, whole)
    assert_same(co.resume(tmp_path / "run", body), whole)
