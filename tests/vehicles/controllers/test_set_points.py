"""Set points of a wrong sign, unit or shape are an error or a warning before a run."""

from functools import lru_cache

import coadjoint.vehicles as vehicles
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.mechanics import Signal
from coadjoint_vehicles.controllers import Attitude, Cruise, LineOfSight, Manoeuvre, Pose, Sawtooth
from coadjoint_vehicles.model.set_points import doubts_of_set_points

KINDS = {
    "cruise": Cruise(speed=1.2),
    "pitch": Cruise(speed=1.2, vertical="pitch"),
    "altitude": Cruise(speed=1.2, vertical="altitude", bottom=30.0),
    "attitude": Attitude(speed=1.2),
    "pose": Pose(),
    "manoeuvre": Manoeuvre(),
    "sawtooth": Sawtooth(volume=1e-3, pitch=0.4),
    "legs": LineOfSight(way_points=[[0, 0, 5], [50, 0, 5]], helm=Cruise(speed=1.2)),
}
"""Controllers without a vehicle: set points are declared by their class."""

AHEAD = "drives ahead only: give 0 or more"
REFUSED = [
    ("cruise", {"speed": -1.0}, f"`speed` is -1 m/s at t = 0 s, but the controller `Cruise` {AHEAD}"),
    ("cruise", {"speed": co.Held([0.0, 4.0], [1.0, -0.5])}, "`speed` is -0.5 m/s at t = 4 s"),
    ("cruise", {"speed": co.Linear([0.0, 20.0], [1.0, -1.0])}, "`speed` is -1 m/s at t = 20 s"),
    ("cruise", {"speed": Signal(lambda t: 1.0 - jnp.floor(t))}, "`speed` is -1 m/s at t = 2"),
    ("attitude", {"speed": -0.1}, "the controller `Attitude` drives ahead only"),
    ("legs", {"speed": -0.1}, "the controller `LineOfSight` drives ahead only"),
    (
        "pitch",
        {"pitch": -30.0},
        "`pitch` is -30 rad at t = 0 s, but must be from -π/2 to π/2, up positive: is its unit",
    ),
    ("altitude", {"altitude": -3.0}, "`altitude` is -3 m at t = 0 s, but must be 0 or more"),
    ("cruise", {"heading": 1e5}, "`heading` must be of at most 1000 turns"),
    ("pose", {"attitude": 2 * np.eye(3)}, "`attitude` must be a rotation, (3, 3) with RᵀR = 1 and det R = 1"),
    ("pose", {"attitude": co.Held([0.0, 1.0], [np.eye(3), -np.eye(3)])}, "`attitude` must be a rotation"),
    ("sawtooth", {"shallow": 30.0, "deep": 10.0}, "`shallow` must be less than `deep`, 10 m, but is 30 m"),
]

DOUBTED = [
    ("cruise", {"depth": -5.0}, "`depth` is -5 m at t = 0 s, above the surface: depth is positive downwards."),
    ("manoeuvre", {"depth": co.Held([0.0, 3.0], [2.0, -2.0])}, "`depth` is -2 m at t = 3 s, above the surface"),
    ("sawtooth", {"shallow": -2.0, "deep": 10.0}, "`shallow` is -2 m at t = 0 s, above the surface"),
    ("cruise", {"heading": 90.0}, "`heading` is 90 rad at t = 0 s, more than a turn away: is its unit right?"),
    ("manoeuvre", {"heading": co.Held([0.0, 3.0], [0.0, 45.0])}, "`heading` is 45 rad at t = 3 s, more than a turn"),
]

GOOD = [
    ("cruise", {"speed": 0.0, "depth": 0.0, "heading": 2 * np.pi}),
    ("cruise", {"speed": lambda motion: -1.0}),
    ("cruise", {"speed": co.Held([0.0, 30.0], [1.0, -1.0])}),
    ("manoeuvre", {"speed": -0.3, "heading": co.Linear([0.0, 20.0], [0.0, 60.0])}),
    ("manoeuvre", {"heading": co.Held([0.0, 3.0, 6.0], [4.0, 8.0, 12.0])}),
    ("pose", {"attitude": np.asarray(co.attitude.zyx(1.0, 0.2, 3.0))}),
    ("sawtooth", {"shallow": co.Held([0.0, 9.0], [2.0, 20.0]), "deep": co.Held([0.0, 9.0], [10.0, 40.0])}),
]


@pytest.mark.parametrize(("kind", "given", "words"), REFUSED)
def test_a_set_point_that_a_controller_cannot_follow_is_an_error(kind, given, words):
    with pytest.raises(ArgumentError) as caught:
        doubts_of_set_points(KINDS[kind], given, 0.0, 20.0)
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(("kind", "given", "words"), DOUBTED)
def test_a_set_point_whose_sign_or_unit_looks_wrong_is_doubted(kind, given, words):
    (doubt,) = doubts_of_set_points(KINDS[kind], given, 0.0, 20.0)
    assert words in doubt


@pytest.mark.parametrize(("kind", "given"), GOOD)
def test_other_set_points_pass(kind, given):
    assert doubts_of_set_points(KINDS[kind], given, 0.0, 20.0) == []


@lru_cache
def craft():
    return vehicles.Craft(vehicles.load("bluerov2_heavy_blue"), controller=Manoeuvre())


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"heading": 7e3}, "`heading` must be of at most 1000 turns"),
        ({"speed": np.nan}, "Argument `inputs` under 'speed' must be finite, but is nan."),
        ({"depth": np.inf}, "Argument `inputs` under 'depth' must be finite, but is inf."),
    ],
)
def test_a_run_refuses_set_points_before_its_first_step(given, words):
    made = craft()
    with pytest.raises(ArgumentError) as caught:
        co.simulate(
            made.system, made.start(), dt=0.05, steps=2, inputs={"depth": 5.0, "heading": 0.0, "speed": 0.3} | given
        )
    assert words in str(caught.value)


@pytest.mark.parametrize("kind", [lambda: Cruise(pitch_limit=20.0), lambda: Sawtooth(volume=1e-3, pitch=25.0)])
def test_angles_of_controllers_are_at_most_a_right_angle(kind):
    with pytest.raises(ArgumentError, match="must be at most a right angle, π/2 rad, but is 2"):
        kind()


def test_way_points_above_the_surface_are_doubted():
    legs = LineOfSight(way_points=[[0, 0, 5], [50, 0, -4]], helm=Cruise(speed=1.2))
    assert legs.doubts(None) == ["A way point is at a depth of -4 m, above the surface: depth is positive downwards."]
