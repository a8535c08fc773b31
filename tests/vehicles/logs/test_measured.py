"""Logs as CSV files: units, axes, gaps, and a sentence for every mistake."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.errors import ArgumentError, FileError
from coadjoint.groups import attitude
from coadjoint.identification import Log
from coadjoint_vehicles import axes as border
from coadjoint_vehicles.logs import read_log, write_log


def written(tmp_path, text):
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_units_of_headers_become_si_and_rad(tmp_path):
    path = written(
        tmp_path,
        "# a comment\n"
        "time_ms,roll_deg,heading [deg],u_kn,p (deg/s),depth_cm,rudder_deg,thrusters_0_N,thrusters_1_N,screw_rpm\n"
        "0,90,180,1,180,150,-90,1,2,60\n100,45,0,2,90,100,0,3,4,120\n",
    )
    log = read_log(path)
    assert np.allclose(log.time, [0.0, 0.1])
    assert np.allclose(log.columns["roll"], [np.pi / 2, np.pi / 4]) and np.allclose(log.columns["heading"], [np.pi, 0])
    assert np.allclose(log.columns["u"], np.array([1, 2]) * 1852 / 3600) and np.allclose(
        log.columns["p"], [np.pi, np.pi / 2]
    )
    assert np.allclose(log.columns["depth"], [1.5, 1.0]) and np.allclose(log.inputs["rudder"], [-np.pi / 2, 0])
    assert np.allclose(log.inputs["thrusters"], [[1, 2], [3, 4]]) and np.allclose(log.inputs["screw"], [1, 2])
    assert log.units["rudder"] == "rad" and log.units["screw"] == "1/s"


@pytest.mark.parametrize("by_quaternion", [False, True])
def test_a_log_in_enu_and_flu_says_the_same_as_one_in_ned_and_frd(tmp_path, by_quaternion):
    random = np.random.default_rng(1765)
    angles = random.uniform(-1.0, 1.0, (4, 3))
    R = attitude.zyx(*angles.T)
    q, v, omega = random.normal(size=(3, 4, 3))
    turned = border.rotation(R, "ENU/FLU")
    x, there, spin = (
        border.space_vector(q, "ENU/FLU"),
        border.body_vector(v, "ENU/FLU"),
        border.body_vector(omega, "ENU/FLU"),
    )
    if by_quaternion:
        turn, names = attitude.to_quaternion(turned), "qw,qx,qy,qz"
    else:
        turn, names = np.stack(attitude.zyx_angles(turned), axis=1), "yaw_rad,pitch_rad,roll_rad"
    rows = np.column_stack([np.arange(4.0), x, turn, there, spin])
    body = "\n".join(",".join(f"{value:.15g}" for value in row) for row in rows)
    header = f"time_s,x_m,y_m,z_m,{names},u_m_s,v_m_s,w_m_s,p_rad_s,q_rad_s,r_rad_s"
    log = read_log(written(tmp_path, f"{header}\n{body}\n"), axes="ENU/FLU")
    wanted = dict(zip(("north", "east", "depth"), q.T, strict=True))
    wanted |= dict(zip(("heading", "pitch", "roll"), angles.T, strict=True))
    wanted |= dict(zip("uvw", v.T, strict=True)) | dict(zip("pqr", omega.T, strict=True))
    for name, values in wanted.items():
        np.testing.assert_allclose(np.exp(1j * log.columns[name]), np.exp(1j * values), atol=1e-12)


def test_what_is_written_is_read_back(tmp_path):
    t = np.array([0.0, 0.1, 0.25, 0.3])
    columns = {"roll": np.array([0.1, np.nan, -0.3, 3.0]), "u": np.array([1.0, 2.0, np.nan, 4.0])}
    inputs = {"rudder": np.array([0.1, 0.2, 0.3, 0.4]), "thrusters": np.arange(8.0).reshape(4, 2)}
    log = Log(t, columns, inputs, {"rudder": "rad", "thrusters": "N"}, step=0.05)
    path = tmp_path / "out.csv"
    write_log(log, path)
    back = read_log(path)
    for part, other in ((log.columns, back.columns), (log.inputs, back.inputs)):
        for name in part:
            np.testing.assert_allclose(other[name], part[name], rtol=1e-9)
    assert back.units == log.units and back.step == 0.05
    assert any("1 of 4 values of roll" in note for note in back.notes)
    assert any("irregular" in note for note in back.notes)


def test_commands_count_and_not_what_the_actuators_did(tmp_path):
    """The columns of the library's own logs of runs."""
    header = (
        "time_s,u_m_s,rudder_deg,screw_per_s,command_rudder_deg,command_thrusters[1],command_thrusters[2],set_depth_m"
    )
    log = read_log(written(tmp_path, f"{header}\n0,1,10,5,90,1500,1600,3\n1,1,20,6,180,1700,1800,3\n"))
    assert sorted(log.inputs) == ["rudder", "screw", "thrusters"]
    assert np.allclose(log.inputs["rudder"], [np.pi / 2, np.pi]) and np.allclose(log.inputs["screw"], [5, 6])
    assert np.allclose(log.inputs["thrusters"], [[1500, 1600], [1700, 1800]])
    assert np.allclose(log.actual["rudder"], np.radians([10, 20])) and log.first("rudder") == np.radians(10)
    assert log.first("screw") == 5 and log.first("sail") is None


