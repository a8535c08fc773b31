"""Thrusters by their data sheets: thrust and current by voltage, the sag of a battery, and what a mission draws."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray
from scipy.optimize import brentq

import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError
from coadjoint.extending import evaluate
from coadjoint_vehicles import Craft
from coadjoint_vehicles.files.file import vehicle_from_text
from coadjoint_vehicles.files.registry import vehicle_text
from coadjoint_vehicles.files.writing import vehicle_to_toml
from coadjoint_vehicles.missions.electric import SUPPLY, beyond_sheet, electric_summary, supply
from coadjoint_vehicles.parts import Thrusters
from coadjoint_vehicles.parts.data_sheets import DataSheet, data_sheet, sheet_names
from coadjoint_vehicles.parts.published_curves import KGF, T200

SHEET = data_sheet("T200")
PUBLISHED = {10: (-2.31, 2.93, 13.6), 12: (-2.90, 3.71, 16.9), 14: (-3.52, 4.52, 20.4), 16: (-4.07, 5.25, 23.8)}
PUBLISHED |= {18: (-4.59, 6.02, 27.6), 20: (-5.04, 6.72, 31.2)}
"""Full thrust astern and ahead, kgf, and the current ahead, A, by voltage, as the maker rounds them."""


def eight(**more):
    return Thrusters(
        "thrusters",
        curve={"published": "T200", **more},
        positions=[(0.1 * k, 0.2, 0) for k in range(8)],
        directions=[(1, 0, 0)] * 8,
        unit="µs",
    )


@pytest.mark.parametrize("voltage", PUBLISHED)
def test_full_thrust_and_current_are_those_of_the_makers_sheet(voltage):
    astern, ahead, current = PUBLISHED[voltage]
    forces = SHEET.forces_at(voltage) / KGF
    assert (forces[0], forces[-1]) == pytest.approx((astern, ahead), abs=0.008)
    assert SHEET.currents_at(voltage)[-1] == pytest.approx(current, abs=0.06)
    assert np.all(forces[(SHEET.commands >= 1476) & (SHEET.commands <= 1528)] == 0)


def test_the_sheet_at_16_volts_is_the_curve_that_is_known_by_name_alone():
    made = eight(voltage=16.0)
    commands = np.linspace(1100, 1900, 8)
    found = evaluate(made.thrusts, commands, made.nominal)
    assert found == pytest.approx(np.interp(commands, T200.commands, T200.forces), abs=0.9)


def test_between_two_voltages_thrust_is_their_mean_and_commands_are_inverted_there():
    made = eight(voltage=15.0)
    commands = np.array([1100, 1200, 1420, 1500, 1560, 1650, 1800, 1900.0])
    found = evaluate(made.thrusts, commands, made.nominal)
    mean = 0.5 * (SHEET.forces_at(14.0) + SHEET.forces_at(16.0))
    assert found == pytest.approx(np.interp(commands, SHEET.commands, mean), abs=1e-9)
    back = evaluate(made.commands_for, found, made.nominal)
    assert back == pytest.approx(commands, abs=1e-6)
    assert made.no_signal == 0.0


def test_a_battery_sags_as_the_root_of_its_equation():
    made, draws = eight(voltage=16.8, resistance=0.03), np.random.default_rng(3)
    for _ in range(8):
        commands = draws.uniform(1100, 1900, 8)

        def gap(V, commands=commands):
            return 16.8 - 0.03 * np.sum(np.interp(commands, SHEET.commands, SHEET.currents_at(V))) - V

        exact = float(brentq(gap, 5.0, 17.0))  # pyright: ignore[reportArgumentType]
        loaded, current = SHEET.supplied(commands, 16.8, 0.03)
        assert loaded == pytest.approx(exact, abs=0.01)
        assert np.sum(current) == pytest.approx((16.8 - exact) / 0.03, rel=0.01)
        thrusts = evaluate(made.thrusts, commands, made.nominal)
        assert thrusts == pytest.approx(np.interp(commands, SHEET.commands, SHEET.forces_at(loaded)), abs=1e-9)
    rest = evaluate(made.thrusts, np.full(8, 1500.0), made.nominal)
    assert np.all(rest == 0) and SHEET.supplied(np.full(8, 1500.0), 16.8, 0.03)[0] == 16.8


def test_the_most_thrust_is_commanded_to_the_limit_though_the_battery_sags():
    made = eight(voltage=14.8, resistance=0.02)
    assert made.allocate([1000.0, 0, 0, 0, 0, 0]) == pytest.approx(1900.0)
    np.testing.assert_allclose(made.extremes, eight(voltage=14.8).extremes)


def test_a_resistance_that_leaves_no_voltage_is_refused_with_its_value_and_unit():
    with pytest.raises(ArgumentError, match=r"`resistance` of the thrusters `thrusters` must .* 20 Ω .* unit mΩ"):
        eight(voltage=14.8, resistance=20.0)
    assert eight(voltage=14.8, resistance=0.09).curve.resistance == 0.09


VOLTAGE = 'voltage = { value = 14.8, unit = "V" }'


def curve_of(vehicle):
    return vehicle.part("thrusters").curve


def rov(curve):
    text = vehicle_text("bluerov2_heavy_von_benzon")
    before, _, rest = text.partition('curve = "T200"\n')
    table, mark, others = rest.partition("\n[[part]]")
    return vehicle_from_text(f"{before}{table}\n[part.curve]\n{curve}\n{mark}{others}", "mine.toml")


def test_a_vehicle_file_gives_voltage_and_resistance_and_is_written_with_them():
    made = rov(f'published = "T200"\n{VOLTAGE}\nresistance = {{ value = 20, unit = "mΩ" }}')
    curve = curve_of(made)
    assert (curve.voltage, curve.resistance) == (14.8, pytest.approx(0.02))
    again = curve_of(vehicle_from_text(vehicle_to_toml(made), "again.toml"))
    assert (again.published, again.voltage, again.resistance) == ("T200", 14.8, pytest.approx(0.02))
    craft = Craft(made)
    told = json.loads(supply(made, craft.replace(thrusters={"curve": {"voltage": 12.0}}).parameters)[SUPPLY])
    assert told == {"thrusters": {"published": "T200", "voltage": 12.0, "resistance": pytest.approx(0.02)}}
    with pytest.raises(ArgumentError, match="published must be one of 'T200'"):
        rov(f'published = "T300"\n{VOLTAGE}')
    with pytest.raises(ArgumentError, match="needs voltage"):
        rov('published = "T200"')


def test_a_mission_sums_what_its_thrusters_draw():
    rov = vehicles.load("bluerov2_heavy_von_benzon")
    told = supply(rov, Craft(rov).parameters)
    time = np.linspace(0.0, 60.0, 61)
    commands = np.full((61, 8), 1500.0)
    commands[:, 0] = 1900.0
    one, zero = np.ones(61), np.zeros((61, 3))
    down, north = np.tile([0.0, 0, 1], (61, 1)), np.tile([1.0, 0, 0], (61, 1))
    held = {"n": zero, "nu": zero, "xi": zero, "a_down": down, "a_north": north, "internal_thrusters": commands}
    made = xarray.Dataset({k: (("time", f"{k}_0"), v) for k, v in held.items()}, {"time": time * one}, told)
    (found,) = electric_summary(made).values()
    assert (found["current_max"], found["current_mean"]) == (pytest.approx(23.83), pytest.approx(23.83))
    assert found["energy"] == pytest.approx(16 * 23.83 * 60)
    assert found["energy_wh"] == pytest.approx(found["energy"] / 3600)
    assert found["charge_ah"] == pytest.approx(23.83 / 60) and found["voltage_min"] == 16.0


def test_a_data_sheet_that_falls_or_pushes_at_rest_is_refused():
    assert sheet_names() == ("T200",)
    commands = np.array([1400, 1500, 1600])
    fields = {"name": "X", "source": "", "command_unit": "µs", "neutral": 1500.0, "commands": commands}
    forces = np.array([[-1.0, 0, 1], [-2, 0, 2]])
    good = {"voltages": np.array([10.0, 12]), "forces": forces, "currents": np.ones((2, 3))}
    DataSheet(**fields, **good)
    for name, wrong in (("forces", forces[:, ::-1]), ("voltages", [12.0, 10]), ("currents", np.ones((1, 3)))):
        with pytest.raises(ArgumentError, match="X must have a row"):
            DataSheet(**fields, **{**good, name: np.asarray(wrong)})
    with pytest.raises(ArgumentError, match="no force at its neutral"):
        DataSheet(**{**fields, "neutral": 1400.0}, **good)


@pytest.mark.parametrize("voltage", [9.0, 21.0])
def test_a_voltage_beyond_the_sheet_is_refused(voltage):
    with pytest.raises(ArgumentError, match="must be from 10 to 20 V, those of its data sheet, but is"):
        eight(voltage=voltage)


def test_a_battery_that_falls_below_the_sheet_has_a_warning_with_its_time():
    commands = np.full((4, 8), 1500.0)
    commands[2:] = 1900.0
    held = {"n": np.zeros((4, 3)), "nu": np.zeros((4, 3)), "xi": np.zeros((4, 3)), "internal_jets": commands}
    held |= {"a_down": np.tile([0.0, 0, 1], (4, 1)), "a_north": np.tile([1.0, 0, 0], (4, 1))}
    dims = {name: ("time", f"{name}_1") for name in held}
    made = xarray.Dataset({k: (dims[k], x) for k, x in held.items()}, coords={"time": np.arange(4.0)})
    for resistance, count in ((0.2, 1), (0.001, 0)):
        told = {"jets": {"published": "T200", "voltage": 14.8, "resistance": resistance}}
        said = beyond_sheet(made.assign_attrs({SUPPLY: json.dumps(told)}))
        assert len(said) == count
        assert all("from t = 2 s on below 10 V, where the data sheet of T200 begins" in one for one in said)
