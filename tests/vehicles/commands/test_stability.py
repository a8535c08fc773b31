"""`coadjoint stability`: what it prints, draws and refuses."""

from __future__ import annotations

import json
import sys
from math import inf, radians
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from coadjoint.cli.main import main
from coadjoint.errors import ArgumentError
from coadjoint_vehicles.commands import stability
from coadjoint_vehicles.trim.reading import Trim


class Boat:
    """A vehicle with a rudder and a sliding mass, and the reports of its motions."""

    name = "Long Boat-2"
    commanded = (
        SimpleNamespace(name="rudder", units=None, command=SimpleNamespace(unit="rad", shape=())),
        SimpleNamespace(name="mass", units={"position": "m"}, command=SimpleNamespace(unit="m", shape=())),
    )

    def part(self, name: str):
        return next(part for part in self.commanded if part.name == name)


class Mode(str):
    name = "spiral"


class Mass:
    position = np.array(0.25)

    def __iter__(self):
        return iter(("position",))

    def asdict(self):
        return {"position": self.position}


def trimmed(**changes) -> Trim:
    flies: dict[str, Any] = {
        "speed": 1.5, "climb": 0.0, "pitch": 0.1, "roll": -0.2, "attack": 0.3, "sideslip": -0.4, "turn_rate": 0.0,
        "radius": inf, "actuators": {"rudder": np.array(0.1), "mass": Mass()}, "exceeded": {},
    }  # fmt: skip
    return Trim(**flies | changes)


def report(zero=0, forces=None, **more) -> Any:
    motion = SimpleNamespace(system=SimpleNamespace(forces=forces))
    energy = SimpleNamespace(verdict="undecided", reason="no definite sign")
    linear = SimpleNamespace(zero_modes=zero)
    return SimpleNamespace(
        modes=[Mode("spiral: grows: fast"), Mode("roll: decays")], linear=linear, motion=motion, energy=energy,
        verdict="unstable", growth_rate=0.5, summary=lambda: {"verdict": "unstable"}, **more,
    )  # fmt: skip


def flight(**more) -> Any:
    return SimpleNamespace(**{"vehicle": Boat(), "hold": (), "looks_for_turns": False} | more)


def test_one_motion_is_told_with_attitude_flow_actuators_modes_and_verdict():
    assert stability._card(flight(), trimmed(), report(zero=2)) == [
        ("vehicle", "Long Boat-2"), ("motion", "1.5 m/s, straight, level"),
        ("attitude", "pitch 5.73°, roll -11.46°"), ("flow", "attack 17.19°, sideslip -22.92°"),
        ("rudder", "5.73°"), ("mass", "position 0.25 m"), ("spiral", "grows: fast"), ("roll", "decays"),
        ("zero modes", "2, of other momenta and symmetries"), ("energy–Casimir", "undecided: no definite sign"),
        ("verdict", "unstable"),
    ]  # fmt: skip
    still = trimmed(speed=0.0, exceeded={"rudder": (0.1, 0.05)})
    rows = stability._card(flight(), still, report(forces=len))
    assert [name for name, _ in rows] == [
        "vehicle", "motion", "attitude", "rudder", "mass", "limits", "spiral", "roll", "verdict"
    ]  # fmt: skip
    assert dict(rows)["rudder"] == "5.73°, beyond its limit" and dict(rows)["mass"] == "position 0.25 m"


def test_json_has_numbers_of_each_motion_and_why_others_were_not_found():
    turns = trimmed(radius=8.5, exceeded={"mass": (0.25, 0.2)})
    found = stability._summary(Boat(), {1.5: (turns, report()), 2.0: (trimmed(), report())}, {3.0: "no"}, Path("a.png"))
    first, second = found.pop("motions")
    assert found == {"vehicle": "Long Boat-2", "not_found": {"3": "no"}, "figure": "a.png"}
    assert first == {
        "speed": 1.5, "climb": 0.0, "pitch": 0.1, "roll": -0.2, "attack": 0.3, "sideslip": -0.4, "turn_rate": 0.0,
        "radius": 8.5, "actuators": {"rudder": 0.1, "mass": {"position": 0.25}}, "beyond_limits": ["mass"],
        "exceeded": {"mass": {"value": 0.25, "limit": 0.2, "unit": "m"}}, "verdict": "unstable",
    }  # fmt: skip
    assert second["radius"] is None and second["speed"] == 2.0 and second["exceeded"] == {}
    assert stability._summary(Boat(), {}, {}, None)["figure"] is None


def test_each_speed_is_looked_for_near_the_last_that_was_found(monkeypatch):
    asked = []

    def at(speed, near):
        asked.append((speed, near))
        if speed == 2.0:
            raise ArgumentError("too fast")
        return f"motion at {speed}"

    monkeypatch.setattr("coadjoint_vehicles.trim.reading.trim", lambda vehicle, motion: (vehicle, motion))
    monkeypatch.setattr("coadjoint.stability.stability", lambda motion: motion.upper())
    found, failures = stability._fly(flight(at=at, vehicle="boat"), [1.0, 2.0, 1.5])
    assert asked == [(1.0, None), (2.0, "motion at 1.0"), (1.5, "motion at 1.0")]
    assert found == {v: (("boat", f"motion at {v}"), f"MOTION AT {v}") for v in (1.0, 1.5)}
    assert failures == {2.0: "too fast"}


