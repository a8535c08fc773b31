"""Mission files: a vehicle, its water, its controller and its legs, from one TOML to results."""

from __future__ import annotations

import csv
import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

import coadjoint as co
from coadjoint.cli.main import main
from coadjoint.errors import ArgumentError, CoadjointError, FileError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.plotting.plots import figure_names
from coadjoint.runs.run_file import read
from coadjoint_vehicles.files.kinds import kinds
from coadjoint_vehicles.missions import results
from coadjoint_vehicles.missions.craft import set_up
from coadjoint_vehicles.missions.example import example
from coadjoint_vehicles.missions.file import MissionFile, from_table
from coadjoint_vehicles.missions.mission_section import ENDS
from coadjoint_vehicles.missions.sections import MissionOutputSection
from coadjoint_vehicles.missions.summary import mission_summary
from coadjoint_vehicles.missions.water import CURRENTS, DENSITIES, PROFILES, water

MISSION = """
[vehicle]
name = "remus_100"

[water]
velocity_m_s = [0.0, 0.2, 0.0]

[mission]
time_s = [0, 5]
depth_m = [1.0, 2.0]
heading_deg = [0, 40]
speed_m_s = 1.5

[initial]
speed_knots = 3
position_m = [0, 0, 0.5]
actuators = { propeller_rpm = 900 }

[run]
dt = 0.05
duration = 10
save_every = 4

[output]
figures = ["track"]
animation = "html"
"""


LEVEL = {"depth_m": 3, "heading": 0, "speed": 1.5}
ENU = {"axes": "ENU/FLU", "initial": {}, "mission": {"depth_m": 3, "yaw_deg": 90, "speed": 1.5}}
FLEET = {"run": {"dt": 0.1, "steps": 2, "members": 20}}


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def mission(**sections):
    """The mission file with some sections replaced, or left out with None."""
    table = {**tomllib.loads(MISSION), **sections}
    return from_table({name: part for name, part in table.items() if part is not None}, Path("dive.toml"), "")