def test_what_an_actuator_did_in_another_unit_than_its_command_is_not_where_it_started(tmp_path):
    log = read_log(written(tmp_path, "time_s,u_m_s,thruster_N,command_thruster_us\n0,1,12,1500\n1,1,20,1600\n"))
    assert log.first("thruster") == 1500 and not log.actual


@pytest.mark.parametrize("header", ["command_jet_us", "command_jet [us]", "command_jet [µs]", "command_jet [μs]"])
def test_microseconds_are_one_unit_however_log_and_vehicle_spell_them(tmp_path, header):
    from coadjoint.identification.commands import require_commands
    from coadjoint_vehicles import Craft, Vehicle
    from coadjoint_vehicles.parts import Thrusters

    log = read_log(written(tmp_path, f"time_s,u_m_s,{header}\n0,1,1500\n1,1,1600\n"))
    assert list(log.inputs["jet"]) == [1500, 1600]
    for unit in ("µs", "us"):
        jet = Thrusters("jet", "T200", positions=np.zeros((1, 3)), directions=np.eye(3)[:1], unit=unit)
        ball = Vehicle(name="ball", mass=4.0, inertia=np.ones(3), added_mass=np.ones(6), parts=(jet,))
        craft = Craft(ball)
        require_commands(craft.system, craft.start(), log, ())
        assert jet.no_signal == 0.0


def test_missing_inputs_keep_their_last_value_and_are_told(tmp_path):
    log = read_log(written(tmp_path, "time_s,u_m_s,rudder_rad\n0,1,0.1\n1,1,\n2,1,nan\n3,1,0.3\n"))
    assert np.allclose(log.inputs["rudder"], [0.1, 0.1, 0.1, 0.3])
    assert log.notes == ("2 of 4 values of rudder are missing and kept from before.",)


