"""How commands read their arguments and say what they found: units, signs, limits and the order of two runs."""

from __future__ import annotations

import json
from math import inf, nan, radians
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from rich.table import Table

from coadjoint.cli import comparing, results_folder, terminal, viewing
from coadjoint.errors import ArgumentError, FileError
from coadjoint.report.comparison import Comparison
from coadjoint.report.folder import RUN_FILE, SUMMARY, UNFINISHED
from coadjoint_vehicles.commands import identify, importing, stability
from coadjoint_vehicles.commands.vehicles import Vehicles
from coadjoint_vehicles.trim.reading import Trim

LEVEL: dict[str, Any] = {
    "speed": 1.5, "climb": 0.0, "pitch": 0.1, "roll": 0.0, "attack": 0.1, "sideslip": 0.0, "turn_rate": 0.0,
    "radius": inf, "actuators": {"rudder": np.array(0.1), "propeller": np.array([12.0])}, "exceeded": {},
}  # fmt: skip
RUDDER = SimpleNamespace(name="rudder", units=None, command=SimpleNamespace(unit="rad", shape=()))
PROPELLER = SimpleNamespace(name="propeller", units=None, command=SimpleNamespace(unit="rev/s", shape=(1,)))
MOVED = {"position": "m", "speed": "m/s"}
MASS = SimpleNamespace(name="mass", units=MOVED, command=SimpleNamespace(unit="m", shape=()))
RUDDER_BEYOND = "rudder at 28.65°, beyond its limit of 11.46°"


# compare


def test_the_names_of_two_runs_are_those_of_their_folders_or_whole_paths():
    assert comparing._names(Path("a/one"), Path("b/two.nc")) == ("one", "two")
    assert comparing._names(Path("a/one"), Path("b/one")) == ("a/one", "b/one")


def test_a_number_has_three_digits_and_what_is_missing_is_a_dash():
    assert [comparing._text(value) for value in (None, 0.123456, 1234, "SO3")] == ["–", "0.123", "1234", "SO3"]


def test_the_state_is_told_before_other_variables_and_those_by_name():
    names = ["energy", "mu", "q", "depth"]
    assert sorted(names, key=comparing._order) == ["q", "mu", "depth", "energy"]


def test_a_folder_of_several_runs_is_not_one_run():
    assert comparing._one({"a": 1}, Path("runs")) == 1
    with pytest.raises(ArgumentError, match="The folder runs holds 2 runs: name one of its files, a, b"):
        comparing._one({"a": 1, "b": 2}, Path("runs"))


def test_two_runs_are_compared_in_the_order_in_which_they_are_given(monkeypatch, capsys):
    datasets = {Path("one"): "first", Path("two"): "second"}
    monkeypatch.setattr(results_folder, "recordings", lambda source: {"run": SimpleNamespace(dataset=datasets[source])})

    def compare(first, second, names):
        assert (first, second, names) == ("first", "second", ("one", "two"))
        setting, conserved = {"dt": (0.1, 0.2)}, {"energy_error_max": (1e-3, None)}
        moved = {"q": 0.25, "inputs_rudder": 1.0}
        return Comparison(names, setting, conserved, moved, moved, {"q": "m", "inputs_rudder": "rad"}, 1200, 2.5)

    monkeypatch.setattr("coadjoint.report.comparison.compare", compare)
    assert comparing.Compare(Path("one"), Path("two"))() == 0
    told = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["dt", "0.1", "0.2"] in told and ["energy", "error", "max", "0.001", "–"] in told
    assert ["q", "2.500e-01", "2.500e-01", "m"] in told and not any("inputs_rudder" in line for line in told)
    assert ["apart,", "1,200", "times", "at", "2.5", "s", "at", "most", "unit"] in told
    assert comparing.Compare(Path("one"), Path("two"), json=True)() == 0
    found = json.loads(capsys.readouterr().out)
    assert found["runs"] == ["one", "two"] and found["difference_max"]["inputs_rudder"] == 1.0
    assert found["common_times"] == 1200 and found["conserved"]["energy_error_max"] == [0.001, None]


# stability


@pytest.mark.cases(6)
@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, "1.5 m/s, straight, level"),
        ({"speed": 0.0}, "at rest"),
        ({"climb": radians(2)}, "1.5 m/s, straight, climbing at 2.00°"),
        ({"climb": radians(-2)}, "1.5 m/s, straight, diving at 2.00°"),
        ({"climb": radians(90)}, "1.5 m/s, climbing vertically"),
        ({"climb": radians(-90), "turn_rate": radians(-3)}, "1.5 m/s, diving vertically, spinning at 3°/s"),
        ({"turn_rate": radians(3), "radius": 28.6}, "1.5 m/s, turning to starboard at 3°/s, radius 28.6 m, level"),
        ({"turn_rate": radians(-3), "radius": 28.6}, "1.5 m/s, turning to port at 3°/s, radius 28.6 m, level"),
    ],
)
def test_a_steady_motion_in_words(changes, says):
    assert stability._motion(Trim(**LEVEL | changes)) == says