@pytest.mark.long
def test_a_mission_is_swum_and_leaves_trajectory_log_figures_and_summary(tmp_path, capsys):
    Path("dive.toml").write_text(MISSION)
    assert main(["run", "dive.toml", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    folder = tmp_path / "dive"
    assert {path.name for path in folder.iterdir()} == {
        "manifest.json",
        *("run.toml", "trajectory.nc", "trajectory.csv", "summary.json", "track.png", "animation.html"),
    }
    data = co.load(folder / "trajectory.nc").dataset
    found = told["mission"]
    assert json.loads((folder / "summary.json").read_text()) == told
    assert found["depth_max"] == pytest.approx(float(data.q[:, 2].max()))
    assert found["path_length"] == pytest.approx(float(np.linalg.norm(np.diff(data.q, axis=0), axis=1).sum()))
    assert found["energy_put_in"]["propeller"] == pytest.approx(float(data.work_propeller[-1]))
    depth_error = data.inputs_depth.values - data.q.values[:, 2]
    assert found["tracking"]["depth"]["error_rms"] == pytest.approx(np.sqrt(np.mean(depth_error**2)))
    assert found["times_real_time"] == pytest.approx(10 / told["seconds"])
    assert float(data.inputs_heading[-1]) == pytest.approx(np.radians(40))
    assert float(data.internal_propeller[0]) == 15.0
    assert np.allclose(data.current, [0, 0.2, 0])
    assert found["save_every"] == 4
    assert main(["plot", "dive", "--out", "again"]) == 0
    assert [path.name for path in Path("again").iterdir()] == ["track.png"]
    capsys.readouterr()
    with open(folder / "trajectory.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]["depth_m"]) == pytest.approx(float(data.q[-1, 2]))
    assert main(["run", "dive.toml"]) == 0
    assert "nothing was run" in capsys.readouterr().out
    assert np.allclose(data.q[-1], by_hand().final.q, atol=1e-9)


def by_hand():
    """The same mission in Python."""
    import coadjoint_vehicles as vehicles
    from coadjoint_vehicles import Craft, water

    vehicle = vehicles.load("remus_100")
    craft = Craft(vehicle, controller=vehicle.controller, water=water.UniformWater((0.0, 0.2, 0.0)))
    start = craft.start(position=(0, 0, 0.5), speed=3 * 1852 / 3600, actuators={"propeller": 15.0})
    legs = [0.0, 5.0]
    inputs = {"depth": co.Held(legs, [1.0, 2.0]), "heading": co.Held(legs, np.radians([0.0, 40.0])), "speed": 1.5}
    return co.simulate(craft.system, start, dt=0.05, duration=10, inputs=inputs)


def test_a_mission_with_a_byte_order_mark_is_the_same_mission(tmp_path):
    for encoding in ("utf-8", "utf-8-sig"):
        (tmp_path / f"{encoding}.toml").write_text(MISSION, encoding=encoding)
    plain, marked = (read(tmp_path / f"{encoding}.toml") for encoding in ("utf-8", "utf-8-sig"))
    assert marked.text == plain.text and marked.run == plain.run


@pytest.mark.parametrize("digits", [401, 5000])
@pytest.mark.parametrize("key", ["duration = 10", "speed_knots = 3"])
def test_numbers_of_hundreds_of_digits_are_refused(key, digits, tmp_path):
    path = tmp_path / "long.toml"
    path.write_text(MISSION.replace(key, f"{key.split(' = ')[0]} = {digits * '9'}"))
    with pytest.raises(FileError, match="holds a number that is too long to be read"):
        read(path)


def test_a_start_in_east_north_up_is_the_same_start():
    alone = {"controller": {"kind": "none"}, "mission": None}
    given = {"position_m": [1, 2, 3], "speed": 1.0, "heading_deg": 30, "pitch_deg": 10}
    ned = set_up(mission(initial=given, **alone)).start
    given = {"axes": "ENU/FLU", "position_m": [2, 1, -3], "speed": 1.0, "yaw_deg": 60, "pitch_deg": -10}
    enu = set_up(mission(initial=given, **alone)).start
    assert np.allclose(ned.g, enu.g)
    assert np.allclose(ned.n, enu.n)
    assert np.allclose(ned.nu, enu.nu)


@pytest.mark.long
def test_a_mission_in_east_north_up_is_the_same_mission():
    tide = {"kind": "tidal", "constituents": ["M2"]}
    ned = mission(
        initial={"position_m": [1, 2, 3], "speed": 1.0, "heading_deg": 30, "pitch_deg": 10},
        water={
            "drift": {"velocity": [0.1, 0.2, 0.03]},
            "tide": {**tide, "amplitudes": [[0.1, 0.2, 0.01]], "phases": [[1, 2, 3]]},
        },
        mission={"way_points_m": [[40, 10, 5], [60, 60, 8]], "speed": 1.5, "ends": "bottom", "bottom_m": 30},
    )
    enu = mission(
        axes="ENU/FLU",
        initial={"position_m": [2, 1, -3], "speed": 1.0, "yaw_deg": 60, "pitch_deg": -10},
        water={
            "drift": {"velocity": [0.2, 0.1, -0.03]},
            "tide": {**tide, "amplitudes": [[0.2, 0.1, -0.01]], "phases": [[2, 1, 3]]},
        },
        mission={"way_points_m": [[10, 40, -5], [60, 60, -8]], "speed": 1.5, "ends": "bottom", "bottom_m": 30},
    )
    runs = []
    for made in map(set_up, (ned, enu)):
        assert made.attributes["way_points"] == [40, 10, 5, 60, 60, 8]
        runs.append(co.simulate(made.system, made.start, dt=0.1, duration=20, inputs=made.inputs))
    assert np.linalg.norm(runs[0].final.q - [1, 2, 3]) > 10
    assert np.allclose(runs[0].final.q, runs[1].final.q, rtol=0, atol=1e-9)
    legs = {"depth_m": 3, "speed": 1.5, "time_s": [0, 5]}
    turns = mission(mission={**legs, "heading_deg": [0, 40]})
    left = mission(axes="ENU/FLU", initial={}, mission={**legs, "yaw_deg": [90, 50]})
    assert np.allclose(*(set_up(file).inputs["heading"].values for file in (turns, left)))


TO_A_POINT = {"way_points_m": [[90, 2, 3]], "speed": 1}


@pytest.mark.cases(27)
@pytest.mark.parametrize(
    ("sections", "words"),
    [
        ({"vehicle": {"name": "remus_10"}}, "did you mean `remus_100`"),
        ({"vehicle": {"name": "remus_100", "file": "mine.toml"}}, "either `name`"),
        ({"vehicle": {"file": "mine.toml"}}, "no file mine.toml"),
        ({"missions": {}}, "did you mean `mission`"),
        ({"run": None}, "needs a section \\[run\\]"),
        ({"run": {"dt": 0.1, "duration": 1, "member": 3}}, "did you mean `members`"),
        ({"run": {"dt": 0.1, "duration": 1, "members": 3}}, "needs a section \\[perturb\\]"),
        ({"mission": {"depth_m": 3, "speed_m_s": 1}}, "needs `heading` \\(rad\\)"),
        ({"mission": {"depth_m": 3, "depth_km": 3}}, "gives `depth` twice"),
        ({"mission": {"depht_m": 3, "heading": 0, "speed": 1}}, "did you mean `depth`"),
        ({"mission": {"depth_s": 3, "heading": 0, "speed": 1}}, "measures m, but `depth_s` is in s"),
        ({"mission": {"depth": 3, "heading": 0, "speed": 1, "bottom_s": 40}}, "unit of time, but `bottom` measures"),
        ({"mission": {**TO_A_POINT, "acceptance_radius_s": 4}}, "unit of time, but `acceptance_radius` measures"),
        ({"mission": {**TO_A_POINT, "look_ahead_kg": 4}}, "unit of mass, but `look_ahead` measures length"),
        ({"mission": {"way_points_s": [[90, 2, 3]], "speed": 1}}, "unit of time, but `way_points` measures length"),
        ({"mission": {"depth_m": "deep", "heading": 0, "speed": 1}}, "must hold finite numbers"),
        ({"mission": {"time_s": [0, 1], "depth_m": [3, 4, 5], "heading": 0, "speed": 1}}, "each of 2 times"),
        ({"mission": {"depth_m": [3, 4], "heading": 0, "speed": 1}}, "needs `time_s`"),
        ({"mission": {"depth": 3, "heading": 0, "speed": 1, "ends": "surfaces"}}, "did you mean `surface`"),
        ({"mission": {"depth": 3, "heading": 0, "speed": 1, "ends": ["bottom"]}}, "needs `bottom`"),
        ({"mission": {"way_points_m": [[1, 2]], "speed": 1}}, "must hold \\[north, east, depth\\]"),
        ({"mission": {"way_points_m": [[9, 2, 3]], "speed": 1, "depth": 3}}, "no set point `depth`"),
        (
            {"mission": {"depth": 3, "heading": 0, "speed": -1}},
            "`speed` is -1 m/s at t = 0 s, but the controller `Cruise` drives ahead only",
        ),
        ({"mission": {**TO_A_POINT, "speed": [1, -2], "time_s": [0, 5]}}, "`speed` is -2 m/s at t = 5 s, but"),
        (
            {"mission": {**TO_A_POINT, "ends": "last way point", "acceptance_m": 200}},
            "from \\[initial\\], within 200 m",
        ),
        ({"mission": {"look_ahead_m": 3, "depth": 3, "heading": 0, "speed": 1}}, "belongs to `way_points_m`"),
        ({"mission": {"depth": 3, "heading": 0, "speed": 1, "ends": "last way point"}}, "needs `way_points`"),
        ({"controller": {"mixing": [1, 2]}}, "no key `mixing`: it is called `allocation`"),
        ({"initial": {"position_m": [0, 0]}}, "position"),
        ({"initial": {"axes": "ENU/FLU", "heading_deg": 3}}, "belongs to NED/FRD"),
        ({"initial": {"actuators": {"ruder_deg": 3}}}, "no actuator"),
        ({"initial": {"actuators": 3}}, "must be a table"),
        ({"initial": {"actuators": {"rudder_deg": "x"}}}, "must hold numbers"),
        ({"initial": {"actuators": {"rudder_m": 3}}}, "measures rad, but `rudder_m` is in m"),
        ({"initial": {"actuators": {"rudder_deg": 3, "rudder": 3}}}, "give `rudder` twice"),
        ({"mission": {"time_s": 5, "depth_m": [3, 4], "heading": 0, "speed": 1}}, "each of 1 times"),
        ({"mission": {"file": 3}}, "must be a text"),
        ({"mission": {"depth": 3, "heading": 0, "speed": 1, "ends": 3}}, "no end `3`"),
        ({"mission": {"way_points_m": [[9, 2, 3]], "speed": 1, "acceptance_m": [1, 2]}}, "must be a number, but is"),
        ({"mission": {**LEVEL, "ends": "bottom", "bottom_m": 0.4}}, "a depth of 0.4 m, but \\[initial\\] is at 0.5 m"),
        ({"mission": {**LEVEL, "ends": "surface"}, "initial": {"position_m": [0, 0, -2]}}, "is 2 m above it"),
        ({"mission": {**LEVEL, "bottom_m": 30}}, 'belongs to ends = "bottom"'),
        ({"axes": 3}, '"NED/FRD" or "ENU/FLU", but is 3'),
        ({"axes": "END/FRD"}, '"NED/FRD" or "ENU/FLU", but is'),
        ({"initial": {"axes": "END/FRD", "heading_deg": 3}}, '"NED/FRD" or "ENU/FLU", but is'),
        ({"mission": {**LEVEL, "axes": "ENU/FLU"}}, "above all sections"),
        ({"axes": "ENU/FLU", "initial": {}, "mission": LEVEL}, "heading belongs to NED/FRD"),
        ({"parameters": {"mass": -3}}, "`parameters.mass` must be positive"),
        ({"parameters": {"rudder": {"lift_slope": 0}}}, "`parameters.lift_slope` of the fin `rudder` must be positive"),
        ({**FLEET, "perturb": {"mass": "200 %"}}, r"Of member \d+: Argument `mass` must be positive"),
        ({**FLEET, "perturb": {"mass": 0.1}, "mission": {**LEVEL, "ends": "surface"}}, "ends would end each"),
        ({**FLEET, "perturb": {"mass": "nan %"}}, "must be finite"),
        ({"parameters": {"rudder": {"limit_kg": 1}}}, "unit of mass, but `limit` measures angle"),
        ({"controller": {"heading_reach_m": 1}}, "unit of length, but `heading_reach` measures angle"),
        ({"run": {"dt": 1, "steps": 1, "members": 2}, "perturb": {"mass_m": 1}}, "`mass` measures mass"),
        ({"controller": {"kind": "cruse"}}, "did you mean `cruise`"),
        ({"controller": {"periods": 1}}, "did you mean `period`"),
        ({"controller": {"kind": "none"}}, "no set point `depth`"),
        ({"parameters": {"rudder": {"aera": 1}}}, "did you mean `area`"),
        ({"parameters": {"rudder_limit_deg": 9}}, "`rudder_limit_deg` is called `rudder.limit`"),
        ({"parameters": {"pilot_period": 0.1}}, "`pilot_period` is called `controller.period`"),
        ({"parameters": {"rudder": 0.1}}, "rudder is several numbers"),
        ({"parameters": {"rudder": {"lag": -0.1}}}, "`parameters.lag` of the fin `rudder` must be at least 0"),
        (
            {"run": {"dt": 0.05, "duration": 5, "members": 4}, "perturb": {"rudder": {"lag": 9.0}}},
            "Of member .: .*`lag` of the fin `rudder`",
        ),
        ({"water": {"kind": "tidel"}}, "did you mean `tidal`"),
        ({"water": {"velocty": [0, 0, 0]}}, "did you mean `velocity`"),
        ({"water": {"velocity_deg": [0, 0, 0]}}, "unit of angle"),
        ({"water": {"velocity": [0, 0, 0], "drift": {"velocity": [0, 0, 0]}}}, "next to tables"),
        (
            {"water": {"kind": "gauss_markov", "deviation_deg": [0, 1, 0], "correlation_time": 9}},
            "unit of angle, but `deviation` measures speed",
        ),
        ({**ENU, "water": {"velocity": [[1], [2, 3]]}}, "`water.velocity`"),
        ({"water": {"kind": "tidal"}}, "needs `constituents`, `amplitudes`"),
        ({"output": {"animation": "mp4"}}, '"gif" or "html"'),
    ],
)
def test_a_mistake_is_told_in_one_sentence(sections, words):
    with pytest.raises(CoadjointError, match=words) as caught:
        set_up(mission(**sections))
    assert "\n" not in str(caught.value)


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("parameters.mass=-15", "`parameters.mass` must be positive"),
        ("parameters.mass=nan", "must be finite"),
        ("parameters.center_of_buoyancy=[0, 0, 1e12]", "must be a point of the vehicle"),
        ("mission.heading_deg=1800000", "5000 turns"),
        ("initial.heading_deg=1800000", "5000 turns"),
    ],
)
def test_a_check_of_a_mission_refuses_what_its_run_refuses(change, words, capsys):
    Path("dive.toml").write_text(MISSION)
    for more in (["--check"], []):
        assert main(["run", "dive.toml", *more, "--set", change]) == 2
        assert words in capsys.readouterr().err
    assert not Path("dive").exists()


def test_a_check_of_a_mission_warns_of_steps_longer_than_the_period_of_its_controller(capsys):
    Path("dive.toml").write_text(MISSION.replace("duration = 10", "steps = 10"))
    assert main(["run", "dive.toml", "--check", "--set", "run.dt=5"]) == 0
    assert "looks every 0.1 s, but a step takes 5 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("method.name=Midpiont", "did you mean `Midpoint`"),
        ("method.map=Cayly", "did you mean `Cayley`"),
        ("method.name=VariableStep", "use a fixed step"),
        ("method.name=Suzuki4", "substeps that go backwards"),
    ],
)
def test_a_method_that_does_not_fit_is_refused_before_the_mission(change, words, capsys):
    Path("dive.toml").write_text(MISSION.replace("duration = 10", "steps = 10"))
    assert main(["run", "dive.toml", "--check", "--set", change]) == 2
    assert words in capsys.readouterr().err


