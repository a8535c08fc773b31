"""Steady turns beyond the fold of the straight course's branch, against the source's own equations of motion."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import root

import coadjoint_vehicles as vehicles
from coadjoint.cli.main import main
from coadjoint.errors import ArgumentError
from coadjoint_vehicles.files.registry import vehicle_text
from coadjoint_vehicles.trim import SteadyFlight, trim
from coadjoint_vehicles.trim.turning import turns

PRESTERO = vehicles.load("remus_100_prestero")
FILE: dict[str, Any] = tomllib.loads(vehicle_text("remus_100_prestero"))
PARTS = {part["name"]: part for part in FILE["part"]}


def _product(name: str, values: dict[str, float]) -> float:
    """`Y_v|v|` is v|v|, `N_uu_rudder` is u² times the rudder."""
    term, found = name.partition("_")[2], 1.0
    for actuator in ("stern_planes", "rudder"):
        if term.endswith(f"_{actuator}"):
            term, found = term[: -len(actuator) - 1], found * values[actuator]
    for factor in re.findall(r"\|.\||.", term):
        found *= abs(values[factor[1]]) if factor[0] == "|" else values[factor]
    return found


def _left_over(x: Sequence[float], rudder: float) -> tuple[np.ndarray, np.ndarray]:
    """Force and torque less m a, in FRD about the centre of buoyancy: Newton and Euler with the coefficients as read.

    The coefficients of two velocities hold the Coriolis terms of the added mass, so that the left side has the body's
    alone. x: u, v, w, rate, roll, pitch, planes and revolutions, with ω = rate down.
    """
    u, v, w, rate, roll, pitch, planes, n = map(float, x)
    down = np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
    nu, omega = np.array([u, v, w]), rate * down
    body = FILE["body"]
    m, g, I = body["mass"]["value"], body["gravity"]["value"], np.diag(body["inertia"]["value"])
    at = np.array(body["center_of_mass"]["value"])
    values = dict(zip("uvwpqr", (*nu, *omega), strict=True)) | {"stern_planes": planes, "rudder": rudder}
    push = dict.fromkeys("XYZKMN", 0.0)
    for name in ("manoeuvring", "stern_planes", "rudder"):
        for key, number in PARTS[name]["coefficients"]["value"].items():
            push[key[0]] += number * _product(key, values)
    thrust = PARTS["propeller"]["curve"]["quadratic"]["value"] * n * abs(n)
    force = np.array([push["X"] + thrust, push["Y"], push["Z"]]) + (m * g - body["buoyancy"]["value"]) * down
    torque = np.array([push["K"] + PARTS["propeller"]["torque"]["value"] * thrust, push["M"], push["N"]])
    torque += np.cross(at, m * g * down)
    moving = m * (np.cross(omega, nu) + np.cross(omega, np.cross(omega, at)))
    turning = np.cross(omega, I @ omega) + m * np.cross(at, np.cross(omega, nu))
    return np.concatenate([force - moving, torque - turning]), down


def _solved(start: list[float], rudder: float) -> Any:
    """The level turn at 1.5 m/s near a start, by MINPACK: u, v, w, rate, roll, pitch, planes and revolutions."""

    def equations(x: Any) -> Any:
        left, down = _left_over(x, rudder)
        return [*left, np.linalg.norm(x[:3]) - 1.5, x[:3] @ down]

    found = root(equations, start, tol=1e-13)
    assert found.success and np.max(np.abs(found.fun)) < 1e-9
    return found.x


@dataclass(frozen=True)
class Place:
    """A motion as far as a search for turns reads it: down in the body, ν and ω."""

    a: tuple[float, ...] = (0.0, 0.0, 1.0)
    nu: Any = (2.0, 0.0, 0.0)
    xi: Any = None

    def replace(self, **changes: Any) -> Place:
        return replace(self, **changes)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_turns_are_sought_first_to_the_side_to_which_the_held_rudder_turns_and_stay_upright(side):
    asked: list[tuple[float, float, float]] = []

    def find(start: Place, speed: float) -> Any:
        asked.append((start.xi[2], start.nu[0], speed))
        if len(asked) == 1:
            raise ArgumentError("No steady motion was found.")
        return SimpleNamespace(state=start.replace(a=(0.0, 0.9, 0.4)) if len(asked) > 5 else start)

    reduced = SimpleNamespace(slopes=lambda _: SimpleNamespace(rate=[0.0, 0.0, side]))
    search: Any = SimpleNamespace(reduced=reduced, find=find)
    place: Any = Place()
    found = list(turns(place, search, 2.0, SimpleNamespace(length=4.0)))
    expected = [
        (s * rate, u, v) for s in (side, -side) for rate, u, v in ((0.05, 2, 2), (0.105, 1.4, 1.4), (0.105, 1.4, 2))
    ]
    np.testing.assert_allclose(asked, expected, rtol=1e-12)
    assert len(found) == 2


@pytest.mark.long
def test_a_turn_beyond_the_fold_is_that_of_the_equations_as_the_source_has_them():
    rudder = np.radians(5)
    found = trim(PRESTERO, motion := SteadyFlight(PRESTERO, hold={"rudder": rudder}, turning=True).at(1.5))
    values = [*motion.state.nu, found.turn_rate, found.roll, found.pitch]
    values += [found.actuators["stern_planes"], float(found.actuators["propeller"][0])]
    assert np.max(np.abs(_left_over(values, rudder)[0])) < 1e-10
    independent = _solved([1.5, -0.05, -0.1, 0.15, -0.1, -0.07, -0.2, 170.0], rudder)
    np.testing.assert_allclose(values, independent, rtol=1e-8)
    assert found.sideslip == pytest.approx(np.arcsin(independent[1] / 1.5), rel=1e-7)
    assert found.attack == pytest.approx(np.arctan2(independent[2], independent[0]), rel=1e-7)
    assert found.sideslip < -0.01 < 0.1 < found.turn_rate, "turning to starboard the nose points inwards"
    assert np.degrees(found.turn_rate) == pytest.approx(10.09, abs=5e-3)
    assert found.exceeded["propeller"] == pytest.approx((183.005, 1525 * 2 * np.pi / 60), rel=1e-5)


@pytest.mark.long
def test_a_turn_within_all_limits_is_found_where_the_straight_course_leads_to_none():
    remus = vehicles.load("remus_100_sgarioto")
    found = trim(remus, SteadyFlight(remus, hold={"rudder": np.radians(5)}, turning=True).at(1.5))
    assert np.degrees(found.turn_rate) == pytest.approx(10.38, abs=5e-3) and not found.beyond


@pytest.mark.long
def test_a_turn_that_needs_too_much_is_told_with_the_value_and_the_limit(capsys):
    assert main(["stability", "remus_100_prestero", "--rudder", "5"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert (
        "No turn within all limits was found: this one needs propeller at 183 rad/s, beyond its limit of 159.7 rad/s."
        in shown
    )
    assert "turning to starboard at 10.1°/s" in shown


@pytest.mark.long
def test_an_actuator_that_is_held_beyond_its_limit_is_told_as_held(capsys):
    assert main(["stability", "remus_100_sgarioto", "--rudder", "30"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "rudder is held at 30.00°, beyond its limit of 15.00°." in shown and "No turn" not in shown


@pytest.mark.long
def test_what_a_vehicle_weighs_beyond_its_buoyancy_is_told_in_words():
    with pytest.raises(ArgumentError, match=r"is 11 N lighter than the water .* \(positively buoyant\)\.$"):
        SteadyFlight(PRESTERO).at(0.0)


@pytest.mark.long
def test_one_number_holds_a_propeller_of_one_thruster():
    flight = SteadyFlight(PRESTERO, hold={"propeller": 50.0})
    with pytest.raises(ArgumentError, match="No steady motion was found"):
        flight.at(0.9)
    with pytest.raises(ArgumentError, match=r"shape \(1,\), but got \(2,\)\.$"):
        SteadyFlight(PRESTERO, hold={"propeller": [50.0, 50.0]}).at(0.9)