def test_actuators_are_told_in_the_units_of_their_commands():
    assert stability._value(np.array([radians(10), radians(-0.001)]), RUDDER) == "10.00°, 0.00°"
    assert stability._value(np.array([12.5, -1e-12]), PROPELLER) == "12.5, 0 rev/s"
    moved = SimpleNamespace(position=np.array(0.25), speed=np.array(-0.5))
    assert stability._value(moved, MASS) == "position 0.25 m, speed -0.5 m/s"
    assert [stability._amount(0.5, part) for part in (RUDDER, PROPELLER, MASS)] == ["28.65°", "0.5 rev/s", "0.5 m"]


@pytest.mark.parametrize(
    ("hold", "turns", "says"),
    [
        ((), False, f"This motion needs {RUDDER_BEYOND} and mass at 2 m, beyond its limit of 1 m."),
        ((), True, "No turn within all limits was found: this one needs rudder"),
        (("rudder",), False, "This motion needs mass at 2 m, beyond its limit of 1 m. rudder is held at 28.65°"),
        (("rudder", "mass"), False, "rudder is held at 28.65°, beyond its limit of 11.46°. mass is held at 2 m"),
    ],
)  # fmt: skip
def test_what_is_beyond_limits_is_needed_or_held(hold, turns, says):
    parts = {"rudder": RUDDER, "mass": MASS}
    flight = SimpleNamespace(vehicle=SimpleNamespace(part=parts.__getitem__), hold=hold, looks_for_turns=turns)
    trimmed = Trim(**LEVEL | {"exceeded": {"rudder": (0.5, 0.2), "mass": (2.0, 1.0)}})
    assert stability._limits(cast(Any, flight), trimmed).startswith(says)


def test_the_table_of_speeds_has_a_column_for_each_single_actuator(capsys):
    vehicle = SimpleNamespace(commanded=(RUDDER, PROPELLER, MASS))
    mode = SimpleNamespace(name="spiral")
    report = SimpleNamespace(modes=[mode], growth_rate=-0.25, verdict="stable")
    none = SimpleNamespace(modes=[], growth_rate=0.0, verdict="neutral")
    beyond = Trim(**LEVEL | {"exceeded": {"rudder": (0.1, 0.05)}})
    found = {1.0: (Trim(**LEVEL), report), 2.0: (beyond, none)}
    stability._table(cast(Any, vehicle), cast(Any, found))
    head, first, second = capsys.readouterr().out.splitlines()
    assert head.split("  ")[0] == "speed" and "rudder" in head and "propeller" in head and "mass" not in head
    assert first.split() == ["1", "5.73°", "12", "rev/s", "-0.2500", "spiral", "stable"]
    assert second.split() == ["2", "5.73°!", "12", "rev/s", "0.0000", "neutral"]


@pytest.mark.parametrize("text", ["propeller=15", ("propeller=15",), " propeller =15"])
def test_a_held_actuator_is_a_name_and_a_number(text):
    assert stability._setting(text) == ("propeller", 15.0)


@pytest.mark.parametrize("text", ["propeller", "propeller=fast", "propeller=inf", "propeller=nan"])
def test_another_held_actuator_raises_how_it_is_written(text):
    with pytest.raises(ArgumentError, match="--hold must be NAME=VALUE with a"):
        stability._setting(text)


# identify, import, view, vehicles


@pytest.mark.parametrize("text", ["depth=0.02", ("depth=0.02",)])
def test_a_noise_is_a_name_and_a_number(text):
    assert identify._given(text) == ("depth", 0.02)
    with pytest.raises(ArgumentError, match=r"--noise must be NAME=VALUE with a number.*'depth'"):
        identify._given("depth")


def test_an_interval_without_an_end_has_none_in_json():
    assert [identify._number(value) for value in (1.5, inf, nan)] == [1.5, None, None]


def test_an_argument_of_a_model_is_a_name_and_a_value():
    assert importing._pair("namespace=a=b") == ("namespace", "a=b") and importing._pair("debug=") == ("debug", "")
    for wrong in ("namespace", "=rexrov"):
        with pytest.raises(ArgumentError, match="--set must be NAME=VALUE"):
            importing._pair(wrong)


@pytest.mark.parametrize("name", ["there.toml", "vehicle.txt"])
def test_an_import_writes_a_new_toml_file_only(tmp_path, name):
    (tmp_path / "there.toml").touch()
    with pytest.raises(ArgumentError, match=r"--out must be a new file \.toml"):
        importing.Import(tmp_path / "model.sdf", out=tmp_path / name)()