def test_a_file_of_another_kind_is_told_with_the_command_that_takes_it(capsys):
    from coadjoint_vehicles.files.registry import vehicle_text

    Path("mine.toml").write_text(vehicle_text("remus_100"))
    Path("dive.toml").write_text(MISSION)
    Path("empty.toml").write_text("# nothing\n")
    for given, words in (
        (["run", "mine.toml"], "`coadjoint vehicles show mine.toml`"),
        (["vehicles", "show", "dive.toml"], "`coadjoint run dive.toml`"),
        (["run", "empty.toml"], "is empty"),
        (["vehicles", "show", "empty.toml"], "is empty"),
    ):
        assert main(given) == 2
        assert words in capsys.readouterr().err


def test_units_of_parameters_are_those_that_they_measure():
    given = {
        "propeller": {"limit_rpm": 900},
        "rudder": {"limit_deg": 20},
        "center_of_mass_mm": [0, 0, 20],
        "controller": {"period_ms": 100},
    }
    found = set_up(mission(parameters=given)).system.parameters
    assert found.propeller.limit == pytest.approx(15.0)
    assert found.rudder.limit == pytest.approx(np.radians(20))
    assert found.center_of_mass == pytest.approx([0, 0, 0.02])
    assert found.controller.period == pytest.approx(0.1)


