"""What missions write and tell after a run: files, tables of members, warnings, and sensors that were lost."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import xarray

import coadjoint as co
from coadjoint.errors import ArgumentError, CoadjointError
from coadjoint_vehicles.missions import results
from coadjoint_vehicles.missions.file import from_table
from coadjoint_vehicles.missions.lost_sensors import LostSensor, without_lost
from coadjoint_vehicles.missions.sensors import SensorsSection, counts, logs, observe
from coadjoint_vehicles.readings.taken import Readings, SensorReading
from coadjoint_vehicles.trials.track import TRIAL

TIME = np.array([0.0, 1.0, 2.0, 3.0])


def dataset(depth, **attrs: Any) -> xarray.Dataset:
    depth = np.asarray(depth, float)
    q = np.stack([0 * depth, 0 * depth, depth], axis=-1)
    dims = ("member", "time", "axis") if depth.ndim == 2 else ("time", "axis")
    return xarray.Dataset({"q": (dims, q)}, {"time": TIME}, {"vehicle_height": 1.0, **attrs})


def output(**changes: Any) -> Any:
    return SimpleNamespace(
        **{"csv": False, "mcap": False, "animation": "", "figures": False, "format": "png"} | changes
    )


# warnings


def test_members_that_leave_the_water_by_more_than_half_their_height_are_counted():
    said = results.left_water(dataset([[5, -0.5, 2, 1], [1, 2, 3, 4]]))
    assert said == []
    said = results.left_water(dataset([[5, -0.6, 2, 1], [1, 2, 3, 4]]))
    assert said == ["1 member leaves the water, up to 0.6 m above it."]
    said = results.left_water(dataset([[5, -0.6, np.nan, 1], [1, 2, -2, 4], [1, 1, 1, 1]]))
    assert said == ["2 members leave the water, up to 2 m above it."]


def test_members_that_do_not_follow_their_set_points_are_counted_and_the_first_is_told(monkeypatch):
    told = [[], ["Depth is off.", "Speed too."], ["No."]]
    monkeypatch.setattr(results, "VehicleRecords", lambda one: int(one.q.values[0, 2]))
    monkeypatch.setattr(results, "missed", told.__getitem__)
    fleet = dataset([[k] * 4 for k in range(3)])
    assert results.astray(fleet) == [
        "2 of 3 members do not follow their set points. Of member 1: Depth is off. Speed too."
    ]
    assert results.astray(fleet.isel(member=[0, 0])) == []
    assert results.astray(fleet.isel(member=1)) == told[1] and results.astray(dataset([1] * 4, **{TRIAL: "{}"})) == []
    monkeypatch.setattr(results, "MOST_DRAWN", 2)
    assert results.astray(fleet)[0].startswith("1 of 2 members")


# files


class Plots:
    animations: list[tuple[int, Path]]

    def __init__(self, shown):
        self.shown = shown

    def animation(self, path):
        self.animations.append((self.shown.sizes.get("member", 1), path))


@pytest.fixture
def drawn(monkeypatch):
    Plots.animations = []
    monkeypatch.setattr(results, "Plots", Plots)
    monkeypatch.setattr(results, "mission_summary", lambda one: {"depth": float(one.q.values[-1, 2]), "none": None})
    monkeypatch.setattr(results, "counts", lambda one: {"sensors": "counted"})
    monkeypatch.setattr(results, "logs", lambda one, folder: Plots.animations.append((0, folder)))
    return Plots.animations


@pytest.mark.parametrize("event", [None, "an event"])
def test_a_mission_writes_what_output_asks_for_and_says_what_ended_it(event, drawn, tmp_path):
    saved: list[Any] = []
    run = SimpleNamespace(
        dataset=dataset([1, 2, 3, 4]), plan=SimpleNamespace(save_every=5), event=event,
        final=SimpleNamespace(q="place"),
        save=lambda path, overwrite: saved.append((path.name, overwrite)),
    )  # fmt: skip
    run.plot = Plots(run.dataset)
    found = results.results(output(), tmp_path, cast(Any, run), lambda q: f"the end at {q}")
    ended = {"ended_by": "the end at place"} if event else {}
    assert found == {"mission": {"depth": 4.0, "none": None, "save_every": 5, **ended, "sensors": "counted"}}
    assert saved == drawn == []
    results.results(output(csv=True), tmp_path, cast(Any, run), str)
    assert saved == [("trajectory.csv", True)] and drawn == [(0, tmp_path)]
    results.results(output(mcap=True, animation="gif"), tmp_path, cast(Any, run), str)
    assert saved[1:] == [("trajectory.mcap", True)] and drawn[1:] == [(1, tmp_path / "animation.gif")]


def test_a_trial_adds_its_figures_of_merit(drawn, monkeypatch, tmp_path):
    trial = SimpleNamespace(track=SimpleNamespace(manoeuvre="zigzag"), values={"overshoot": 3.0}, line="told")
    monkeypatch.setattr("coadjoint_vehicles.trials.analysis.analyse", lambda one: trial)
    run = SimpleNamespace(dataset=dataset([1] * 4, **{TRIAL: "{}"}), plan=SimpleNamespace(save_every=1), event=None)
    found = results.results(output(), tmp_path, cast(Any, run), str)
    assert found["mission"]["trial"] == {"manoeuvre": "zigzag", "overshoot": 3.0} and found["notes"] == ["told"]


def fleet(count: int, failures: dict[int, str]) -> Any:
    parameters = co.Parameters(
        mass=co.each(np.arange(count) + 1.0), rod=co.each(np.arange(2.0 * count).reshape(count, 2)), g=9.8
    )
    return SimpleNamespace(
        dataset=dataset([[k] * 4 for k in range(count)]), failures=failures, seconds=2.0, set_up_seconds=1.0,
        system=SimpleNamespace(name="boat", parameters=parameters), method=SimpleNamespace(title="Midpoint"),
        plan=SimpleNamespace(h=0.05), certificate=SimpleNamespace(asdict=lambda: {"residual": 1e-12}),
    )  # fmt: skip


def test_members_that_finished_are_rows_with_what_was_varied_and_their_spread(drawn, tmp_path):
    found = results.members(output(csv=True, animation="gif"), tmp_path, fleet(4, {1: "no step"}))
    rows = [line.split(",") for line in (tmp_path / "members.csv").read_text().split()]
    assert rows[0] == ["member", "mass", "rod[1]", "rod[2]", "depth"]
    assert [[float(x) for x in row] for row in rows[1:]] == [[0, 1, 0, 1, 0], [2, 3, 4, 5, 2], [3, 4, 6, 7, 3]]
    depth = found.pop("mission")["depth"]
    assert depth["mean"] == pytest.approx(5 / 3) and (depth["min"], depth["max"]) == (0, 3)
    assert found == {
        "system": "boat", "method": "Midpoint", "dt": 0.05, "members": 4, "finished": 3, "failures": {"1": "no step"},
        "seconds": 2.0, "set_up_seconds": 1.0, "residual": 1e-12,
        "notes": ["Of an ensemble members.csv has a row for each member, in place of trajectory.csv."],
    }  # fmt: skip
    assert drawn == [(3, tmp_path / "animation.gif")]
    results.members(output(animation="gif"), tmp_path, fleet(9, {}))
    assert drawn[1][0] == 8
    with pytest.raises(ArgumentError, match="No member finished: no step"):
        results.members(output(), tmp_path, fleet(2, {0: "no step", 1: "nor here"}))


@pytest.mark.parametrize(
    ("asked", "members", "done", "told"),
    [
        ({}, 200, 200, []),
        ({"csv": True}, 200, 200,
         ["Of an ensemble members.csv has a row for each member, in place of trajectory.csv."]),
        ({"animation": "gif"}, 9, 9, ["Of an ensemble the animation shows 8 of the members."]),
        ({"animation": "gif"}, 9, 8, []),
        ({"figures": True}, 101, 101, ["Of an ensemble figures show 100 of the members."]),
        ({"figures": True}, 100, 100, []),
        ({"figures": [], "animation": "gif"}, 101, 50,
         ["Of an ensemble the animation shows 8 of the members; figures show 100 of the members."]),
    ],
)  # fmt: skip
def test_what_an_ensemble_leaves_out_is_a_note(asked, members, done, told):
    assert results._shown(output(**asked), members, done) == told


def test_numbers_of_a_summary_are_flat_and_times_are_left_out():
    summary = {"end": np.array([1.0, 2.0, 3.0]), "legs": {"first": {"depth": 4}}, "times_real_time": 9.0, "none": None}
    assert results.flat(summary) == {"end_north": 1.0, "end_east": 2.0, "end_depth": 3.0, "legs_first_depth": 4.0}


def test_figures_of_many_members_are_of_an_even_choice(monkeypatch, tmp_path):
    asked: list[Any] = []
    monkeypatch.setattr(results, "available", lambda one: ("attitude", "trial"))
    monkeypatch.setattr(results, "save_figures", lambda runs, *more: asked.append((runs[0], *more)) or ["a.png"])
    assert results.figures(output(), tmp_path, dataset([1] * 4)) == [] and asked == []
    many = dataset([[k] * 4 for k in range(101)])
    assert results.figures(output(figures=True, format="pdf"), tmp_path, many) == ["a.png"]
    shown, *more = asked[0]
    assert more == [tmp_path, ["trial", "attitude"], "pdf"]
    chosen = shown.q.values[:, 0, 2]
    assert chosen.size == 100 and chosen[[0, 1, -1]].tolist() == [0, 1, 100] and np.diff(chosen).tolist().count(2) == 1
    results.figures(output(figures=["trial"]), tmp_path, many.isel(member=slice(100)))
    assert asked[1][2] == ["trial"] and asked[1][0].sizes["member"] == 100


def test_trajectories_beyond_a_gigabyte_need_fewer_nodes():
    start = np.zeros(125)  # 2000 bytes a node, as twice the numbers of a state
    grid = SimpleNamespace(members=1000, count=500, save_every=1)
    with pytest.raises(ArgumentError, match=r"1000 members would take some 1.0 GB.* save_every = 2 or more"):
        results.require_room(cast(Any, grid), {"x": start})
    for fewer in ({"count": 499}, {"members": 1, "count": 10**6}, {"save_every": 2}):
        results.require_room(cast(Any, SimpleNamespace(**vars(grid) | fewer)), {"x": start})


# sensors


def lost(**given: Any) -> LostSensor:
    return LostSensor(**{"name": "blind", "sensor": "dvl", "lost": True} | given)


def test_a_sensor_is_lost_from_a_time_or_a_depth_on():
    deep = dataset([1.0, 2.5, 4.0, 5.0])
    assert [lost(time=1.5).begin(deep), lost(depth=2.5).begin(deep), lost(depth=6).begin(deep)] == [1.5, 1.0, np.inf]
    assert lost(depth=6).sentence(deep) == "The fault `blind` of the sensor dvl did not come."
    assert lost(time=3.0).sentence(deep) == "From t = 3 s on, fault `blind`: the sensor dvl reads nothing."
    assert lost(time=3.1).sentence(deep).endswith("did not come.")
    assert (
        lost(depth=2, until=2.5).sentence(deep) == "From t = 1 s to 2.5 s, fault `blind`: the sensor dvl reads nothing."
    )


def test_readings_while_a_sensor_is_lost_are_left_out():
    fields = {name: np.arange(5.0) + k for k, name in enumerate(("time", "arrival", "values", "exact", "number"))}
    taken = SensorReading(sensor=cast(Any, "dvl"), tried=5, **fields)
    read = Readings({"dvl": taken, "gps": taken}, 7)
    found = without_lost([lost(time=1.0, until=3.0), lost(sensor="imu", time=0.0)], read, dataset([1] * 4))
    assert found.seed == 7 and found.taken["gps"] is taken and list(found.taken) == ["dvl", "gps"]
    left = found.taken["dvl"]
    for k, name in enumerate(fields):
        assert getattr(left, name).tolist() == [k, k + 3, k + 4]


VEHICLE = SimpleNamespace(
    name="boat",
    sensors=[
        SimpleNamespace(name="dvl", kind="dvl", required=("bottom",)),
        SimpleNamespace(name="imu", kind="imu", required=()),
    ],
)


def test_sensors_are_those_that_are_named_or_all(monkeypatch):
    assert SensorsSection().of(cast(Any, VEHICLE)) == ("dvl", "imu")
    assert SensorsSection(names=["imu"]).of(cast(Any, VEHICLE)) == ("imu",)
    SensorsSection(names=["imu"]).require(cast(Any, VEHICLE), None)
    SensorsSection().require(cast(Any, VEHICLE), 0.0)
    for make, told in (
        (lambda: SensorsSection(names=["imu", "imu"]), "has a sensor twice"),
        (lambda: SensorsSection(names=[]).of(cast(Any, VEHICLE)), r'must be a list such as \["dvl"\], but is \[\]'),
        (lambda: SensorsSection(names=["sonar"]).of(cast(Any, VEHICLE)), "sonar"),
        (lambda: SensorsSection().of(cast(Any, SimpleNamespace(name="raft", sensors=[]))), "raft has no sensors"),
        (lambda: SensorsSection().require(cast(Any, VEHICLE), None), "The dvl dvl needs the depth of the bottom"),
    ):
        with pytest.raises(ArgumentError, match=told):
            make()


def test_readings_are_added_to_a_run_with_their_warnings_and_failures_are_warnings(monkeypatch):
    added: list[Any] = []
    read = SimpleNamespace(warnings=["noisy"], taken={}, seed=3)

    def readings(run, **given):
        assert given == {"seed": 5, "sensors": ("imu",), "bottom": 20.0}
        if run.fails:
            raise CoadjointError("no")
        return read

    monkeypatch.setattr("coadjoint_vehicles.readings.of_run.readings", readings)
    monkeypatch.setattr(Readings, "add_to", lambda self, one: added.append((self.seed, one)))
    section = SensorsSection(names=["imu"], seed=5)
    for fails, told in (
        (False, ["begun", "noisy"]),
        (True, ["begun", "What [sensors] asks for could not be read: no"]),
    ):
        run = SimpleNamespace(warnings=["begun"], dataset="data", fails=fails)
        observe(section, cast(Any, VEHICLE), 20.0, [], cast(Any, run))
        assert run.warnings == told
    assert added == [(3, "data")]


def test_each_sensor_has_a_table_and_its_readings_are_counted(monkeypatch, tmp_path):
    monkeypatch.setattr("coadjoint_vehicles.readings.taken.read_sensors", lambda one: one.attrs["names"])
    monkeypatch.setattr("coadjoint_vehicles.readings.taken.sensor_text", lambda one, name: f"of {name}")
    arrival = xarray.DataArray(np.zeros(3), attrs={"tried": 4})
    one = xarray.Dataset({"sensor_dvl_arrival": arrival}, attrs={"names": ["dvl"]})
    logs(one, tmp_path)
    assert (tmp_path / "sensor_dvl.csv").read_text() == "of dvl"
    assert counts(one) == {"sensors": {"dvl": {"readings": 3, "tried": 4}}}
    assert counts(xarray.Dataset(attrs={"names": []})) == {}


# files of missions

TABLE: dict[str, Any] = {
    "vehicle": {"name": "remus_100"}, "mission": {"depth": 5}, "run": {"dt": 0.1, "duration": 1}
}  # fmt: skip
MANY = {"run": {"dt": 0.1, "duration": 1, "members": 2}}


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"pilot": {}}, "is called .controller."),
        (MANY, r"members > 1 needs a section \[perturb\]"),
        (MANY | {"perturb": {"mass": 1.0}, "output": {"mcap": True}}, "mcap is the log of one run"),
        ({"perturb": {"mass": 1.0}}, r"needs \[run\] members"),
        (MANY | {"perturb": {"mass": 1.0}, "sensors": {}}, "reads a single vehicle, but .* are 2"),
        ({"faults": {"a": {"sensor": "dvl", "lost": True, "time": 1}}}, "the mission reads none"),
    ],
)
def test_sections_of_a_mission_that_do_not_go_together_are_refused(changes, told):
    with pytest.raises(ArgumentError, match=told):
        from_table(TABLE | changes, Path("a.toml"), "")