@pytest.fixture
def asked(monkeypatch):
    """The steady flight that a command asks for; at more than 2 m/s there is none."""
    made: list[Any] = []

    def fly(wanted, speeds):
        return (
            {v: (trimmed(speed=v), report()) for v in speeds if v <= 2},
            {v: f"no flight at {v:g}" for v in speeds if v > 2},
        )

    def made_of(vehicle, **kinds):
        made.append(kinds)
        return flight(vehicle=vehicle)

    monkeypatch.setattr("coadjoint_vehicles.files.registry.load_vehicle", lambda name: Boat())
    monkeypatch.setattr("coadjoint_vehicles.trim.flight.SteadyFlight", made_of)
    monkeypatch.setattr(stability, "_fly", fly)
    monkeypatch.setattr(stability, "_without", lambda vehicle, names: vehicle)
    monkeypatch.setattr(stability.Stability, "_draw", lambda self, vehicle, found: self.out or Path("drawn.png"))
    return made


@pytest.mark.parametrize(
    ("given", "kinds"),
    [
        ({}, {"hold": {}, "free": None, "climb": 0.0, "turning": False, "depth": 0.0}),
        (
            {"rudder": -5.0, "climb": 10.0, "hold": ("mass=0.25",), "free": ("mass",), "depth": 3.0},
            {"hold": {"mass": 0.25, "rudder": radians(-5)}, "free": ("mass",), "climb": radians(10), "turning": True,
             "depth": 3.0},
        ),
        ({"turning": True}, {"hold": {}, "free": None, "climb": 0.0, "turning": True, "depth": 0.0}),
    ],
)  # fmt: skip
def test_angles_of_the_command_are_degrees_and_a_held_rudder_turns(given, kinds, asked, capsys):
    assert stability.Stability("boat", speed="1.5", **given)() == 0
    assert asked == [kinds] and capsys.readouterr().out.splitlines()[-1].split() == ["verdict", "unstable"]


def test_several_speeds_are_a_table_with_a_figure_and_the_failures_go_to_the_other_stream(asked, capsys):
    stability.Stability("boat", speed="1,2,3")()
    shown = capsys.readouterr()
    assert [line.split()[0] for line in shown.out.splitlines()] == ["speed", "1", "2", "Figure:"]
    assert "At 3 m/s: no flight at 3" in shown.err and "drawn.png." in shown.out
    stability.Stability("boat", speed="1.5", out=Path("own.png"))()
    assert "own.png" in capsys.readouterr().out
    stability.Stability("boat", speed="1,3", json=True)()
    shown = capsys.readouterr()
    assert json.loads(shown.out)["not_found"] == {"3": "no flight at 3"} and shown.err == ""
    assert json.loads(shown.out)["figure"] == "drawn.png"
    with pytest.raises(ArgumentError, match="no flight at 4"):
        stability.Stability("boat", speed="4,5")()


def test_the_figure_is_named_for_the_vehicle(monkeypatch):
    drawn = []
    monkeypatch.setitem(sys.modules, "coadjoint.plotting.style", style := ModuleType("style"))
    style.save = lambda figure, path, dpi: drawn.append(figure) or path
    monkeypatch.setattr("coadjoint.extending.stability_figure", lambda speeds, reports: (speeds, reports))
    found: Any = {1.0: ("trim", "report"), 2.0: ("other", "second")}
    assert stability.Stability("boat")._draw(Boat(), found) == Path("long_boat_2_stability.png")
    assert stability.Stability("boat", out=Path("b.pdf"))._draw(Boat(), found) == Path("b.pdf")
    assert drawn[0] == ([1.0, 2.0], ["report", "second"])


@pytest.mark.long
def test_it_prints_trim_modes_and_verdict(capsys):
    assert main(["stability", "remus_100", "--speed", "1.5", "--without", "stern_planes", "rudder"]) == 0
    shown = capsys.readouterr().out
    assert "1.5 m/s, straight, level" in shown and "grows, time constant 0.471 s" in shown
    assert shown.splitlines()[-1].split() == ["verdict", "unstable"]


@pytest.mark.long
def test_several_speeds_make_a_table_and_a_figure_and_json_has_it_all(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["stability", "remus_100", "--speed", "1:2:0.5", "--out", "growth.png"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in shown[1:4]] == ["1", "1.5", "2"] and shown[-1] == "Figure: growth.png."
    assert (tmp_path / "growth.png").read_bytes()[:4] == b"\x89PNG"
    assert main(["stability", "remus_100", "--rudder", "5", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    motion = found["motions"][0]
    assert motion["verdict"] == "stable" and 7 < motion["radius"] < 9 and len(motion["modes"]) >= 6


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["remus_10"], "No vehicle `remus_10` is shipped"),
        (["nothing.toml"], "nothing.toml"),
        (["remus_100", "--speed", "fast"], "--speed must be a speed in m/s"),
        (["remus_100", "--speed", "0:1:0"], "--speed must be a speed in m/s"),
        (["remus_100", "--hold", "propeller"], "--hold must be NAME=VALUE"),
        (["remus_100", "--hold", "sail=1"], "has no actuator `sail`"),
        (["remus_100", "--rudder", "5", "--free", "rudders"], "has no actuator `rudders`"),
        pytest.param(
            ["remus_100", "--rudder", "5", "--free", "propeller"], "moved propeller, and not ", marks=pytest.mark.long
        ),
        (["remus_100", "--hold", "propeller=nan"], "finite number, but is 'propeller=nan'"),
        (["remus_100", "--climb", "200"], "must be a number from -90 to 90, but is 200"),
        (["remus_100", "--without", "sail"], "has no part `sail`"),
    ],
)
def test_what_cannot_be_done_is_one_sentence(arguments, sentence, capsys):
    assert main(["stability", *arguments]) == 2
    assert sentence in capsys.readouterr().err