def test_the_body_of_a_view_is_a_box_an_ellipsoid_or_a_mesh(tmp_path):
    assert viewing.View((tmp_path,))._hull() is None
    box, round_one = (viewing.View((tmp_path,), size=(2.0, 1.0, 0.5), round=r)._hull() for r in (False, True))
    assert box["size"] == [2.0, 1.0, 0.5] and round_one["axes"] == [1.0, 0.5, 0.25]
    with pytest.raises(FileError, match=r"gone\.stl"):
        viewing.View((tmp_path,), mesh=tmp_path / "gone.stl")._hull()
    with pytest.raises(ArgumentError, match="either by a mesh or by `--size`"):
        viewing.View((tmp_path,), size=(1.0, 1.0, 1.0), mesh=tmp_path / "a.stl")._hull()
    with pytest.raises(ArgumentError, match="Which run"):
        viewing.View(())()


def test_without_a_screen_no_browser_is_opened(monkeypatch, tmp_path):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    asked = []
    monkeypatch.setattr("webbrowser.open", lambda address: bool(asked.append(address)) or True)
    monkeypatch.setattr("sys.platform", "linux")
    assert not viewing.opened(tmp_path / "view.html") and asked == []
    monkeypatch.setenv("DISPLAY", ":0")
    assert viewing.opened(tmp_path / "view.html") and asked[0].startswith("file://")


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"action": "list", "name": "remus_100"}, "coadjoint vehicles show remus_100"),
        ({"action": "list", "toml": True}, "coadjoint vehicles show NAME"),
        ({"action": "show"}, "Which vehicle"),
        ({"action": "show", "name": "remus_100", "toml": True, "json": True}, "leave --toml or --json out"),
        ({"action": "mission", "name": "remus_100", "json": True}, "leave --json out"),
    ],
)
def test_what_does_not_go_together_raises_what_to_leave_out(asked, says):
    with pytest.raises(ArgumentError, match=says):
        Vehicles(**asked)()


# folders and tables


@pytest.mark.parametrize(
    ("files", "says"),
    [
        ((), "holds no results of coadjoint"),
        ((RUN_FILE,), "holds a run that did not finish"),
        ((RUN_FILE, UNFINISHED), "holds a run that has not finished: `coadjoint resume"),
    ],
)
def test_a_folder_without_trajectories_says_what_it_holds(tmp_path, files, says):
    for name in files:
        (tmp_path / name).touch()
    with pytest.raises(FileError, match=says):
        results_folder.recordings(tmp_path)
    with pytest.raises(FileError, match=says):
        results_folder.certificates(tmp_path)


def test_a_run_that_failed_at_its_first_step_says_why(tmp_path):
    (tmp_path / SUMMARY).write_text(json.dumps({"failure": "Newton did not converge.", "card": "a card"}))
    with pytest.raises(FileError, match=r"has no good step.*: Newton did not converge\.$"):
        results_folder.recordings(tmp_path)
    assert results_folder.certificates(tmp_path) == ["a card", "Newton did not converge."]
    (tmp_path / SUMMARY).write_text(json.dumps({"card": "all lines", "certificate": "five lines"}))
    assert results_folder.certificates(tmp_path) == ["five lines"]
    assert results_folder.certificates(tmp_path, long=True) == ["all lines"]


@pytest.mark.parametrize("text", ["[1]", '"a"', "3"])
def test_a_summary_that_is_no_table_was_not_written_here(tmp_path, text):
    (tmp_path / SUMMARY).write_text(text)
    with pytest.raises(FileError, match="was not written by coadjoint"):
        results_folder.summary(tmp_path)


def test_the_figures_of_a_run_are_those_that_its_file_lists(tmp_path):
    assert results_folder.figures_asked(tmp_path) is None
    for text, asked in (
        ('[output]\nfigures = ["energy"]', ["energy"]),
        ("[output]\nfigures = []", None),
        ("[run]", None),
        ('output = "a"', None),
    ):
        (tmp_path / RUN_FILE).write_text(text)
        assert results_folder.figures_asked(tmp_path) == asked


def test_columns_are_as_wide_as_their_widest_cell_and_heads_may_be_left_out(capsys):
    terminal.table(("a", "bbb"), [("long", "x"), ("s", "y\nz")])
    assert capsys.readouterr().out == "a     bbb\nlong  x\ns     y z\n"
    terminal.table(("a long head", ""), [("one", "two")], heads=False)
    assert capsys.readouterr().out == "one  two\n"
    terminal.table(("a", "b"), [], heads=False)
    assert capsys.readouterr().out == ""


