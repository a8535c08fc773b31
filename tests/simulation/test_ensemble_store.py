"""Ensembles that stream to disk: the same to the bit as in memory, in the memory of one flush."""

import subprocess
import sys
from pathlib import Path

import interrupted
import jax.numpy as jnp
import numpy as np
import pytest
from test_store import assert_same, stopped_after

import coadjoint as co
from coadjoint.simulation import members, store

SEED = 20251122
RUN = {"dt": 0.01, "steps": 301, "save_every": 3, "progress": False}
COUNT = 11


def fleet():
    """Vehicles with masses and starts of their own."""
    generator = np.random.default_rng(SEED)
    vehicle = interrupted.system(mass=co.each(np.linspace(110, 140, COUNT)))
    begun = vehicle.state(
        q=co.each(generator.normal(size=(COUNT, 3))), xi=co.each(generator.normal(size=(COUNT, 3))), a0=[0, 0, 1]
    )
    return vehicle, begun


def stiff():
    """A body whose member 1 meets the logarithm of a negative number at t = 0.5 s; member 3 at its first step."""
    body = co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ p.inertia @ xi,
        parameters={"inertia": np.diag([1.0, 2.0, 3.0]), "until": co.each([99.0, 0.5025, 98.0, -1.0, 97.0])},
        forces=lambda motion, p: co.Force(torque=0.01 * motion.xi * jnp.log(p.until - motion.t)),
    )
    return body, body.state(xi=[0.1, 0.2, 0.3])


@pytest.fixture
def small_blocks(monkeypatch):
    """Chunks of 7 nodes or so × 4 members or so, so that every border is met."""
    monkeypatch.setattr(store, "FLUSH_BYTES", 7 * COUNT * 500)
    monkeypatch.setattr(store, "BLOCK_BYTES", 7 * 4 * 500)


@pytest.fixture
def every_stretch(monkeypatch):
    """A checkpoint after every stretch."""
    monkeypatch.setattr(store, "PERIOD", 0.0)
    monkeypatch.setattr(store, "BURDEN", 0.0)


def chunks(dataset, name):
    return dataset[name].encoding["chunks"]


PATHS = [
    pytest.param(fleet, "native", marks=pytest.mark.long),
    (fleet, "xla"),
    (stiff, "native"),
    pytest.param(stiff, "xla", marks=pytest.mark.long),
]
"""Each ensemble by one path always, by the other in `long`."""


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("make", "backend"), PATHS)
def test_an_ensemble_on_disk_is_the_one_in_memory_to_the_bit(tmp_path, small_blocks, backend, make):
    system, begun = make()
    whole = co.simulate(system, begun, **RUN, backend=backend)
    run = co.simulate(system, begun, **RUN, backend=backend, store=tmp_path / "run")
    across, length = chunks(run.dataset, "xi")[:2]
    assert 1 < across < run.members or make is stiff
    assert 1 < length < 102
    assert_same(run, whole)
    assert_same(co.load(tmp_path / "run"), whole)
    again = co.resume(tmp_path / "run", system)
    assert_same(again, whole)
    assert str(again) == str(run)
    np.testing.assert_array_equal(run.final.pi, whole.final.pi)
    assert run.dataset.energy.dims == ("member", "time")
    for name in ("energy", "discrete_energy"):
        np.testing.assert_array_equal(run.relative_changes(name), whole.relative_changes(name))


def but_times(card: object) -> list[str]:
    return [line for line in str(card).splitlines() if not line.startswith("time")]


@pytest.mark.long
def test_a_member_that_fails_is_masked_on_disk_and_the_others_finish(tmp_path, small_blocks):
    body, begun = stiff()
    run = co.simulate(body, begun, **RUN, store=tmp_path / "run")
    whole = co.simulate(body, begun, **RUN)
    assert run.failures == {1: "not finite at step 50", 3: "not finite at step 0"}
    assert but_times(run) == but_times(whole)
    assert str(co.load(tmp_path / "run")) == str(run)
    found = co.load(tmp_path / "run").dataset
    assert list(found.steps_done) == [301, 50, 301, 0, 301]
    assert list(found.code != 0) == [False, True, False, True, False]
    spins = np.isfinite(found.xi.values).all(axis=2)
    assert spins[[0, 2, 4]].all() and spins[1, :17].all() and not spins[1, 17:].any() and not spins[3].any()


