"""Logs that a model cannot explain: a current that it lacks, a value that is wild, a pause of an hour."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.torpedo import NOISE

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.identification import Log, identify, kinematics, merged, synthetic_log
from coadjoint.identification.commands import with_current
from coadjoint.spaces import Named
from coadjoint_vehicles import Craft, load
from coadjoint_vehicles.logs import read_log, write_log
from coadjoint_vehicles.water import UniformWater

CURRENT = np.array([0.15, -0.1, 0.0])


@pytest.fixture(scope="module")
def drift() -> tuple[Any, Any, Any]:
    """A REMUS 100 in still water as a model; its start, and a run of 12 s in a current."""
    craft = Craft(load("remus_100"), water=UniformWater(CURRENT))
    t = np.arange(0.0, 12.0, 0.1)
    commands = {"rudder": 0.15 * np.sign(np.sin(1.3 * t) + 1e-9), "stern_planes": 0.1 * np.sin(0.9 * t)}
    commands["propeller"] = 18 + 4 * np.sign(np.sin(2 * t) + 1e-9)
    start = craft.start(position=(0, 0, 20), speed=1.5, actuators={"propeller": 18.0})
    inputs = {name: co.Held(t, values) for name, values in commands.items()}
    run = co.simulate(
        craft.system, start, dt=0.05, duration=11.9, inputs=inputs, save_every=2, monitors=False, progress=False
    )
    return Craft(load("remus_100")), start, run


@pytest.fixture
def table(drift, tmp_path):
    drift[2].save(tmp_path / "drift.csv")
    return tmp_path / "drift.csv"


def test_a_current_that_the_model_lacks_is_sought_as_well(drift, table):
    craft, _, _ = drift
    log = read_log(table)
    np.testing.assert_allclose(np.stack(list(log.current.values())).T, np.tile(CURRENT, (len(log), 1)))
    sought, (note,) = with_current(craft.system, log, ["hull.axial_drag"], [])
    assert sought == ["hull.axial_drag", "water.velocity[0]", "water.velocity[1]"]
    assert "a current of 0.18 m/s" in note and "water.velocity[0] and water.velocity[1] are estimated as well" in note
    sinking = replace(log, current={**log.current, "down": log.current["down"] + 0.05})
    assert with_current(craft.system, sinking, ["hull"], [])[0][-1] == "water.velocity[2]"


def test_a_level_current_of_the_model_is_one_without_a_part_downwards():
    log = Log(np.arange(3.0), {"u": np.ones(3)}, current={"north": np.full(3, 0.2), "east": np.full(3, 0.1)})
    system: Any = SimpleNamespace(parameters=Named(water=Named(velocity=np.array([0.2, 0.1]))))
    assert with_current(system, log, ["drag"], []) == (["drag"], [])


def test_a_current_that_is_not_steady_is_an_error_which_says_how_to_seek_it(drift, table):
    craft, start, _ = drift
    log = read_log(table)
    turning = replace(log, current={**log.current, "east": 0.2 * np.sin(log.time)})
    words = r"a current of 0\.2\d* m/s .*the water of the model moves at 0, 0, 0 m/s.*process_noise.*ignore=\["
    with pytest.raises(ArgumentError, match=words):
        identify(craft.system, turning, start=start, parameters=["hull.axial_drag"], dt=0.05)


@pytest.mark.long
def test_a_current_that_the_log_has_is_found_from_two_runs(drift, table):
    craft, start, _ = drift
    log = read_log(table)
    halves = [log.between(0.0, 5.9), log.between(6.0, 12.0)]
    found = identify(craft.system, halves, start=start, parameters=["hull.axial_drag"], dt=0.05)
    assert found.segments == 2
    for name, value in zip(
        ("hull.axial_drag", "water.velocity[0]", "water.velocity[1]"), (0.42, *CURRENT[:2]), strict=True
    ):
        assert abs(found[name].value - value) < 1e-4
    assert any("are estimated as well" in sentence for sentence in found.warnings)


def test_merged_logs_stand_in_a_row_with_a_break_between_them(drift, table):
    log = read_log(table)
    first, second = log.between(0.0, 4.9), log.between(3.0, 8.0)
    lacking = replace(second, columns={name: value for name, value in second.columns.items() if name != "u"})
    both = merged([first, lacking])
    assert both.breaks == (len(first),) and len(both) == len(first) + len(second)
    assert np.allclose(np.diff(both.time), 0.1)
    assert np.array_equal(both.columns["depth"], np.concatenate([first.columns["depth"], second.columns["depth"]]))
    assert np.all(np.isnan(both.columns["u"][len(first) :])) and np.all(np.isfinite(both.columns["u"][: len(first)]))
    assert np.array_equal(both.inputs["rudder"][len(first) :], second.inputs["rudder"])
    assert [len(one) for one in both.stretches()] == [len(first), len(second)]
    with pytest.raises(ArgumentError, match="log 2 has none and the first"):
        merged([first, replace(second, inputs={})])
    with pytest.raises(ArgumentError, match="make, or a list of them, but is"):
        merged([])


@pytest.mark.parametrize("end", ["csv", "mcap"])
def test_the_current_of_a_run_is_in_its_log_whatever_the_format(drift, tmp_path, end):
    if end == "mcap":
        pytest.importorskip("mcap")
    drift[2].save(tmp_path / f"drift.{end}")
    log = read_log(tmp_path / f"drift.{end}")
    assert list(log.current) == ["north", "east", "down"]
    np.testing.assert_allclose(np.stack(list(log.current.values())).T, np.tile(CURRENT, (len(log), 1)), atol=1e-12)
    write_log(log, tmp_path / f"again.{end}")
    again = read_log(tmp_path / f"again.{end}").current
    np.testing.assert_allclose(again["east"], log.current["east"], atol=1e-12)
    assert not read_log(tmp_path / f"drift.{end}", ignore=[f"current_{name}" for name in log.current]).current


def test_a_current_that_the_model_has_or_that_is_left_out_is_not_sought(drift, table):
    craft, _, _ = drift
    log, still = read_log(table), craft.system
    same = still.replace(water={"velocity": CURRENT})
    calm = replace(log, current={name: 0 * values for name, values in log.current.items()})
    assert with_current(same, log, ["hull"], []) == (["hull"], [])
    assert with_current(still, calm, ["hull"], []) == (["hull"], [])
    assert with_current(still, log, ["water.velocity[0]"], []) == (["water.velocity[0]"], [])
    assert with_current(still, log, ["hull"], ["water.velocity"]) == (["hull"], [])
    assert not read_log(table, ignore=["current_north", "current_east", "current_down"]).current


@pytest.mark.parametrize("current", [{"north": [np.nan] * 120}, {"up": [0.1] * 120}])
def test_a_current_without_numbers_or_of_another_name_is_refused(drift, current):
    with pytest.raises(ArgumentError, match="current"):
        Log(0.1 * np.arange(120), {"u": np.zeros(120)}, current=current)


def test_a_log_with_a_wild_value_is_refused_by_row_and_column(drift):
    craft, start, run = drift
    log = synthetic_log(run, noise=NOISE, seed=1)
    north = log.columns["north"].copy()
    north[30] = 1e6
    wild = replace(log, columns={**log.columns, "north": north})
    with pytest.raises(ArgumentError, match=r"`north` is 1e\+06 in row 31, at 3 s, between .* leave that value out"):
        identify(craft.system, wild, start=start, parameters=["hull.axial_drag"])


@pytest.mark.long
@pytest.mark.parametrize("segment", [pytest.param(None, marks=pytest.mark.long), 10.0])
def test_stretches_of_a_log_are_fitted_together_over_a_jump_of_the_clock(drift, segment):
    """Also as one run, which would else go through the pause."""
    craft, start, run = drift
    log = synthetic_log(run, noise=NOISE, seed=2)
    time = log.time + np.where(np.arange(len(log)) >= 60, 3600.0, 0.0)
    split = replace(log, time=time, breaks=(60,))
    same = craft.system.replace(water={"velocity": CURRENT})
    found = identify(same, split, start=start, parameters=["hull.axial_drag"], segment=segment, dt=0.05)
    assert found.segments == 2
    assert abs(found["hull.axial_drag"].value - 0.42) < 4 * found["hull.axial_drag"].standard_error < 0.02


@pytest.mark.parametrize("more", [0, 1])
def test_intervals_between_places_count_where_speeds_are_known_on_both_sides(more):
    """x = 3 ∫v dt: with LEAST such intervals, one of which ends at the last speed, the slope is known."""
    t = np.arange(kinematics.LEAST + 1.0)
    v = np.sin(t)
    x = 3 * np.append(0.0, np.cumsum((v[1:] + v[:-1]) / 2))
    place = np.append([7.0, *x], 40.0)  # before and after all speeds
    time = np.concatenate([[-1.0], t, [t[-1] + 1]])
    speed = np.concatenate([[np.nan], v, [np.nan]])
    if more == 0:
        place[2] = np.nan  # one interval less
    b, correlation = kinematics._slope(time, [place], [speed])
    assert (b, correlation) == (pytest.approx((3.0, 1.0), rel=1e-12) if more else (0.0, 0.0))


def test_the_velocity_in_space_is_that_of_the_body_turned_by_roll_pitch_and_heading():
    draw = np.random.default_rng(8).normal
    velocity, angles = draw(size=(3, 5)), 0.5 * draw(size=(3, 5))
    columns = dict(zip(("u", "v", "w", "roll", "pitch", "heading"), [*velocity, *angles], strict=True))
    found = kinematics._in_space(np.arange(5.0), columns)
    turned = Rotation.from_euler("ZYX", angles[::-1].T).apply(velocity.T)
    np.testing.assert_allclose(np.stack([found[name] for name in ("north", "east", "depth")], 1), turned, atol=1e-15)
