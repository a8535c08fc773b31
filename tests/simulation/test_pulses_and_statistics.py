"""Inputs that a step does not see, energies that forces must not change, and statistics of members, in closed form."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
import xarray as xr
import zarr

import coadjoint as co
from coadjoint.errors import ArgumentError, FileError
from coadjoint.manifest import Manifest, checksum, digest, entry
from coadjoint.simulation import energy_budget, resume
from coadjoint.simulation.accuracy.time_dependence import PARTS, _table_at, _unseen, bent, unseen_pulses
from coadjoint.simulation.run import _angles, _rows, statistics
from coadjoint.simulation.zarr_reader import arrays
from coadjoint.simulation.zarr_writer import Chunks, _filled, _read, array_metadata, group_metadata

H = 1.0


def seen(table: Any, steps: int = 10, variable: bool = False, names: tuple[str, ...] = ("fins",)) -> Any:
    """A run of steps of 1 s from t = 0 with an input by a table."""
    inputs = SimpleNamespace(names=names, sources=[table])
    program = SimpleNamespace(skeleton=SimpleNamespace(inputs=inputs))
    plan = SimpleNamespace(h=H, steps=steps, program=program)
    return SimpleNamespace(plan=plan, start=SimpleNamespace(t=0.0), method=SimpleNamespace(variable=variable))


def pulse(kind: Any, first: float, last: float, height: float = 1.0) -> Any:
    """Two columns, of which the second is 0 to 4 and has a pulse between two times."""
    times = np.array([0.0, first - 0.1, first, last, last + 0.1, 20.0])
    low = np.stack([np.zeros(6), np.linspace(0, 0.1, 6)], axis=1)
    low[2:4, 1] += height
    return kind(times, low)


@pytest.mark.parametrize("kind", [co.Held, co.Linear])
def test_a_pulse_within_a_step_is_named_with_a_step_that_shows_it(kind):
    run = seen(pulse(kind, 3.3, 3.7))
    assert unseen_pulses(run) == [(" `fins`", pytest.approx(0.05))]
    assert unseen_pulses(seen(pulse(kind, 3.3, 3.7), names=())) == [("", pytest.approx(0.05))]
    assert unseen_pulses(seen(pulse(kind, 3.3, 3.7, -1.0)))


@pytest.mark.parametrize("kind", [co.Held, co.Linear])
def test_a_pulse_over_a_node_after_the_end_or_with_variable_steps_is_none(kind):
    assert unseen_pulses(seen(pulse(kind, 3.3, 4.7))) == []
    assert (
        unseen_pulses(seen(pulse(kind, 11.3, 11.7))) == []
        and unseen_pulses(seen(pulse(kind, 3.3, 3.7), variable=True)) == []
    )
    assert _unseen(seen(pulse(kind, 3.3, 3.7)), kind(np.array([0.0, 1.0, 2.0]), np.array([0.0, 9.0, 0.0]))) is None


def test_a_pulse_counts_from_half_of_the_range_of_its_column():
    times = np.array([0.0, 3.2, 3.5, 3.8, 9.0, 10.0])
    for height, found in ((0.51, True), (0.49, False)):
        values = np.array([0.0, 0.0, height, 0.0, 0.0, 1.0])
        assert (_unseen(seen(None), co.Linear(times, values)) is not None) == found


def test_a_held_value_begins_at_its_time_up_to_round_off_and_a_linear_one_is_between():
    times, values = np.array([0.0, 1.0, 2.0]), np.array([[0.0, 5.0], [1.0, 7.0], [4.0, 9.0]])
    at = np.array([0.5, 1.0 - 1e-9, 1.5, 3.0])
    assert _table_at(co.Held(times, values), times, values, at).tolist() == [[0, 5], [1, 7], [1, 7], [4, 9]]
    assert _table_at(co.Linear(times, values), times, values, at) == pytest.approx(
        np.array([[0.5, 6.0], [1.0, 7.0], [2.5, 8.0], [4.0, 9.0]])
    )


def test_a_signal_is_bent_where_it_is_neither_a_line_nor_constant_over_most_steps():
    def rows(*shapes: Any) -> np.ndarray:
        return np.stack([shape(PARTS) for shape in shapes])[..., None]

    line, constant, wave = (lambda s: 2 * s + 1), (lambda s: 0 * s + 3.0), (lambda s: np.sin(7 * s))
    step = lambda s: np.where(s < 1, 0.0, 5.0)  # noqa: E731  # constant until the end of the step
    assert not bent(rows(line, constant, step), 5.0) and bent(rows(wave, wave, line), 2.0)
    assert not bent(rows(wave, line, constant), 2.0) and not bent(rows(wave, wave), 50.0)
    assert not bent(rows(wave, wave), 2.0, least=3.0) and not bent(0 * rows(wave, wave), 0.0)
    assert not bent(100 + rows(wave, wave), 2.0)  # a ripple beside which all else is constant


# Energies.


def watched(change: float, **more: Any) -> Any:
    given: dict[str, Any] = {
        "system": SimpleNamespace(takes=lambda name: False, places=()), "plan": SimpleNamespace(h=0.1),
        "extrema": {"energy": (1.0, 1.0 + change)}, "ends": {"energy": (1.0, 1.0)}, "_kinetic": lambda: 0.5,
        "accuracy": None,
        "method": SimpleNamespace(claims=SimpleNamespace(energy="bounded")),
    }  # fmt: skip
    return SimpleNamespace(**given | more)


def test_an_energy_that_nothing_changes_is_doubted_from_a_tenth_on(monkeypatch):
    monkeypatch.setattr(energy_budget, "energy_lines", lambda system: ())
    (said,) = energy_budget._changed(watched(0.1))
    assert "is off by 10%: dt = 0.1 is too large" in said and energy_budget._changed(watched(0.099)) == []
    for name in ("inputs", "internal"):
        moved = SimpleNamespace(takes=lambda asked, name=name: asked == name)
        assert energy_budget._changed(watched(0.5, system=moved)) == []
    losing = SimpleNamespace(claims=SimpleNamespace(energy="changed"))
    assert energy_budget._changed(watched(0.5, method=losing)) == [] == energy_budget._changed(watched(0.5, extrema={}))


def test_an_energy_is_known_where_the_velocities_were_found():
    for residual, known in ((energy_budget.SOLVED, True), (2 * energy_budget.SOLVED, False)):
        run = watched(0.0, extrema={"legendre_residual": (0.0, residual)})
        assert energy_budget.energy_known(run) == known
    (said,) = energy_budget.energy_warnings(run)
    assert f"a residual of {2 * energy_budget.SOLVED:.1e}" in said and energy_budget.energy_known(watched(0.0))


# Statistics and chunks.


def test_statistics_leave_out_members_that_failed():
    values = np.array([[1.0, 5.0, np.nan], [3.0, np.nan, np.nan], [8.0, np.nan, np.nan]])
    mean, std, least, most, half = _rows(values, [0.5])
    assert mean == pytest.approx([4.0, 5.0, np.nan], nan_ok=True) and least == pytest.approx(
        [1, 5, np.nan], nan_ok=True
    )
    assert std == pytest.approx([np.sqrt(13.0), np.nan, np.nan], nan_ok=True)
    assert most == pytest.approx([8, 5, np.nan], nan_ok=True) and half == pytest.approx([3, 5, np.nan], nan_ok=True)
    whole = _rows(values[:, :1], [0.0, 1.0])
    assert whole[:, 0] == pytest.approx([4.0, np.sqrt(13.0), 1.0, 8.0, 1.0, 8.0])
    assert _rows(values[:1, :1], [])[:, 0] == pytest.approx([1.0, np.nan, 1.0, 1.0], nan_ok=True)


def test_angles_are_counted_from_their_mean_direction():
    mean, std, least, most, half = _angles(np.array([[3.0], [-3.0], [np.pi]]), [0.5])[:, 0]
    off = np.pi - 3.0
    assert abs(mean) == pytest.approx(np.pi) and std == pytest.approx(off)
    assert (least, most, half) == pytest.approx((mean - off, mean + off, mean))


def test_statistics_have_labels_counts_and_the_axes_of_time():
    mu = np.arange(12.0).reshape(2, 3, 2)
    mu[1, 2, 0] = np.nan
    made = xr.Dataset(
        {
            "mu": (("member", "time", "axis"), mu),
            "energy": (("time", "member"), mu[..., 0].T),
            "mass": ("member", [1, 2]),
        },
        {"time": [0.0, 0.5, 1.0], "member": [0, 1], "speed": ("member", [1.0, 2.0])},
    )
    found = statistics(made, quantiles=[0.25])
    assert found.statistic.values.tolist() == ["mean", "std", "min", "max", "25%"] and set(found.data_vars) == {
        "mu",
        "energy",
    }
    assert found.members.values.tolist() == [2, 2, 1] and found.mu.dims == ("statistic", "time", "axis")
    assert statistics(made.transpose("time", "member", ...)).members.values.tolist() == [2, 2, 1]
    assert found.energy.sel(statistic="mean").values.tolist() == [3.0, 5.0, 4.0] and "speed" not in found.coords
    assert set(statistics(made, "energy").data_vars) == {"energy"}
    for call, sentence in (
        (lambda: statistics(made, "speed"), "has no variable `speed`: it knows energy, mu"),
        (lambda: statistics(made, quantiles=[1.01]), "a number from 0 to 1, but is 1.01"),
        (lambda: statistics(made, quantiles=[-0.01]), "a number from 0 to 1"),
        (lambda: statistics(made.isel(member=0)), "over the members of an ensemble, but this dataset has none"),
    ):
        with pytest.raises(ArgumentError, match=sentence):
            call()
    assert statistics(made, quantiles=[0.0, 1.0]).sizes["statistic"] == 6


def test_rows_of_a_stored_array_have_their_nodes_first():
    class Stored:
        """An array of members × time, or of time alone."""

        def __init__(self, values: np.ndarray, *dims: str):
            self.values, self.shape, self.dims = values, values.shape, dims

        def __getitem__(self, at: Any) -> np.ndarray:
            return self.values[at]

    values = np.arange(24.0).reshape(2, 4, 3)
    assert np.array_equal(_read(Stored(values, "member", "time", "axis"), 1, 3), values[:, 1:3].swapaxes(0, 1))
    assert np.array_equal(_read(Stored(values, "time", "a", "b"), 0, 1), values[:1])
    filled = _filled(np.ones((2, 1)), (3, 2), np.dtype(float))
    assert np.array_equal(filled[:2, :1], np.ones((2, 1))) and np.isnan(filled).sum() == 4
    assert _filled(np.ones(1, int), (2,), np.dtype(int)).tolist() == [1, -1]


def test_parts_of_stored_arrays_are_those_of_their_numbers_also_for_zarr(tmp_path: Path) -> None:
    """Chunks of 3 × 2 numbers, the last ones not full; integers, steps, and slices backwards and without numbers."""
    values = np.arange(35.0).reshape(7, 5)
    files = {"zarr.json": group_metadata({"order": ["x"]})}
    files["x/zarr.json"] = array_metadata((7, 5), (3, 2), values.dtype, ("time", "axis"), {"units": "m"})
    for i, j in np.ndindex(3, 3):
        data = _filled(values[3 * i : 3 * i + 3, 2 * j : 2 * j + 2], (3, 2), values.dtype).tobytes()
        files[f"x/c.{i}.{j}"] = data + checksum(data)
    manifest = Manifest(tmp_path, {"kind": "records"})
    for name, data in files.items():
        path = tmp_path / "records.zarr" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        manifest.files[f"records.zarr/{name}"] = entry(data)
    ours, theirs = arrays(manifest, "records.zarr")["x"], zarr.open_array(tmp_path / "records.zarr" / "x", mode="r")
    for key in (
        slice(None),
        4,
        (slice(1, 6, 2), 3),
        (-1, slice(4, 0, -3)),
        (slice(5, 2), slice(None)),
        (slice(2, 4), 2),
    ):
        np.testing.assert_array_equal(ours[key], values[key])
    np.testing.assert_array_equal(theirs[...], values)
    (tmp_path / "records.zarr" / "x" / "c.2.1").write_bytes(bytes(len(files["x/c.2.1"])))
    assert ours[5, 1] == values[5, 1] and ours[6, 4] == values[6, 4]
    with pytest.raises(FileError, match=r"c\.2\.1 of the run is damaged"):
        ours[5:, 2]


def test_chunks_hold_the_rows_that_were_placed_and_growing_ones_count_them(tmp_path: Path) -> None:
    """Five nodes of two members, in chunks of three nodes of one; after two nodes another writer takes over."""
    declared = {
        "time": array_metadata((5,), (3,), np.dtype(float), ("time",), {}),
        "x": array_metadata((2, 5, 2), (1, 3, 2), np.dtype(float), ("member", "time", "axis"), {}),
    }
    manifest = Manifest(tmp_path, {"kind": "records"})
    files = {"zarr.json": group_metadata({"order": list(declared)})}
    for name, data in (files | {f"{name}/zarr.json": data for name, data in declared.items()}).items():
        path = tmp_path / "records.zarr" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        manifest.files[f"records.zarr/{name}"] = entry(data)
    values = {"time": np.arange(5.0), "x": np.arange(20.0).reshape(5, 2, 2)}
    first, second = Chunks(manifest), Chunks(manifest)
    first.open()
    first.place({name: rows[:2] for name, rows in values.items()}, 2)
    first.write()
    for name, rows in (("time/c.0", values["time"][:2]), ("x/c.1.0.0", values["x"][:2, 1])):
        size = 28 if name == "time/c.0" else 52
        assert manifest.files[f"records.zarr/{name}"] == [size, digest(rows.tobytes()), 1, rows.nbytes]
    second.take_up(2)
    second.place({name: rows[2:] for name, rows in values.items()}, 3)
    assert second.count == 5 and second.partial and len(manifest.files["records.zarr/x/c.1.0.0"]) == 2
    second.write(complete=True)
    assert {len(one) for one in manifest.files.values()} == {2} and not list(manifest.problems())
    found = arrays(manifest, "records.zarr")
    np.testing.assert_array_equal(found["time"][:], values["time"])
    np.testing.assert_array_equal(found["x"][:], values["x"].swapaxes(0, 1))


def test_internal_states_on_disk_are_those_of_evenly_spaced_nodes_nodes_first(monkeypatch) -> None:
    class Jets(NamedTuple):
        jets: np.ndarray

    monkeypatch.setattr(resume, "NODES", 3)
    rows = np.arange(36.0).reshape(2, 6, 3)
    store = SimpleNamespace(last=SimpleNamespace(internal=Jets(rows[:, -1])))
    for held, members, expected in ((rows, 2, rows.swapaxes(0, 1)), (rows[0], None, rows[0])):
        stored = SimpleNamespace(read=lambda every, held=held: held[..., ::every, :])
        names = {"internal_jets": stored}
        run: Any = SimpleNamespace(store=store, count=6, members=members, _rows=lambda names=names: names)
        (found,) = resume._OnDisk.internal_states(run)
        np.testing.assert_array_equal(found.jets, expected[::2])
        run.count = 1
        assert resume._OnDisk.internal_states(run) == []