GOOD = "time_s,roll_deg,u_m_s,rudder_rad\n0,1,1,0\n1,2,1,0\n2,2,1,0\n"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "at least one line of numbers"),
        ("time_s,u_m_s\n0,1\n", "at least two samples"),
        ("u_m_s,w_m_s\n0,1\n1,2\n", "no column `time_s`"),
        (GOOD.replace("u_m_s", "u_parsec"), "line 1: column `u_parsec` has no known unit"),
        (GOOD.replace("u_m_s", "u_deg"), "`u` is measured in m/s"),
        (GOOD.replace("roll_deg", "roll"), "`roll` has no known unit at its end: give one, as in `roll_"),
        (GOOD.replace("rudder_rad", "rudder (furlong)"), "`rudder (furlong)` has no known unit"),
        (GOOD.replace("rudder_rad", "u_cm_s"), "`u` is given twice"),
        (GOOD.replace("2,2,1,0", "2,2,1"), "line 4: there are 3 cells for 4 columns"),
        (GOOD.replace("2,2,1,0", "2,two,1,0"), "line 4, column `roll_deg`: 'two' is not a number"),
        (GOOD.replace("2,2,1,0", "2,inf,1,0"), "line 4, column `roll_deg`: 'inf' is not a finite number: leave the"),
        (GOOD.replace("2,2,1,0", "1,2,1,0"), "line 4, column `time_s`: the time 1 s comes twice"),
        (GOOD.replace("2,2,1,0", ",2,1,0"), "line 4, column `time_s`: the time is missing"),
        (GOOD.replace("0,1,1,0", "0,1,1,"), "line 2, column `rudder_rad`: the first value"),
        (GOOD.replace("roll_deg", "qw"), "a quaternion needs qw, qx, qy and qz"),
        ("time_s,qw,qx,qy,qz\n0,1,0,0,0\n1,3,0,0,0\n", "length 1, but one has 3"),
        ("time_s,heading_deg,yaw_deg\n0,1,0\n1,3,0\n", "`yaw` says again"),
        ("time_s,depth_m,z_m\n0,1,0\n1,3,0\n", "`z` says again"),
        ("time_s,roll_deg,u_m_s\n0,,1\n1,,1\n", "`roll` holds no number"),
        (f"# simulated with dt_s = fine\n{GOOD}", "must be a positive number"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_file_is_told_with_its_place(tmp_path, text, told):
    with pytest.raises(FileError) as error:
        read_log(written(tmp_path, text))
    assert told in str(error.value) and "log.csv" in str(error.value)


def test_files_that_are_not_there_and_unknown_axes(tmp_path):
    with pytest.raises(FileError, match="There is no file"):
        read_log(tmp_path / "none.csv")
    with pytest.raises(ArgumentError, match="NED/FRD"):
        read_log(written(tmp_path, GOOD), axes="NWU")  # pyright: ignore[reportArgumentType]


def test_a_log_refuses_what_no_log_can_hold():
    t = np.arange(3.0)
    with pytest.raises(ArgumentError, match="must increase"):
        Log(t[::-1], {"u": t})
    with pytest.raises(ArgumentError, match="at least two samples"):
        Log(t[:1], {"u": t[:1]})
    with pytest.raises(ArgumentError, match="one number for each of 3 times"):
        Log(t, {"u": t[:2]})
    with pytest.raises(ArgumentError, match="`u` is infinite in sample 1, at 1 s: give NaN where a sensor was silent"):
        Log(t, {"u": np.array([0, np.inf, 0])})
    with pytest.raises(ArgumentError, match="`screws` is infinite in sample 2, at 2 s: give what was commanded"):
        Log(t, {"u": t}, {"screws": np.array([[0, 0], [0, 0], [0, -np.inf]])})
    with pytest.raises(ArgumentError, match="Times of a log must be finite, but sample 2 is at inf s"):
        Log(np.array([0, 1, np.inf]), {"u": t})
    with pytest.raises(ArgumentError, match="must have no gaps"):
        Log(t, {"u": t}, {"rudder": np.array([0, np.nan, 0])})


def test_a_column_that_is_missing_among_several_commands_is_named(tmp_path):
    path = tmp_path / "log.csv"
    whole = ["command_thrusters[1]_N", "command_thrusters[2]_N", "command_thrusters[3]_N"]
    for missing in (0, 1):
        path.write_text(",".join(["time_s", *(name for name in whole if name != whole[missing])]) + "\n0,1,2\n1,1,2\n")
        with pytest.raises(FileError, match=rf"`command_thrusters\[{missing + 1}\]` is missing"):
            read_log(path)
    path.write_text(",".join(["time_s", *whole[:2], "thrusters[3]_N"]) + "\n0,1,2,3\n1,1,2,3\n")
    with pytest.raises(FileError, match=r"`command_thrusters\[3\]` is missing"):
        read_log(path)


def test_columns_are_ignored_by_name_and_those_that_are_not_there_are_told(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time_s,u_m_s,battery_V\n0,1,12\n1,1,12\n")
    assert not read_log(path, ignore=["battery"]).inputs
    assert not read_log(path, ignore=["battery_V"]).inputs
    with pytest.raises(FileError, match="no column `batt`"):
        read_log(path, ignore=["batt"])


@pytest.mark.parametrize("header", ["u", "u_furlong"])
def test_a_speed_without_a_unit_is_told_one_of_speeds(tmp_path, header):
    path = tmp_path / "log.csv"
    path.write_text(f"time_s,{header}\n0,1\n1,1\n")
    with pytest.raises(FileError, match="as in `u_m_s`"):
        read_log(path)


def headings(step, noise=0.02):
    """Radians over ten turns, with gaps: wrapped to [0, 2π), to [−π, π), and counting turns."""
    random = np.random.default_rng(1)
    whole = 3.0 + np.cumsum(np.full(400, step))
    measured = whole + noise * random.normal(size=400)
    found = [measured % (2 * np.pi), (measured + np.pi) % (2 * np.pi) - np.pi, measured]
    for values in found:
        values[random.random(400) < 0.3] = np.nan
    return found


@pytest.mark.parametrize("step", [0.16, -0.16, 0.9, 2.0])
def test_a_heading_in_degrees_that_is_declared_as_radians_is_told_and_one_in_radians_never(step):
    t = 0.1 * np.arange(400)
    for k, values in enumerate(headings(step)):
        assert Log(t, {"heading": values}).notes == ()
        if abs(step) < 0.4:
            degrees = Log(t, {"heading": np.degrees(values), "u": t}).notes
            assert len(degrees) == (k < 2) and all("`heading` jumps by 360" in one for one in degrees)
    seldom = np.where(np.arange(400) % 3 == 0, np.degrees(3.0 + 0.05 * np.arange(400)) % 360, np.nan)
    assert len(Log(t, {"heading": seldom}).notes) == 1
    (told,) = Log(t, {"dial": np.degrees(headings(0.16)[0])}, units={"dial": "rad"}).notes
    assert "`dial_deg`" in told and Log(t, {"dial": np.degrees(headings(0.16)[0])}).notes == ()


def test_a_heading_in_degrees_in_a_file_is_told_where_its_header_says_radians(tmp_path):
    rows = "".join(f"{0.1 * k:g},{(300 + 2 * k) % 360},-4\n" for k in range(100))
    with pytest.warns(UserWarning, match="`heading` jumps by 360"):
        (told,) = read_log(written(tmp_path, f"time_s,heading_rad,w_m_s\n{rows}")).notes
    assert told.startswith("`heading` jumps by 360") and "heading_deg" in told
    assert read_log(written(tmp_path, f"time_s,heading_deg,w_m_s\n{rows}")).notes == ()


def test_a_pitch_beyond_every_euler_angle_is_told_and_outliers_are_not_taken_for_degrees():
    t, pitch = 0.1 * np.arange(400), 0.3 * np.sin(0.1 * np.arange(400))
    (told,) = Log(t, {"pitch": np.degrees(pitch)}).notes
    assert "`pitch` goes beyond 3.14 rad" in told and Log(t, {"pitch": pitch}).notes == ()
    pitch[::150] = [40.0, 41.0, 42.0]
    (told,) = Log(t, {"pitch": pitch}).notes
    assert told.startswith("`pitch` is 42 in row 301") and "2 more like it" in told
    pitch[::150] = 40.0
    (told,) = Log(t, {"pitch": pitch}).notes
    assert told.startswith("`pitch` is 40 in 3 rows")


def swaying() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, an angle and its rate, with noise and without some samples of the angle."""
    random, t = np.random.default_rng(2), 0.1 * np.arange(400)
    turned = 0.3 + 0.2 * np.sin(0.6 * t) + 2e-3 * random.normal(size=400)
    turned[random.random(400) < 0.2] = np.nan
    return t, turned, 0.12 * np.cos(0.6 * t) + 0.01 * random.normal(size=400)


@pytest.mark.parametrize(("angle", "rate"), [("roll", "p"), ("heading", "r"), ("pitch", "q")])
@pytest.mark.parametrize("of_angle", [1, 180 / np.pi, np.pi / 180])
@pytest.mark.parametrize("of_rate", [1, 180 / np.pi, np.pi / 180, -1])
def test_an_angle_that_turns_57_times_as_fast_or_slowly_as_its_rate_says_is_told(angle, rate, of_angle, of_rate):
    t, turned, turning = swaying()
    log = Log(t, {angle: of_angle * turned, rate: of_rate * turning, "u": t})
    ratio = of_angle / abs(of_rate)
    told = [one for one in log.notes if "some 57 times" in one]
    if angle == "pitch" and of_angle > 1:
        assert "`pitch` goes beyond 3.14 rad" in log.notes[0] and told == []
    elif 50 < ratio < 60:
        assert len(told) == 1 and f"`{angle}` looks like degrees read as radians" in told[0] and "as fast" in told[0]
    elif 50 < 1 / ratio < 60:
        assert len(told) == 1 and f"`{rate}` looks like degrees read as radians" in told[0] and "as slowly" in told[0]
    else:
        assert log.notes == ()
    assert log.between(5, 30).notes == log.notes


def test_rates_of_noise_across_gaps_late_or_of_a_banked_turn_are_not_doubted():
    random, t = np.random.default_rng(3), 0.1 * np.arange(600)
    for seed in range(20):
        random = np.random.default_rng(seed)
        wander = np.cumsum(0.02 * random.normal(size=600)) * 0.1
        for gap in (0.0, 60.0, 600.0):
            times = np.where(np.arange(600) < 300, t, t + gap)
            turned = np.cumsum(wander * np.gradient(times)) + 2e-3 * random.normal(size=600)
            for noise in (0.0, 0.02, 0.35):
                log = Log(times, {"heading": turned, "r": wander + noise * random.normal(size=600)})
                assert log.notes == ()
    late = {"heading": 0.3 * np.sin(3 * t), "r": 0.9 * np.cos(3 * (t - 1.0))}
    assert Log(t, late).notes == ()
    pitch, phi = 0.4 - 0.01 * t, 0.6
    rate = 0.3 * np.cos(pitch)
    banked = {
        "roll": np.full(600, phi), "pitch": pitch, "heading": 0.3 * t, "p": -0.3 * np.sin(pitch),
        "q": -0.01 * np.cos(phi) + rate * np.sin(phi), "r": 0.01 * np.sin(phi) + rate * np.cos(phi),
    }  # fmt: skip
    assert Log(t, banked).notes == ()


def test_depths_above_the_surface_are_told_and_a_vehicle_that_floats_is_not(tmp_path):
    t, dive = 0.1 * np.arange(400), 10 - 10 * np.cos(0.02 * np.arange(400))
    (told,) = Log(t, {"depth": -dive}).notes
    assert "Most of `depth` is above the surface: it is positive down" in told and "`up_m`" in told
    assert Log(t, {"depth": np.where(np.arange(400) % 2 == 0, -dive, np.nan)}).notes == (told,)
    for depth in (dive, 0.4 * np.sin(t), np.where(t < 5, -20.0, dive)):
        assert Log(t, {"depth": depth}).notes == ()
    rows = "".join(f"{a:g},{b:g}\n" for a, b in zip(t, -dive, strict=True))
    with pytest.warns(UserWarning, match="Most of `depth` is above the surface"):
        assert len(read_log(written(tmp_path, f"time_s,depth_m\n{rows}")).notes) == 1
    assert read_log(written(tmp_path, f"time_s,up_m\n{rows}")).notes == ()
    assert read_log(written(tmp_path, f"time_s,z_m\n{rows}"), axes="ENU/FLU").notes == ()


def test_a_part_of_a_log_has_its_notes_once():
    t = 0.1 * np.arange(100)
    log = Log(t, {"depth": -5 - t, "pitch": np.full(100, 4.0)}, notes=("Rain.",))
    assert len(log.notes) == 3 and log.between(2.0, 8.0).notes == log.notes


WRONG = {
    "columns": ({"columns": [1, 2]}, "`columns` of a log must be by names, but is"),
    "inputs": ({"inputs": None}, "`inputs` of a log must be by names, but is None"),
    "texts": ({"columns": {"u": ["0", "1", "2"]}}, "`u` of a log must hold numbers"),
    "dates": ({"time": np.arange("2026-01-01", "2026-01-04", dtype="datetime64[D]")}, "`time` of a log must hold num"),
    "complex": ({"columns": {"u": np.array([0, 1j, 2])}}, "`u` of a log must hold numbers"),
    "one number": ({"columns": {"u": 1.0}}, "`u` must have one number for each of 3 times"),
    "short": ({"actual": {"rudder": [0.0]}}, r"`actual\['rudder'\]` must have one number for each of 3 times"),
    "gap": ({"actual": {"rudder": [0.0, np.nan, 0]}}, r"^`actual\['rudder'\]` is missing at 1 s"),
    "infinite": ({"actual": {"rudder": [0.0, 0, np.inf]}}, r"`actual\['rudder'\]` is infinite in sample 2, at 2 s"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_part_of_a_log_is_told(case):
    change, told = WRONG[case]
    t = np.arange(3.0)
    with pytest.raises(ArgumentError, match=told):
        Log(**{"time": t, "columns": {"u": t}, "inputs": {"rudder": t}, **change})
    assert Log(t, {"u": t}, {"rudder": t}, actual={"rudder": [0, 1, 2]}).first("rudder") == 0.0


@pytest.mark.parametrize("name", ["log.nc", "log.bag", "log.xlsx", "log"])
def test_a_log_is_not_written_under_the_name_of_another_format(tmp_path, name):
    with pytest.raises(ArgumentError, match=r"written as \.csv or \.mcap, but the name of .* ends otherwise"):
        write_log(Log(np.arange(3.0), {"u": np.arange(3.0)}), tmp_path / name)
    assert not (tmp_path / name).exists()


def test_a_name_of_no_known_format_is_not_read_as_a_table(tmp_path):
    path = tmp_path / "dive.drift"
    path.write_text("drift 1\n0 1.0\n")
    words = (
        r"dive\.drift has a name of no format that is known: name a table \.csv or \.txt; others are \.mcap, \.db3, "
    )
    with pytest.raises(FileError, match=words):
        read_log(path)