def test_an_ensemble_of_members_that_all_fail_streams(tmp_path):
    body, begun = stiff()
    run = co.simulate(body.replace(until=co.each([-1.0, -2.0])), begun, **RUN, store=tmp_path / "run")
    assert len(run.failures) == 2
    assert np.isnan(co.load(tmp_path / "run").dataset.xi.values).all()


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("make", "backend"), PATHS)
def test_an_interrupted_ensemble_goes_on_to_the_same_bits(
    tmp_path, monkeypatch, small_blocks, every_stretch, backend, make
):
    system, begun = make()
    given = {**RUN, "steps": 3001, "backend": backend}
    whole = co.simulate(system, begun, **given)
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        stopped_after(patched, 6)
        co.simulate(system, begun, **given, store=tmp_path / "run")
    before = co.load(tmp_path / "run").dataset
    assert 0 < len(before.time) < whole.count
    np.testing.assert_array_equal(before.xi, whole.dataset.xi[:, : len(before.time)])
    assert list(before.code) == list(whole.codes)
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        stopped_after(patched, 6)
        co.resume(tmp_path / "run", system)
    again = co.resume(tmp_path / "run", system)
    assert_same(again, whole)
    assert but_times(again) == but_times(whole)
    np.testing.assert_array_equal(again.iterations, whole.iterations)


@pytest.mark.long
def test_inputs_of_an_ensemble_stream_and_are_given_again(tmp_path, small_blocks):
    system, begun = fleet()
    system = co.System(
        co.SO3(),
        interrupted.lagrangian,
        additional=co.Defining(),
        advected=co.Defining(),
        parameters=system.parameters,
        forces=lambda motion, p: co.Force(force=motion.inputs.thrust * np.array([1.0, 0, 0])),
    )
    given = {**RUN, "inputs": lambda motion: {"thrust": 0.1 * motion.t}}
    whole = co.simulate(system, begun, **given, monitors=False)
    assert_same(co.simulate(system, begun, **given, monitors=False, store=tmp_path / "run"), whole)
    with pytest.raises(co.errors.ArgumentError, match="begun with `inputs`"):
        co.resume(tmp_path / "run", system)
    assert_same(co.resume(tmp_path / "run", system, inputs=given["inputs"]), whole)


@pytest.mark.long
def test_another_member_is_another_ensemble(tmp_path):
    system, begun = fleet()
    co.simulate(system, begun, **RUN, store=tmp_path / "run")
    other = np.linspace(110, 140, COUNT)
    other[-1] += 1e-9
    with pytest.raises(co.errors.ArgumentError, match="holds another run: the parameters differ"):
        co.resume(tmp_path / "run", system.replace(mass=co.each(other)))


@pytest.mark.long
def test_a_missing_block_of_members_is_told(tmp_path, small_blocks):
    system, begun = fleet()
    co.simulate(system, begun, **RUN, store=tmp_path / "run")
    file = tmp_path / "run" / "records.zarr" / "xi" / "c.1.2.0"
    file.unlink()
    for opened in (lambda: co.load(tmp_path / "run"), lambda: co.resume(tmp_path / "run", system)):
        with pytest.raises(co.errors.FileError, match="missing") as error:
            opened()
        assert str(file) in str(error.value)


@pytest.mark.long
def test_an_ensemble_too_large_for_memory_is_sent_to_a_store(tmp_path, monkeypatch):
    monkeypatch.setattr(members, "MEMORY_LIMIT", 1e5)
    system, begun = fleet()
    with pytest.raises(co.errors.ArgumentError, match=r"`store=`, or raise save_every from 3 to \d+ or more"):
        co.simulate(system, begun, **RUN)
    assert len(co.simulate(system, begun, **RUN, store=tmp_path / "run").dataset.time) == 102


@pytest.mark.long
@pytest.mark.parametrize("grow", ["nodes", pytest.param("members", marks=pytest.mark.long)])
def test_memory_stays_flat_while_an_ensemble_streams(tmp_path, grow):
    """Eight times the records, 330 MB of them, in the same memory but for the states of the members."""
    script = f"""
import resource, sys
sys.path.insert(0, {str(Path(interrupted.__file__).parent)!r})
import numpy as np
import coadjoint as co, interrupted
for i, times in enumerate((1, 8)):
    count, nodes = (500, 200 * times) if {grow == "nodes"} else (500 * times, 200)
    vehicle = interrupted.system(mass=co.each(np.linspace(110, 140, count)))
    begun = interrupted.start(vehicle)
    store = {str(tmp_path)!r} + f"/run{{i}}"
    co.simulate(vehicle, begun, dt=0.01, steps=50 * nodes, save_every=50, progress=False, store=store)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    first, second = (int(word) / 1024 for word in found.stdout.split())
    size = sum(file.stat().st_size for file in (tmp_path / "run1").rglob("*")) / 2**20
    assert size > 250
    assert second - first < 60, f"{first:.0f} MB, then {second:.0f} MB, for {size:.0f} MB of records"
