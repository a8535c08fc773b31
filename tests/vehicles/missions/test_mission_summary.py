"""The figures of a mission are those of its path: lengths, depths, errors within half a turn, energies by part."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray

from coadjoint_vehicles.missions import results
from coadjoint_vehicles.missions.results import astray, left_water, tilted
from coadjoint_vehicles.missions.sections import MissionOutputSection
from coadjoint_vehicles.missions.summary import mission_summary, spread


@pytest.mark.parametrize(("depth", "warns"), [(-0.08, False), (-0.1, True)])
def test_a_vehicle_above_the_surface_by_half_its_height_is_a_warning(depth, warns):
    q = ("time", "axis"), np.array([[0.0, 0.0, 2.0], *[[0.0, 0.0, depth]] * 3])
    said = left_water(
        xarray.Dataset({"q": q}, {"time": np.arange(4.0)}, {"vehicle_length": 1.75, "vehicle_height": 0.17})
    )
    assert bool(said) == warns
    if warns:
        assert "from t = 1 s on by more than half its height, for 75% of the time, up to 0.1 m" in said[0]


def circle(radius=10.0, turns=1.0, nodes=4001):
    """A vehicle on a level circle to starboard at 2 m depth and 1 m/s, told to head 1° more."""
    duration = 2 * np.pi * radius * turns
    time = np.linspace(0, duration, nodes)
    heading = time / radius
    sine, cosine, zero, one = np.sin(heading), np.cos(heading), np.zeros(nodes), np.ones(nodes)
    place = np.stack([radius * sine, radius * (1 - cosine), 2 * one], axis=1)
    columns = [[cosine, sine, zero], [-sine, cosine, zero], [zero, zero, one]]
    R = np.moveaxis(np.array(columns), 2, 0).swapaxes(1, 2)
    held = {
        "n": np.einsum("kji,kj->ki", R, place),
        "nu": np.stack([one, zero, zero], 1),
        "xi": np.stack([zero, zero, one / radius], 1),
        "a_down": R[:, 2],
        "a_north": R[:, 0],
        "inputs_depth": 2.5 * one,
        "inputs_heading": np.angle(np.exp(1j * (heading + np.radians(1.0)))),
        "internal_rudder": np.where(np.arange(nodes) < nodes // 4, 0.25, 0.1),
        "work_rudder": -0.1 * time,
        "work_hull": -time,
        "work_propeller": 1.2 * time,
        "internal_propeller": 10 * one,
    }
    dims = {name: ("time", *(f"{name}_{i}" for i in range(np.ndim(x) - 1))) for name, x in held.items()}
    made = xarray.Dataset({k: (dims[k], x) for k, x in held.items()}, coords={"time": time})
    made["internal_rudder"].attrs.update(low=-0.25, high=0.25, units="rad")
    return made.assign_attrs(seconds=0.01)


def test_a_circle_has_the_length_of_its_rim_and_errors_that_do_not_jump_at_south():
    found = mission_summary(circle())
    rim = 20 * np.pi
    assert found["path_length"] == pytest.approx(rim, rel=1e-6)
    assert found["duration"] == pytest.approx(rim)
    assert found["times_real_time"] == pytest.approx(rim / 0.01)
    assert (found["depth_max"], found["speed_mean"]) == (pytest.approx(2.0), pytest.approx(1.0, rel=1e-6))
    assert found["tracking"]["heading"] == {"error_rms": pytest.approx(1.0), "error_final": pytest.approx(1.0)}
    assert found["tracking"]["depth"]["error_final"] == pytest.approx(0.5)
    assert np.allclose(found["position_final"], [0, 0, 2], atol=1e-9)


def test_energy_is_told_by_part_and_what_actuators_put_in_is_summed():
    found = mission_summary(circle())
    assert found["energy_put_in"]["hull"] == pytest.approx(-20 * np.pi)
    assert found["energy_of_actuators"] == pytest.approx(24 * np.pi)
    assert found["saturated"] == {"rudder": pytest.approx(0.25, abs=1e-3)}


def test_the_path_error_is_the_distance_from_the_nearest_leg():
    legs = circle(turns=0.5).assign_attrs(way_points=[0.0, 20.0, 2.0])
    found = mission_summary(legs)["tracking"]["path"]
    assert found["error_rms"] == pytest.approx(10 / np.sqrt(2), rel=1e-3)
    assert found["error_final"] == pytest.approx(0.0, abs=1e-9)


def test_the_spread_of_a_figure_is_that_of_its_members():
    values = np.arange(101.0)
    found = spread(values)
    assert (found["mean"], found["5%"], found["95%"]) == (50.0, 5.0, 95.0)
    assert found["std"] == pytest.approx(np.std(values, ddof=1))


def rolled(degrees, members=None):
    """Directions of down in the body at some angles of roll."""
    down = np.stack([0 * degrees, np.sin(np.radians(degrees)), np.cos(np.radians(degrees))], axis=-1)
    dims = (*(["member"] if np.ndim(degrees) > 1 else []), "time", "body")
    return xarray.Dataset({"a_down": (dims, down)}, coords={"time": np.arange(degrees.shape[-1], dtype=float)})


class Steered:
    def __init__(self, keeps_level):
        self.keeps_level = keeps_level


def test_a_craft_that_turns_over_though_its_controller_keeps_level_has_a_warning():
    run = rolled(np.array([0.0, 40.0, 70.0, -97.0]))
    (said,) = tilted(run, Steered(True))
    assert said.startswith("The vehicle tilts by up to 97°, from t = 2 s on beyond 60°")
    assert (
        tilted(run, Steered(False)) == tilted(run, None) == tilted(rolled(np.array([0.0, 59.0])), Steered(True)) == []
    )


def test_of_members_that_turn_over_the_count_and_the_worst_are_said():
    (said,) = tilted(rolled(np.array([[0.0, 10.0], [0.0, 80.0], [0.0, 120.0]])), Steered(True))
    assert said.startswith("2 of 3 members, member 2 the most, tilt by up to 120°")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"inputs_depth": 10.0}, ["`depth`: it is 8 m off in the mean, and 8 m at the end"]),
        ({"inputs_speed": -1.0}, ["`speed`: it is 2 m/s off in the mean"]),
        ({"inputs_speed": 1.3, "inputs_depth": 2.9}, []),
    ],
)
def test_a_set_point_that_is_far_off_for_most_of_a_mission_has_a_warning(changes, said):
    made = circle()
    for name, value in changes.items():
        made[name] = ("time", np.full(made.sizes["time"], value))
    found = astray(made)
    assert len(found) == len(said) and all(part in one for part, one in zip(said, found, strict=True))
    turned = made.assign(inputs_heading=made.inputs_heading + np.pi)
    assert any("`heading`: it is 179° off" in one for one in astray(turned))
    assert astray(turned.assign_attrs(trial="{}")) == [] and not any("larger gains" in one for one in astray(turned))
    calm = turned.copy()
    calm["internal_rudder"] = turned.internal_rudder.copy(data=np.full(turned.sizes["time"], 0.1))
    assert any("larger gains of the controller may hold it" in one for one in astray(calm))


def test_figures_of_very_many_members_hold_the_first_the_last_and_even_ones_between(monkeypatch):
    monkeypatch.setattr(results, "available", lambda dataset: ())
    monkeypatch.setattr(results, "save_figures", lambda datasets, *_: datasets)
    members = xarray.Dataset(coords={"member": np.arange(10 * results.MOST_DRAWN)})
    (drawn,) = results.figures(MissionOutputSection(figures=True), Path("out"), members)
    assert drawn.member.values[[0, -1]].tolist() == [0, 10 * results.MOST_DRAWN - 1]
    assert len(drawn.member) == results.MOST_DRAWN and set(np.diff(drawn.member)) <= {10, 11}