def of_water(table):
    return water(table, "NED/FRD", Path)


def test_every_kind_of_current_can_be_said(tmp_path):
    (tmp_path / "c.csv").write_text("depth,north,east\n0,0.3,0\n20,0.1,0\n")
    tables = {
        "uniform": {"velocity_cm_per_s": [30, 0, 0]},
        "shear": {"kind": "shear", "surface": [0.3, 0, 0], "gradient": [-0.01, 0, 0]},
        "sheared": {"kind": "sheared", "surface": [0.3, 0, 0], "profile": {"kind": "power_law", "bottom_m": 40}},
        "tidal": {"kind": "tidal", "constituents": ["M2"], "amplitudes": [[0.3, 0, 0]]},
        "gauss_markov": {
            "kind": "gauss_markov",
            "deviation": [0, 0.1, 0],
            "correlation_time_min": 1,
            "mean": [0.3, 0, 0],
        },
        "table": {"kind": "table", "file": "c.csv"},
    }
    assert set(tables) == set(CURRENTS)
    for kind, table in tables.items():
        found = of_water(table)
        own = co.Parameters(**found.parameters())
        memory = co.Parameters(**found.start()) if found.start() else None
        north, _, _ = evaluate(found.current, np.zeros(3), 0.0, memory, own)
        assert north == pytest.approx(0.3), kind
    both = {"mean": tables["uniform"], "tide": tables["tidal"], "density": {"kind": "linear", "surface": 1025.0}}
    sea = of_water(both)
    own = co.Parameters(**sea.parameters())
    assert evaluate(sea.current, np.zeros(3), 0.0, None, own)[0] == pytest.approx(0.6)
    assert evaluate(sea.density, 0.0, own) == 1025.0