# tables


def test_a_narrow_terminal_breaks_neither_numbers_nor_names_in_front_of_texts(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "40")
    monkeypatch.setattr(terminal.sys.stdout, "isatty", lambda: True)
    words = "one of the many words of a long text " * 3
    terminal.table(("key", "meaning"), [("hydrodynamic_center_of_pressure", words)])
    terminal.table(("meaning", "value"), [(words, "12345.6789012345"), ("short", "-1")])
    found = capsys.readouterr().out
    assert "hydrodynamic_center_of_pressure" in found and "12345.6789012345" in found


def columns_of(monkeypatch, heads, rows) -> list[tuple]:
    """Style, wrapping and least width of each column of a table on a terminal."""
    made = []
    monkeypatch.setattr(terminal.sys.stdout, "isatty", lambda: True)
    add = Table.add_column

    def kept(self, name, **more):
        made.append((more["style"], more["no_wrap"], more["min_width"]))
        return add(self, name, **more)

    monkeypatch.setattr(Table, "add_column", kept)
    terminal.table(heads, rows)
    return made


def test_numbers_and_names_in_front_of_texts_are_unbroken_and_names_next_to_numbers_have_a_least_width(monkeypatch):
    words = columns_of(monkeypatch, ("key", "meaning"), [("a", "of it")])
    assert words == [("bold", True, None), (None, False, None)]
    numbers = columns_of(monkeypatch, ("key", "value", "unit"), [("a", "-12.5", "m"), ("b", "3", "s")])
    assert numbers == [("bold", False, terminal.NAME), (None, True, 5), (None, False, None)]
    assert columns_of(monkeypatch, ("count", "of"), [("1", "a")])[0] == ("bold", True, len("count"))


# identify


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ({}, {"settle": 2.0, "segment": "auto"}),
        ({"actual": ("rudder", "screw")}, {"settle": 0.0, "segment": "auto"}),
        ({"settle": 3.5, "segment": 0.0}, {"settle": 3.5, "segment": None}),
        ({"settle": 0.0, "segment": 20.0, "actual": ("rudder",)}, {"settle": 0.0, "segment": 20.0}),
    ],
)
def test_a_log_is_settled_where_its_actuators_are_not_measured(asked, expected, monkeypatch, capsys, tmp_path):
    given: dict[str, Any] = {}
    parts = [SimpleNamespace(name=name) for name in ("rudder", "screw", "brake")]
    found = SimpleNamespace(plot=lambda: "figure")

    def identified(system, log, **more):
        given.update(more, system=system, log=log)
        return found

    start = lambda actuators: ("start", actuators)  # noqa: E731
    craft = SimpleNamespace(vehicle=SimpleNamespace(commanded=parts), system="system", start=start)
    log = SimpleNamespace(first={"rudder": 0.5, "screw": 0.0}.get, actual=asked.pop("actual", ("rudder",)))
    read: list[Any] = []
    monkeypatch.setattr("coadjoint.identification.identify", identified)
    monkeypatch.setattr("coadjoint.identification.merged", lambda logs: log)
    monkeypatch.setattr("coadjoint_vehicles.files.registry.load_vehicle", str)
    monkeypatch.setattr("coadjoint_vehicles.logs.read_log", lambda path, **more: read.append((path, more)))
    monkeypatch.setattr("coadjoint_vehicles.model.craft.Craft", lambda vehicle: craft)
    monkeypatch.setattr("coadjoint.plotting.style.save", lambda figure, path, dpi: path)
    monkeypatch.setattr(identify, "_summary", lambda found: {"dt": 0.5})
    command = identify.Identify("boat", (Path("a.csv"),), ("hull",), topics=("/imu",), noise=("u=0.5",), **asked)
    assert command() == 0
    assert {name: given[name] for name in expected} == expected and given["noise"] == {"u": 0.5}
    assert given["start"] == ("start", {"rudder": 0.5, "screw": 0.0}) and given["parameters"] == ("hull",)
    assert read == [
        (Path("a.csv"), {"axes": None, "ignore": (), "jumps": "refuse", "unsorted": "refuse", "topics": ("/imu",)})
    ]
    assert "namespace" in capsys.readouterr().out
    identify.Identify("boat", (Path("a.csv"),), ("hull",), json=True, out=tmp_path / "a.png")()
    assert json.loads(capsys.readouterr().out) == {"dt": 0.5}
    identify.Identify("boat", (Path("a.csv"),), ("hull",), out=tmp_path / "a.png")()
    assert capsys.readouterr().out.endswith(f"Figure: {tmp_path / 'a.png'}.\n")
    with pytest.raises(ArgumentError, match="Which log"):
        identify.Identify("boat", (), ("hull",))()
