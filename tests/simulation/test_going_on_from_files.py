"""A run goes on from its netCDF file to the bit, and what the file does not hold is said."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest

import coadjoint as co
from driven_body import BODY, START, H, commands, tables

INPUTS = tables(commands(20))
QUICK: dict[str, Any] = {"monitors": False, "accuracy": False, "progress": False}


@pytest.fixture(scope="module")
def first():
    return co.simulate(BODY, START, dt=H, steps=11, inputs=INPUTS, progress=False)


@pytest.fixture(scope="module")
def file(first, tmp_path_factory):
    return first.save(tmp_path_factory.mktemp("runs") / "body.nc")


def same(one, other):
    leaves = zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    return all(np.array_equal(a, b) for a, b in leaves)


@pytest.mark.long
def test_a_run_with_inputs_internal_states_and_parameters_goes_on_to_the_bit(first, file):
    loaded = co.load(file, BODY).final
    assert same(loaded, first.final.replace(memory=None, ledger=None))
    runs = [co.simulate(BODY, s, dt=H, steps=7, inputs=INPUTS, **QUICK) for s in (first.final, loaded)]
    assert same(runs[0].final, runs[1].final)
    whole = co.simulate(BODY, START, dt=H, steps=18, inputs=INPUTS, **QUICK)
    np.testing.assert_array_equal(runs[1].final.mu, whole.final.mu)
    np.testing.assert_array_equal(runs[1].final.internal.brake, whole.final.internal.brake)


@pytest.mark.long
def test_what_goes_on_with_other_parameters_says_what_stays(file):
    other = BODY.replace(power=2.0)
    loaded = co.load(file, other).final
    with pytest.raises(co.errors.ArgumentError, match='`power` changed: say what stays, keep="momentum"'):
        co.simulate(other, loaded, dt=H, steps=1, inputs=INPUTS, **QUICK)
    kept = co.simulate(other, loaded, dt=H, steps=1, inputs=INPUTS, keep="momentum", **QUICK)
    np.testing.assert_array_equal(kept.records.mu[0], loaded.mu)


@pytest.mark.long
def test_a_file_that_was_loaded_and_saved_again_still_goes_on(file, tmp_path):
    again = co.load(file).save(tmp_path / "again.nc")
    assert same(co.load(again, BODY).final, co.load(file, BODY).final)
    assert set(co.load(again).dataset) == set(co.load(file).dataset)


@pytest.mark.long
def test_what_is_missing_is_said_in_a_sentence(first, file, tmp_path):
    with pytest.raises(co.errors.ArgumentError, match=r"needs the system, .*co\.load\(path, system\)"):
        _ = co.load(file).final
    with pytest.raises(co.errors.ArgumentError, match=r"must be a co\.System, but is"):
        co.load(file, 3)  # pyright: ignore[reportArgumentType]
    plane = co.System(co.SE2(), lambda xi: 0.5 * xi @ xi)
    with pytest.raises(
        co.errors.ArgumentError, match=r"a run on SO3\(\), but the system that was given lives on SE2\(\)"
    ):
        _ = co.load(file, plane).final
    bare = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi)
    with pytest.raises(
        co.errors.ArgumentError, match=r"the parameters `inertia`, `power`, `lag`, but the system .* has none"
    ):
        _ = co.load(file, bare).final
    with_q = co.System(
        co.SO3(),
        lambda xi, n, nu, p: 0.5 * xi @ xi + 0.5 * nu @ nu,
        additional=co.Trivial(1),
        parameters=BODY.parameters,
    )
    with pytest.raises(co.errors.ArgumentError, match=r"another system .* its spaces have other dimensions"):
        _ = co.load(file, with_q).final
    first.dataset.to_netcdf(tmp_path / "old.nc", engine="h5netcdf")
    with pytest.raises(co.errors.FileError, match="holds no record to go on from"):
        _ = co.load(tmp_path / "old.nc", BODY).final


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("run.csv", b"time,xi_0\n0.0,1.0\n", "pandas.read_csv read a table, `read_log` the log of a vehicle"),
        ("run.toml", b"model = 'heavy_top'\n", "`coadjoint run` runs a run file"),
        ("stepper", b"PK\x03\x04", "co.load_stepper loads"),
        ("run.png", b"\x89PNG\r\n", "nor the folder of a streamed run."),
        ("run.nc", b"", "nor the folder of a streamed run."),
    ],
)
def test_a_file_that_is_no_run_is_answered_with_what_reads_it(tmp_path, name, content, says):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(co.errors.FileError, match="is not a netCDF file of a run") as caught:
        co.load(tmp_path / name)
    assert says in str(caught.value) and "\n" not in str(caught.value) and "signature" not in str(caught.value)


@pytest.mark.long
def test_half_a_file_of_a_run_is_told_as_damaged(file, tmp_path):
    (tmp_path / "half.nc").write_bytes(file.read_bytes()[:3000])
    with pytest.raises(
        co.errors.FileError,
        match=r"half\.nc cannot be read as netCDF: it is damaged, not whole, or still being written\.$",
    ):
        co.load(tmp_path / "half.nc")


@pytest.mark.long
def test_a_run_of_momenta_alone_goes_on_from_its_file(tmp_path):
    weights = np.linspace(0.5, 1.5, 8)
    system = co.System(co.SUn(3), hamiltonian=lambda mu: 0.5 * mu @ (weights * mu), name="momenta")
    start, method = system.state(mu=np.cos(np.arange(8.0))), co.IsospectralMidpoint()
    run, whole = (co.simulate(system, start, dt=0.05, steps=steps, method=method, **QUICK) for steps in (5, 10))
    loaded = co.load(run.save(tmp_path / "momenta.nc"), system).final
    assert loaded.g is None and np.array_equal(loaded.mu, run.final.mu)
    more = co.simulate(system, loaded, dt=0.05, steps=5, method=method, **QUICK).final
    np.testing.assert_allclose(more.mu, whole.final.mu, atol=1e-13)
    assert more.t == pytest.approx(whole.final.t)
    with pytest.raises(
        co.errors.ArgumentError, match=r"The start has no g, because a run with co\.IsospectralMidpoint"
    ):
        co.simulate(system, loaded, dt=0.05, steps=5, method=co.Midpoint(co.Exponential()), **QUICK)
