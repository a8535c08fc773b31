"""Actuators at their limits, and what is lost there."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from coadjoint.spaces.named import Named, named
from coadjoint_vehicles import Craft, Vehicle
from coadjoint_vehicles.model.saturation import at_limits, lost, saturated, short
from coadjoint_vehicles.parts import Thrusters

PAIR = Thrusters("pair", {"linear": 1.0}, positions=np.eye(3)[:2], directions=np.eye(3)[:2], limit=[[-2, 0], [2, 3]])


def test_a_thruster_that_pushes_one_way_is_not_at_a_limit_at_rest():
    values = np.array([[0.0, 0.0], [2.0, 1.0], [-2.0, 0.0], [1.0, 3.0], [1.9, 2.9]])
    np.testing.assert_array_equal(at_limits(values, PAIR.limit, True), [False, True, True, True, False])


def test_a_command_at_a_limit_or_beyond_counts_though_the_actuator_lags_behind():
    pushed = np.where(np.arange(10)[:, None] % 4 < 2, [5.0, 0.0], [-5.0, 0.0])
    value = {"pair": pushed, "memory": {"lost": np.zeros((10, 6))}}
    one = named({"pair": np.zeros((10, 2)), "controller": {"value": value}})
    assert "for 100% of the time" in next(saturated((PAIR,), {"pair": PAIR.limit}, [one]))


def test_the_absence_of_pulses_is_no_limit():
    part = Thrusters("jets", "T200", positions=np.eye(3), directions=np.eye(3), unit="µs")
    value = {"jets": np.zeros((10, 3)), "memory": {}}
    one = named({"jets": np.full((10, 3), 1500.0), "controller": {"value": value}})
    assert not list(saturated((part,), {"jets": part.limit}, [one]))


@pytest.mark.parametrize("at_the_helm", [False, True])
def test_what_thrusters_lack_counts_though_none_is_at_a_limit_but_0(at_the_helm):
    """A pair that pushes ahead only brakes by nothing; guidance keeps the memory of its helm within its own."""
    lost = {"lost": np.where(np.arange(10)[:, None] < 3, [-4.0, 0, 0, 0, 0, 0], 1e-12)}
    value = {"pair": np.zeros((10, 2)), "memory": {"helm": lost} if at_the_helm else lost}
    one = named({"pair": np.zeros((10, 2)), "controller": {"value": value}})
    (said,) = saturated((PAIR,), {"pair": PAIR.limit}, [one])
    assert "for 30% of the time; it lacks 1.2 N of surge" in said


def test_of_each_axis_the_mean_and_the_largest_loss_is_told():
    found = lost(np.array([[1.0, 0, 0, 0, 0, -4], [-3.0, 0, 0, 0, 0, 0]]))
    assert found["surge"] == {"mean": 2.0, "max": 3.0} and found["yaw"] == {"mean": 2.0, "max": 4.0}


def internal(values: np.ndarray, steered: bool = True) -> Named:
    memory = {"lost": np.where(np.any(values >= 2, axis=1)[:, None], [1.5, 0, 0, 0, 0, 0], 0.0)}
    value = {"pair": values, "memory": memory} if steered else {"memory": memory}
    return named({"pair": values, "controller": {"value": value}})


@pytest.mark.parametrize(("often", "warns"), [(1, False), (2, True), (10, True)])
def test_more_than_a_tenth_of_the_time_at_a_limit_is_a_warning_with_the_loss(often, warns):
    values = np.where(np.arange(10)[:, None] < often, [2.0, 1.0], [0.5, 0.5])
    said = list(saturated((PAIR,), {"pair": PAIR.limit}, [internal(values[:4]), internal(values[4:])]))
    assert bool(said) == warns
    if warns:
        assert (
            f"`pair` is at its limits for {10 * often}% of the time; it lacks {0.15 * often:.3g} N of surge" in said[0]
        )


def test_a_part_that_no_controller_steers_is_not_judged():
    assert not list(saturated((PAIR,), {"pair": PAIR.limit}, [internal(np.full((5, 2), 2.0), steered=False)]))


def test_of_an_ensemble_the_worst_member_is_named():
    values = np.zeros((10, 3, 2))
    values[:, 1:], values[5:, 2] = 2.0, 0.0
    memory = {"lost": np.zeros((10, 3, 6))}
    one = named({"pair": values, "controller": {"value": {"pair": values, "memory": memory}}})
    (said,) = saturated((PAIR,), {"pair": PAIR.limit}, [one])
    assert said.startswith("Of member 1, and of 1 others of 3, `pair` is at its limits for 100%")


@pytest.mark.long
def test_runs_on_disk_warn_as_those_in_memory_do(tmp_path):
    import coadjoint as co
    from coadjoint_vehicles.parts import Damping

    part = Thrusters("jets", {"linear": 1.0}, positions=np.eye(3), directions=np.eye(3), limit=2.0)
    body = {"mass": 10.0, "inertia": (1, 1, 1), "added_mass": (1, 1, 1, 0.1, 0.1, 0.1)}
    box = Vehicle(name="box", **body, parts=(part, Damping("damping", quadratic=(9, 9, 9, 9, 9, 9))))  # pyright: ignore
    craft = Craft(box, controller=lambda feedback, p: {"jets": np.array([5.0, 0.0, 0.0])})
    said = []
    for store in (None, tmp_path / "run"):
        given = {} if store is None else {"store": store}
        run = co.simulate(craft.system, craft.start(), dt=0.1, duration=2, **given)
        said.append([w for w in run.warnings if "at its limits" in w])
    assert len(said[0]) == 1 and said[1] == said[0]


def test_thrusters_that_the_controller_holds_back_are_not_said_to_be_at_their_limits():
    memory = {"lost": np.tile([4.0, 0, 0, 0, 0, 0], (10, 1))}
    one = named({"pair": np.ones((10, 2)), "controller": {"value": {"pair": np.ones((10, 2)), "memory": memory}}})
    (said,) = saturated((PAIR,), {"pair": PAIR.limit}, [one])
    assert said.startswith("`pair` gives less than the controller asks for, though not at its limits, for 100% of the")
    assert "it lacks 4 N of surge" in said and "surge_limit" in said


def test_what_rounding_about_a_dead_band_takes_is_no_lack():
    banded = replace(PAIR, dead_band=0.5)
    edge = np.abs(PAIR.curve.force(0.5, named(PAIR.curve.parameters())))
    assert np.allclose(banded.edges, [[-edge] * 2, [edge] * 2])
    for share, expected in ((0.9, False), (1.1, True)):
        assert short(share * banded.rounding[None], banded.rounding)[0] == expected


def test_limits_of_each_thruster_are_lists_which_every_format_of_attributes_takes():
    part = Thrusters("jets", {"linear": 1.0}, positions=np.eye(3), directions=np.eye(3), limit=[[-1, -1, 0], [1, 1, 1]])
    body = {"mass": 10.0, "inertia": (1, 1, 1), "added_mass": (1, 1, 1, 0.1, 0.1, 0.1)}
    craft = Craft(Vehicle(name="box", **body, parts=(part,)))  # pyright: ignore[reportArgumentType]
    ends = craft.system.internal.limits(craft.parameters)
    assert json.loads(json.dumps(ends)) == {"jets": [[-1, -1, 0], [1, 1, 1]]}
