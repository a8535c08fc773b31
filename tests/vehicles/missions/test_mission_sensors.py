"""Sensors in missions: in the dataset, in the folder, the same to the bit, and mistakes told in a sentence."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.cli.main import main
from coadjoint.errors import ArgumentError
from coadjoint_vehicles.files.writing import vehicle_to_toml
from coadjoint_vehicles.parts import Damping, Thrusters

MISSION = """
[vehicle]
file = "float.toml"
[controller]
kind = "none"
[mission]
push = [9.0]
[initial]
position_m = [0, 0, 10]
[sensors]
names = ["imu", "dvl", "pressure"]
seed = 7
bottom_m = 18
[run]
dt = 0.05
duration = 3
save_every = 4
[output]
figures = false
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    push = Thrusters("push", positions=[[0.1, 0.02, 0]], directions=[[0.8, 0, 0.6]], curve={"linear": 1.0}, lag=0.5)
    sensors = co.vehicles.load("bluerov2_heavy_blue").sensors
    vehicle = co.vehicles.Vehicle(
        name="float", mass=10.0, inertia=[0.1, 0.2, 0.2], added_mass=[2, 5, 5, 0.1, 0.1, 0.1], length=1.0,
        center_of_mass=(0, 0, 0.05), parts=(Damping("damping", quadratic=[10, 30, 30, 1, 1, 1]), push), sensors=sensors,
    )  # fmt: skip
    Path("float.toml").write_text(vehicle_to_toml(vehicle), encoding="utf-8")
    Path("bare.toml").write_text(vehicle_to_toml(replace(vehicle, sensors=())), encoding="utf-8")


def mission(text=MISSION, name="dive.toml"):
    Path(name).write_text(text, encoding="utf-8")
    return co.vehicles.load_mission(name)


@pytest.mark.long
def test_a_mission_leaves_what_its_sensors_read_in_the_dataset_and_in_the_folder():
    mission()
    assert main(["run", "dive.toml", "--out", "dive"]) == 0
    saved = co.load("dive/trajectory.nc").dataset
    names = [name for name in saved.data_vars if str(name).startswith("sensor_")]
    assert {"sensor_imu_gyroscope", "sensor_dvl_velocity", "sensor_pressure_depth"} < set(names)
    assert not any("compass" in str(name) for name in names)
    assert saved.attrs["sensors_seed"] == 7 and saved.sizes["sensor_imu_time"] == 301
    summary = json.loads(Path("dive/summary.json").read_text())["mission"]["sensors"]
    assert summary["imu"] == {"readings": 301, "tried": 301} and summary["dvl"]["tried"] == 16
    rows = Path("dive/sensor_pressure.csv").read_text().splitlines()
    assert rows[0] == "time_s,arrival_s,depth_m" and len(rows) == 62
    depth = np.array([float(row.split(",")[2]) for row in rows[1:]])
    moved = np.interp(saved.sensor_pressure_time, saved.time, saved.q[:, 2])
    assert np.all(np.abs(depth - moved) < 0.25) and np.allclose(depth / 0.002, np.round(depth / 0.002))
    assert not Path("dive/sensor_compass.csv").exists()


@pytest.mark.cases(7)
@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("seed = 7", "seed = -7", r"\[sensors\] seed must be a whole number from 0, but is -7"),
        ("seed = 7", "seed = 1.5", r"\[sensors\] seed must be a whole number"),
        ("seed = 7", "sede = 7", r"Section \[sensors\] has no key `sede`: did you mean `seed`"),
        ('"imu", ', '"inu", ', r"has no sensor `inu`: did you mean `imu`"),
        ('"imu", ', '"dvl", ', r"names has a sensor twice"),
        ('["imu", "dvl", "pressure"]', '"imu"', r"names must be a list of texts, but is 'imu'"),
        ("bottom_m = 18", 'bottom = "deep"', r"bottom must be a number, but is 'deep'"),
        ("bottom_m = 18", "bottom_m = nan", r"bottom must be a depth of at least 0 m, positive down, but is nan m"),
        ("bottom_m = 18", "bottom_m = -18", r"bottom must be a depth of at least 0 m, positive down, but is -18 m"),
        ("bottom_m = 18", "bottom_s = 18", r"ends in a unit of time, but `bottom` measures length"),
        (
            "duration = 3",
            'duration = 3\nmembers = 2\n[perturb]\nmass = "1 %"',
            r"reads a single vehicle, but \[run\] members",
        ),
        ('file = "float.toml"', 'file = "bare.toml"', r"The vehicle float has no sensors"),
    ],
)
def test_mistakes_in_the_section_are_told_in_a_sentence(old, new, sentence):
    assert old in MISSION
    with pytest.raises(ArgumentError, match=sentence):
        _ = mission(MISSION.replace(old, new, 1)).setup


