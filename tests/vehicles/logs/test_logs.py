"""Logs of vehicles as CSV: what is written is where the vehicle was, and what is read drives it the same way."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, FileError
from coadjoint.identification import synthetic_log
from coadjoint_vehicles import axes
from coadjoint_vehicles.logs import inputs, inputs_from_csv, read_log
from coadjoint_vehicles.logs.inputs import read_csv
from coadjoint_vehicles.logs.records import VehicleRecords
from coadjoint_vehicles.remus import remus_100, remus_start

LEGS = [0.0, 5.0]
INPUTS = {
    "depth": co.Held(LEGS, [1.0, 3.0]),
    "heading": co.Held(LEGS, np.radians([30.0, 200.0])),
    "speed": co.Held([0.0], [1.5]),
}


def dive(inputs):
    vehicle = remus_100(current=(0.1, 0.2, 0.0))
    start = remus_start(vehicle, position=(5, 7, 2), speed=1.5, revolutions=15.0, euler_zyx=(0.3, 0.2, 0.1))
    return co.simulate(vehicle, start, dt=0.05, duration=10, inputs=inputs, save_every=2)


@pytest.fixture(scope="module")
def run():
    return dive(INPUTS)


def columns(path):
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))


@pytest.mark.long
def test_a_log_tells_place_attitude_and_velocities_of_the_run(run, tmp_path):
    found = columns(run.save(tmp_path / "dive.csv"))
    data = run.dataset
    assert np.allclose(found["time_s"], data.time)
    for name, component in (("north_m", 0), ("east_m", 1), ("depth_m", 2)):
        assert np.allclose(found[name], data.q[:, component], atol=1e-9)
    for name, component in (("heading_deg", 0), ("pitch_deg", 1), ("roll_deg", 2)):
        assert np.allclose(found[name], np.degrees(data.euler_angles[:, component]), atol=1e-8)
    assert np.allclose(found["rudder_deg"], np.degrees(data.internal_rudder), atol=1e-9)
    assert np.allclose(found["command_propeller_per_s"], data.internal_controller_value_propeller, atol=1e-9)
    assert np.allclose(found["set_heading_deg"], np.degrees(data.inputs_heading), atol=1e-9)
    assert np.allclose(found["current_east_m_s"], 0.2, atol=1e-9)


@pytest.mark.long
def test_velocities_of_a_log_are_those_at_the_node_over_ground_and_through_the_water(run, tmp_path):
    path = run.save(tmp_path / "dive.csv")
    found, exact = columns(path), synthetic_log(run).columns
    for name in "uvw":
        assert np.allclose(found[f"{name}_m_s"], exact[name], atol=1e-10)
    for name in "pqr":
        assert np.allclose(found[f"{name}_rad_s"], exact[name], atol=1e-10)
    step = run.dataset.nu_step[:, 2].values
    assert np.max(np.abs(found["w_m_s"] - step)) > 5e-4  # which belongs to half a step later
    ground = np.stack([found[f"{name}_m_s"] for name in "uvw"], axis=1)
    water = np.stack([found[f"{name}_water_m_s"] for name in "uvw"], axis=1)
    assert np.allclose(np.einsum("kij,kj->ki", run.dataset.R, ground - water), [0.1, 0.2, 0.0], atol=1e-10)
    assert not any("water" in name for name in read_log(path).inputs)


@pytest.mark.long
def test_a_log_of_east_north_up_is_the_same_motion(run, tmp_path):
    ned, enu = columns(run.save(tmp_path / "ned.csv")), columns(run.save(tmp_path / "enu.csv", axes="ENU/FLU"))
    assert np.array_equal(enu["up_m"], -ned["depth_m"])
    assert np.array_equal(enu["east_m"], ned["east_m"])
    for name in ("v_m_s", "w_m_s", "v_water_m_s", "w_water_m_s", "q_rad_s", "r_rad_s"):
        assert np.array_equal(enu[name], -ned[name])
    angles = np.radians(np.stack([enu["yaw_deg"], enu["pitch_deg"], enu["roll_deg"]], axis=1))
    R = np.stack([co.attitude.zyx(*row) for row in angles])
    assert np.allclose(axes.rotation(R, "ENU/FLU"), run.dataset.R, atol=1e-9)
    with pytest.raises(ArgumentError, match="NED/FRD"):
        run.save(tmp_path / "other.csv", axes="NWU")
    assert not (tmp_path / "other.csv").exists()


@pytest.mark.long
def test_the_set_points_of_a_log_fly_the_same_mission_again(run, tmp_path):
    again = dive(inputs_from_csv(run.save(tmp_path / "dive.csv")))
    assert np.allclose(again.final.q, run.final.q, atol=1e-9)
    assert np.allclose(again.final.g, run.final.g, atol=1e-9)


@pytest.mark.long
def test_rows_that_say_nothing_new_cost_nothing(run, tmp_path):
    found = inputs_from_csv(run.save(tmp_path / "dive.csv"))
    assert [len(found[name].times) for name in ("depth", "heading", "speed")] == [2, 2, 1]
    time = np.linspace(0, 10, 1001)
    rows = [f"{t},{min(t, 5.0)}" for t in time]
    (tmp_path / "ramp.csv").write_text("time_s,depth_m\n" + "\n".join(rows))
    (ramp,) = inputs_from_csv(tmp_path / "ramp.csv", between="linear").values()
    assert np.allclose(ramp.times, [0, 5, 10])
    assert float(ramp(2.5)) == pytest.approx(2.5)


def test_units_at_the_end_of_a_column_become_si(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text(
        "# made by hand\ntime_min,heading_deg,speed_knots,propeller_rpm,push[1]_N,push[2]_N\n\n1,90,1,60,3,4\n"
    )
    found = inputs_from_csv(path)
    assert np.allclose(found["heading"].values, np.pi / 2)
    assert np.allclose(found["speed"].values, 1852 / 3600)
    assert np.allclose(found["propeller"].values, 1.0)
    assert np.array_equal(found["push"].values, [[3, 4]])
    assert np.array_equal(found["push"].times, [60])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "at least one line of numbers"),
        ("time_s,depth_m\n", "at least one line of numbers"),
        ("0,1\n1,2\n", "line 1: the first line must name"),
        ("depth_m,speed_m_s\n0,1\n", "a column `time_s`"),
        ("time_s;depth_m\n0;0,1\n", "line 2, column `depth_m`: '0,1' is not a number"),
        ("time_s,depth_m,\n0,1,2\n", "column 3 has no name"),
        ("time_s,depth_m,depth_km\n0,1,2\n", "`depth` comes twice, as `depth_m` and `depth_km`"),
        ("time_s,depth_m\n0,1\n1,deep\n", "line 3, column `depth_m`: 'deep' is not a number"),
        ("time_s,depth_m\n0,1\n\n1,\n", "line 4, column `depth_m`: a number is missing"),
        ("time_s,depth_m\n0,1\n1,nan\n", "line 3, column `depth_m`"),
        ("time_s,depth_m\n0,1\n1\n", "line 3: there are 1 cells for 2 columns"),
        ("time_s,depth_m\n0,1\n2,1\n2,3\n", "line 4, column `time_s`: the time 2 s comes twice"),
    ],
)
def test_a_mistake_in_a_table_is_told_with_its_place(tmp_path, text, words):
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(FileError, match=words) as caught:
        read_csv(path)
    assert str(path) in str(caught.value)


def test_a_table_without_the_wanted_input_or_too_long_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "long.csv"
    path.write_text("time_s,depth_m\n" + "\n".join(f"{k},{np.sin(k)}" for k in range(2000)))
    monkeypatch.setattr(inputs, "MOST_ROWS", 1000)
    with pytest.raises(ArgumentError, match="2000 rows, but at most 1000"):
        inputs_from_csv(path)
    assert len(inputs_from_csv(path, every=10.0)["depth"].times) == 200
    with pytest.raises(ArgumentError, match="no column of `heading`"):
        inputs_from_csv(path, names=["heading"])
    with pytest.raises(FileError, match="no file"):
        read_csv(tmp_path / "nothing.csv")


@pytest.mark.long
def test_a_log_is_read_by_identification_as_what_it_says(run, tmp_path):
    for axes_of_log in ("NED/FRD", "ENU/FLU"):
        path = tmp_path / f"{axes_of_log[:3]}.csv"
        log = read_log(run.save(path, axes=axes_of_log), axes=axes_of_log)
        data = run.dataset
        for name, values in (
            ("north", data.q[:, 0]),
            ("depth", data.q[:, 2]),
            ("w", data.nu[:, 2]),
            ("r", data.xi[:, 2]),
        ):
            assert np.allclose(log.columns[name], values, atol=1e-8), name
        assert np.allclose(np.sin(log.columns["heading"]), np.sin(data.euler_angles[:, 0]), atol=1e-8)
        assert np.allclose(log.inputs["rudder"], data.internal_controller_value_rudder, atol=1e-9)
        assert np.allclose(log.inputs["propeller"], data.internal_controller_value_propeller, atol=1e-8)


def test_what_is_no_vehicle_has_no_log(tmp_path):
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, name="body")
    run = co.simulate(body, body.state(xi=[0, 0, 1]), dt=0.1, steps=2)
    with pytest.raises(ArgumentError, match="`down` and `north`"):
        run.save(tmp_path / "body.csv", axes="ENU/FLU")
    assert not list(tmp_path.iterdir())


def test_speed_through_the_water_leaves_the_current_out(run):
    log = VehicleRecords(run.dataset)
    rotation = np.asarray(run.dataset.R)
    expected = np.asarray(run.dataset.nu) - np.einsum("kji,j->ki", rotation, [0.1, 0.2, 0.0])
    assert np.allclose(log.through_water, expected, atol=1e-12)