@pytest.mark.long
def test_a_mission_that_surfaces_ends_there(tmp_path, capsys):
    Path("up.toml").write_text(MISSION.replace("depth_m = [1.0, 2.0]", 'depth_m = [0.5, -2.0]\nends = "surface"'))
    assert main(["run", "up.toml", "--set", "output.figures=false", "--set", "run.duration=60", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert 5 < told["event"] < 60
    assert told["complete"]
    assert told["mission"]["ended_by"] == "surface"
    assert abs(told["mission"]["position_final"][2]) < 0.2


@pytest.mark.long
def test_a_vehicle_that_leaves_the_water_is_warned_of(capsys):
    given = ["--set", "initial.position_m=[0, 0, -0.5]", "--set", "initial.pitch_deg=40"]
    quick = ["--set", "run.duration=2", "--set", "output.figures=false", "--set", "output.animation="]
    Path("up.toml").write_text(MISSION)
    assert main(["run", "up.toml", *given, *quick, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert any("leaves the water" in sentence for sentence in told["warnings"])
    assert "leaves the water" in told["card"]
    more = ["--set", "run.members=3", "--set", "perturb.mass=0.01", "--out", "three"]
    assert main(["run", "up.toml", *given, *quick, *more, "--json"]) == 0
    assert "3 members leave the water" in json.loads(capsys.readouterr().out)["card"]
    depth, length = co.load("up/trajectory.nc").dataset.q.values[:, 2], 1.33
    assert np.min(depth) < -length


@pytest.mark.long
def test_way_points_are_reached_in_turn_and_the_last_one_ends_the_mission(capsys):
    square = Path(__file__).parents[3] / "examples" / "square.toml"
    assert main(["run", str(square), "--out", "square", "--set", "output.figures=false", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    data = co.load("square/trajectory.nc").dataset
    points = np.reshape(data.attrs["way_points"], (-1, 3))
    assert points.tolist() == [[60, 0, 3], [60, 60, 6], [0, 60, 3], [0, 0, 1]]
    gaps = np.linalg.norm(data.q.values[:, None, :2] - points[None, :, :2], axis=2)
    legs = data.internal_controller_value_memory_leg.values
    assert np.all(np.isin(np.diff(legs), (0, 1)))
    assert legs[-1] == 3
    for leg in range(3):
        assert gaps[np.argmax(legs > leg), leg] < 3.1
    assert told["event"] == pytest.approx(float(data.time[-1]))
    assert gaps[-1, -1] == pytest.approx(3.0, abs=1e-6)
    assert told["mission"]["tracking"]["path"]["error_rms"] < 2.5


@pytest.mark.long
def test_members_differ_as_they_were_told_to_and_are_summed_up(tmp_path, capsys, monkeypatch):
    more = '[perturb]\nseed = 3\nmass = 0.5\nhull.axial_drag = "10 %"\n'
    Path("fleet.toml").write_text(MISSION.replace("duration = 10", "duration = 5\nmembers = 40") + more)
    assert main(["run", "fleet.toml", "--set", "output.figures=false", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert Path("fleet/animation.html").stat().st_size > 1000
    assert "the animation shows 8 of the members" in told["notes"][0]
    with open("fleet/members.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert (told["members"], told["finished"], len(rows)) == (40, 40, 40)
    mass = np.array([float(row["mass"]) for row in rows])
    drag = np.array([float(row["hull.axial_drag"]) for row in rows])
    low, high = chi2.ppf([5e-4, 1 - 5e-4], 39)
    for values, deviation in ((mass, 0.5), (drag, 0.042)):
        assert low < 39 * np.var(values, ddof=1) / deviation**2 < high
    data = co.load("fleet/trajectory.nc").dataset
    single = mission_summary(data.isel(member=7))
    assert float(rows[7]["path_length"]) == pytest.approx(single["path_length"])
    lengths = [float(row["path_length"]) for row in rows]
    assert told["mission"]["path_length"]["50%"] == pytest.approx(np.median(lengths))
    assert np.allclose(set_up(read("fleet.toml")).system.parameters.mass.values, mass)
    monkeypatch.setattr(results, "save_figures", lambda datasets, folder, names, ending: names)
    output = MissionOutputSection(figures=True)
    drawn = results.figures(output, Path("fleet"), data)
    assert drawn == results.figures(output, Path("fleet"), data.isel(member=0))
    assert {"mission", "track", "actuators", "budget"} <= set(drawn)


@pytest.mark.long
def test_too_many_members_for_a_file_are_refused_with_a_remedy():
    run = {"dt": 0.05, "duration": 300, "members": 10_000}
    with pytest.raises(ArgumentError, match=r"save_every = \d+ or more"):
        set_up(mission(run=run, perturb={"mass": 0.1}))


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["remus_100", "bluerov2_heavy_blue", "slocum_graver", "ono_fiori_peng"])
def test_the_example_of_a_vehicle_can_be_run(name, tmp_path):
    Path("example.toml").write_text(example(name))
    assert main(["run", "example.toml", "--check"]) == 0


@pytest.mark.long
def test_a_mission_is_resumed_from_its_folder_alone(tmp_path, monkeypatch):
    legs = "time_s,depth_m,heading_deg,speed_m_s\n0,1,0,1.5\n5,2,40,1.5\n"
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "legs.csv").write_text(legs)
    text = MISSION[: MISSION.index("[mission]")] + '[mission]\nfile = "tables/legs.csv"\n\n'
    Path("dive.toml").write_text(text + MISSION[MISSION.index("[initial]") :])
    import coadjoint.simulation.driver as driver

    whole = driver.Driver.drive

    def interrupted(self, position):
        whole(self, position)
        raise KeyboardInterrupt

    monkeypatch.setattr(driver.Driver, "drive", interrupted)
    assert main(["run", "dive.toml"]) == 130
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tables" / "legs.csv").unlink()
    assert main(["resume", "dive"]) == 0
    data = co.load("dive/trajectory.nc").dataset
    assert float(data.time[-1]) == pytest.approx(10)
    assert float(data.inputs_heading[-1]) == pytest.approx(np.radians(40))
    with pytest.raises(FileError, match=r"legs\.csv"):
        _ = read("dive.toml").inputs


def test_every_section_and_every_kind_of_a_mission_is_on_its_page():
    page = (Path(__file__).parents[3] / "docs" / "missions.md").read_text(encoding="utf-8")
    tables = page[page.index("## Every section") : page.index("## Logs as CSV")]
    said = set(re.findall(r'`"?([\w ]+)"?`', tables))
    keys = [
        *MissionFile.SECTIONS,
        *MissionFile.FREE,
        *ENDS,
        *CURRENTS,
        *DENSITIES,
        *PROFILES,
        *kinds("controllers"),
        *figure_names(),
    ]
    assert not [key for key in keys if key not in said and f"`[{key}]`" not in tables]