GRID = MISSION.replace("bottom_m = 18\n", "").replace("[sensors]", '[water.bottom]\nfile = "bottom.csv"\n[sensors]', 1)


@pytest.mark.long
def test_sensors_know_the_bottom_of_the_water():
    """Bottom lock ends where the grid rises: with the same depth everywhere it is read as with bottom_m."""
    dvl: Any = co.vehicles.load("bluerov2_heavy_blue").sensor("dvl")

    def grid(depth):
        rows = [f"{n},{e},{depth}" for n in (-50, 50) for e in (-50, 50)]
        Path("bottom.csv").write_text("north,east,depth\n" + "\n".join(rows) + "\n")

    level = mission().run().dataset
    grid(18.0)
    same = mission(GRID, "grid.toml").run().dataset
    np.testing.assert_array_equal(same.sensor_dvl_velocity, level.sensor_dvl_velocity)
    assert level.sizes["sensor_dvl_time"] > 0
    grid(10.0 + 2 * float(dvl.highest))
    far = mission(GRID, "grid.toml").run().dataset
    assert far.sizes["sensor_dvl_time"] == 0


@pytest.mark.long
def test_what_cannot_be_read_costs_no_results(monkeypatch):
    def fails(*args, **more):
        raise ArgumentError("The sensor is out of order.")

    monkeypatch.setattr("coadjoint_vehicles.readings.of_run.readings", fails)
    mission()
    assert main(["run", "dive.toml", "--out", "dive"]) == 0
    saved = co.load("dive/trajectory.nc")
    assert saved.dataset.time[-1] == 3 and not Path("dive/sensor_imu.csv").exists()
    assert "The sensor is out of order." in Path("dive/summary.json").read_text()


LOST = """
[faults.deaf]
sensor = "dvl"
lost = true
time_s = 1
until_s = 2
[faults.flooded]
sensor = "pressure"
lost = true
depth_m = 10.0
"""


@pytest.mark.long
def test_a_sensor_that_is_lost_reads_nothing_while_it_is_and_the_others_the_same():
    whole, holed = mission().run(), mission(MISSION + LOST, "lost.toml").run()
    time = whole.dataset.sensor_dvl_time.values
    kept = (time < 1) | (time >= 2)
    assert 0 < kept.sum() < len(time)
    np.testing.assert_array_equal(holed.dataset.sensor_dvl_velocity, whole.dataset.sensor_dvl_velocity[kept])
    np.testing.assert_array_equal(holed.dataset.sensor_imu_gyroscope, whole.dataset.sensor_imu_gyroscope)
    assert holed.dataset.sizes["sensor_pressure_time"] == 0
    assert "From t = 1 s to 2 s, fault `deaf`: the sensor dvl reads nothing." in holed.warnings
    late = mission(MISSION + LOST.replace("10.0", "100"), "late.toml").run()
    assert late.dataset.sizes["sensor_pressure_time"] == whole.dataset.sizes["sensor_pressure_time"]
    assert "The fault `flooded` of the sensor pressure did not come." in late.warnings


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ('"dvl"\nlost', '"dlv"\nlost', r"no sensor 'dlv': did you mean `dvl`|sensor 'dlv'"),
        ("lost = true\ntime", "lost = 1\ntime", r"needs lost = true, but has 1"),
        ("time_s = 1\n", "", r"needs one of `time_s` and `depth_m`"),
        ("until_s = 2", "until_s = 0.5", r"ends at 0.5 s, before it begins at 1 s"),
        ("until_s = 2", "untill_s = 2", r"`untill_s`.*until"),
        ("time_s = 1", "time_m = 1", r"unit of length|measures time"),
    ],
)
def test_mistakes_about_lost_sensors_are_told_in_a_sentence(old, new, sentence):
    assert old in LOST
    with pytest.raises(ArgumentError, match=sentence):
        _ = mission(MISSION + LOST.replace(old, new, 1)).setup


def test_a_sensor_is_lost_only_where_sensors_are_read():
    plain = MISSION.split("[sensors]")[0] + "[run]" + MISSION.split("[run]")[1]
    with pytest.raises(ArgumentError, match="the mission reads none"):
        _ = mission(plain + LOST).setup


@pytest.mark.long
def test_a_sensor_whose_readings_never_arrive_is_a_warning_of_the_mission():
    vehicle = co.vehicles.load("float.toml")
    sensors = tuple(replace(one, latency=1e9) if one.name == "dvl" else one for one in vehicle.sensors)
    Path("float.toml").write_text(vehicle_to_toml(replace(vehicle, sensors=sensors)), encoding="utf-8")
    run = mission().run(progress=False)
    assert [one for one in run.warnings if "No reading of `dvl` arrives by the end of the run at 3 s" in one]
