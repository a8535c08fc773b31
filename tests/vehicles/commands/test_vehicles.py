"""The command `vehicles`: the registry, one vehicle with all that is known of it, its file to start from."""

from __future__ import annotations

import json
from collections import namedtuple

import numpy as np
import pytest
from scipy.optimize import brentq

import coadjoint_vehicles as vehicles
from coadjoint.cli.main import main
from coadjoint_vehicles.commands.vehicles import _listed
from coadjoint_vehicles.files.registry import vehicle_text
from coadjoint_vehicles.files.summary import summary


def told(capsys, *arguments: str, status: int = 0) -> str:
    assert main(["vehicles", *arguments]) == status
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err
    return captured.err if status else captured.out


def test_all_vehicles_are_listed_with_mass_length_parts_controller_and_source(capsys) -> None:
    lines = told(capsys).splitlines()
    assert lines[0].split("  ")[0] == "vehicle" and len(lines) == 1 + len(vehicles.names())
    row = next(line for line in lines if line.startswith("remus_100 "))
    for word in ("31.029", "1.6", "fin", "propeller", "cruise", "cybergalactic/PythonVehicleSimulator"):
        assert word in row
    rows = json.loads(told(capsys, "--json"))
    assert [row["name"] for row in rows] == vehicles.names()


@pytest.mark.long
def test_a_vehicle_is_shown_with_every_number_its_source_and_what_follows(capsys) -> None:
    out = told(capsys, "show", "rexrov")
    for words in ("metacentric height  300 mm", "net weight          -263.5 N, it floats up", "terminal speed"):
        assert words in out
    assert "Warning: [added_mass] matrix is not symmetric: row 3, column 6 is 10.774" in out
    assert "manoeuvre; set points: depth (m), heading (rad), speed (m/s)" in out
    vehicle = vehicles.load("rexrov")
    for key, number in vehicle.provenance.items():
        line = next(line for line in out.splitlines() if line.startswith(f"{key} "))
        assert number.source in line and number.note in line
    found = json.loads(told(capsys, "show", "rexrov", "--json"))
    assert found["numbers"]["body.mass"]["value"] == 1862.87 and found["numbers"]["body.mass"]["unit"] == "kg"
    assert found["summary"]["displaced_mass"] == pytest.approx(1028 * 1.83826)
    assert found["sources"].keys() == vehicle.sources.keys() == found["licences"].keys()
    assert found["licence"] == "Apache-2.0" and "licence             Apache-2.0" in out
    assert next(line for line in out.splitlines() if line.startswith("UUV  ")).endswith("Apache-2.0")


@pytest.mark.long
def test_a_vehicle_that_nothing_brakes_or_pushes_says_why_it_has_no_terminal_speed(capsys, tmp_path) -> None:
    assert "no terminal speed: nothing pushes it ahead" in told(capsys, "show", "ellipsoid")
    path = tmp_path / "mine.toml"
    text = vehicle_text("lrauv_raanan")
    path.write_text(text.replace('"X_u|u|" = -', '"X_u|u|" = '), encoding="utf-8")
    out = told(capsys, "show", str(path))
    assert "no terminal speed: its drag does not hold" in out and "Warning: X_u|u| of" in out


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", vehicles.names())
def test_every_shipped_vehicle_can_be_shown(capsys, name: str) -> None:
    assert vehicles.load(name).name in told(capsys, "show", name)
    assert json.loads(told(capsys, "show", name, "--json"))["summary"]["mass"] > 0


@pytest.mark.long
def test_the_file_that_is_printed_is_a_file_of_ones_own(capsys, tmp_path) -> None:
    text = told(capsys, "show", "remus_100", "--toml")
    assert text == vehicle_text("remus_100")
    path = tmp_path / "mine.toml"
    path.write_text(text.replace('name = "REMUS 100"', 'name = "Mine"'), encoding="utf-8")
    assert told(capsys, "show", str(path)).startswith("name                Mine\n")
    assert told(capsys, "show", str(path), "--toml") == path.read_text(encoding="utf-8")


@pytest.mark.long
def test_warnings_about_ones_own_file_are_shown_and_what_is_wrong_refused(capsys, tmp_path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(vehicle_text("remus_100").replace("[0, 0, 20]", "[0, 0, -20]"), encoding="utf-8")
    assert "Warning: its centre of buoyancy is 20 mm below its centre of mass" in told(capsys, "show", str(path))
    path.write_text("[vehicle]", encoding="utf-8")
    assert "a vehicle file needs a section [body]" in told(capsys, "show", str(path), status=2)
    assert "did you mean `rexrov`" in told(capsys, "show", "rexrof", status=2)
    assert "Which vehicle?" in told(capsys, "show", status=2)
    assert "coadjoint vehicles show remus_100" in told(capsys, "list", "remus_100", status=2)
    assert "leave --json out" in told(capsys, "mission", "remus_100", "--json", status=2)
    assert "not JSON" in told(capsys, "show", "remus_100", "--json", "--toml", status=2)


def test_terminal_speeds_are_where_thrust_is_drag() -> None:
    """REMUS: (1 − t)ρD⁴n(K_T0 n + K_T1 (1 − w)u/D) = ½ρ C_d A u² + D₁₁ e^(−3u) u + fins without lift. NPS: n = 25/s."""
    rho, D, n = 1026.0, 0.14, 1525 / 60
    slope = (0.1798 - 0.4566) / 0.6632

    def push(u: float) -> float:
        thrust = 0.9 * rho * D**4 * n * (0.4566 * n + slope * 0.944 * u / D)
        return thrust - 0.5 * rho * 0.42 * np.pi / 4 * 0.19**2 * u**2 - 1.5934142487900123 * np.exp(-3 * u) * u

    assert summary(vehicles.load("remus_100")).terminal_speed == pytest.approx(brentq(push, 0.1, 5), rel=1e-9)
    held = 0.012 * 2 * np.pi * 25  # where 0.012 n/u is 1
    assert summary(vehicles.load("nps_auv_ii")).terminal_speed == pytest.approx(held, rel=1e-9)
    assert summary(vehicles.load("ellipsoid")).terminal_speed is None


def test_numbers_that_a_vehicle_does_not_have_are_null() -> None:
    found = namedtuple("Found", "speed power")(np.arange(2.0), 3.0)
    assert _listed(None) is None and _listed(found) == {"speed": [0.0, 1.0], "power": 3.0}
