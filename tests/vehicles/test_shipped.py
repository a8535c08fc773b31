"""Shipped vehicles: all load, each number knows where it is from, and they are what their sources say."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.models.underwater import REMUS_100, load_vehicle, vehicle_names


@pytest.mark.parametrize("name", vehicle_names())
def test_every_number_of_a_shipped_vehicle_names_its_source(name: str) -> None:
    vehicle = load_vehicle(name)
    assert vehicle.name and vehicle.description
    nameless = [key for key, found in vehicle.provenance.items() if not found.source or not found.unit]
    assert nameless == []
    assert all(len(citation) > 20 for citation in vehicle.sources.values())


def test_remus_from_its_file_has_the_numbers_of_the_model() -> None:
    vehicle = load_vehicle("remus_100")
    assert vehicle.warnings == ()
    for key in ("mass", "center_of_mass", "center_of_buoyancy", "gravity", "fluid_density", "length", "diameter"):
        assert getattr(vehicle, key) == pytest.approx(REMUS_100[key], rel=1e-14, abs=1e-17), key
    assert np.diag(vehicle.inertia) == pytest.approx(REMUS_100["inertia"], rel=1e-15)
    assert np.diag(vehicle.added_mass) == pytest.approx(REMUS_100["added_mass"], rel=1e-15)
    assert vehicle.buoyancy == pytest.approx(REMUS_100["buoyancy"], rel=1e-14)
    for part, key, other in [
        ("damping", "linear", "damping"),
        ("damping", "fading", "fading"),
        ("hull", "axial_drag", "axial_drag"),
        ("hull", "crossflow_drag", "crossflow_drag"),
        ("rudder", "area", "fin_area"),
        ("stern_planes", "lift_slope", "fin_lift_slope"),
        ("rudder", "stall", "fin_stall"),
        ("rudder", "limit", "fin_limit"),
        ("stern_planes", "lag", "fin_lag"),
        ("propeller", "thrust", "thrust"),
        ("propeller", "torque", "torque"),
        ("propeller", "limit", "revolutions_limit"),
    ]:
        assert getattr(vehicle.part(part), key) == pytest.approx(REMUS_100[other], rel=1e-14), (part, key)
    assert 1 - vehicle.part("propeller").wake_fraction == pytest.approx(REMUS_100["advance"])
