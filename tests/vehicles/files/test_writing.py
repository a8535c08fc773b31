"""A vehicle that is written and read again is the same vehicle."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

import coadjoint_vehicles as vehicles
from coadjoint.paths import paths
from coadjoint_vehicles import Controller, Vehicle
from coadjoint_vehicles.controllers import Attitude, Cruise
from coadjoint_vehicles.files.file import vehicle_from_text
from coadjoint_vehicles.files.writing import vehicle_to_toml
from coadjoint_vehicles.parts import Fin, Thrusters


def require_same(one: Vehicle, other: Vehicle) -> None:
    for key in ("mass", "inertia", "added_mass", "volume", "center_of_mass", "center_of_buoyancy", "gravity"):
        assert np.array_equal(getattr(one, key), getattr(other, key)), key
    for key in ("fluid_density", "length", "diameter", "name", "description", "note"):
        assert getattr(one, key) == getattr(other, key), key
    assert [type(part) for part in one.parts] == [type(part) for part in other.parts]
    for ours, theirs in zip(one.parts, other.parts, strict=True):
        here, there = paths(ours.parameters()), paths(theirs.parameters())
        assert here.keys() == there.keys()
        for key, value in here.items():
            assert np.array_equal(value, there[key]), (ours.name, key)
        assert ours.command == theirs.command
    assert type(one.controller) is type(other.controller)
    for field in fields(one.controller) if one.controller is not None else ():
        assert np.array_equal(getattr(one.controller, field.name), getattr(other.controller, field.name)), field.name


@pytest.mark.parametrize("name", vehicles.names())
def test_a_shipped_vehicle_that_is_written_reads_as_itself(name: str) -> None:
    vehicle = vehicles.load(name)
    again = vehicle_from_text(vehicle_to_toml(vehicle), "again.toml")
    require_same(vehicle, again)
    assert (again.sources, again.licence, again.licences) == (vehicle.sources, vehicle.licence, vehicle.licences)
    assert [said for said in again.warnings if "no source is given" in said] == []
    assert {key: told.source for key, told in again.provenance.items() if told.source}.items() >= {
        ("body.mass", vehicle.provenance["body.mass"].source)
    }


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("controller", [Cruise(speed=1.2), Attitude()])
def test_a_controller_that_has_been_fitted_is_written_with_its_gains(controller: Controller) -> None:
    vehicle = vehicles.load("remus_100")
    fitted = controller.fitted(vehicle)
    again = vehicle_from_text(vehicle_to_toml(replace(vehicle, controller=fitted)), "again.toml").controller
    assert again is not None
    refitted, before = paths(again.fitted(vehicle).parameters()), paths(fitted.parameters())
    assert refitted.keys() == before.keys()
    for key, value in before.items():
        np.testing.assert_allclose(refitted[key], value, rtol=1e-12, err_msg=key)


def test_a_vehicle_changed_in_python_keeps_its_change() -> None:
    vehicle = vehicles.load("remus_100")
    wing = Fin("wing", position=(0.2, 0, 0), normal=(0, 0, 1), area=0.01, lift_slope=3.0, stall=0.3)
    jets = Thrusters("jets", {"linear": 2.0}, positions=np.eye(3), directions=np.eye(3), limit=5.0)
    changed = replace(vehicle, name="Mine", mass=40.0, parts=(*vehicle.parts, wing, jets))
    again = vehicle_from_text(vehicle_to_toml(changed), "mine.toml")
    require_same(changed, again)
    assert any("wing.position" in sentence for sentence in again.warnings)  # nobody knows where it is from
