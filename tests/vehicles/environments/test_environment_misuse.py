"""What goes wrong with environments is one sentence each."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from coadjoint.errors import ArgumentError, CoadjointError
from coadjoint_vehicles.environments import HoldStation, actions, environment, vector_environment
from coadjoint_vehicles.environments.actions import Actions

NAME = "bluerov2_heavy_von_benzon"


@pytest.mark.cases(12)
@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"task": "hold_statoin"}, "did you mean `hold_station`"),
        ({"task": 3}, "must be a Task or one of"),
        ({"actions": "torques"}, '"actuators" or "set_points"'),
        ({"bounds": {"depth": (0, 1)}}, 'is for actions="set_points"'),
        ({"actions": "set_points", "bounds": {"depht": (0, 1)}}, "no set point `depht`"),
        ({"actions": "set_points", "bounds": {"depth": (1, 0)}}, "the lower one first"),
        ({"actions": "set_points", "bounds": 3}, "name → \\(lowest, highest\\)"),
        ({"observe": ("offset", "velocty")}, "did you mean `velocity`"),
        ({"observe": ()}, "must be names"),
        ({"observe": {"deep": 3.0}}, "must be a name or a function"),
        ({"reward": 3.0}, "Argument `reward` must be a function"),
        ({"ends": [1]}, "name → function"),
        ({"ends": {"late": 3.0}}, "must be a function of the Feedback"),
        ({"period": 0.12}, "whole number of times `dt`"),
        ({"period": -0.1}, "positive number of seconds"),
        ({"seconds": 0.25}, "whole number of times `period`"),
        ({"render_mode": "human"}, '"rgb_array" or None'),
        ({"randomise": True}, "states no uncertainties"),
        ({"randomise": "all"}, "True, False, or path"),
        ({"randomise": {"weight": "2 %"}}, "no parameter `weight`"),
        ({"randomise": {"mass": "2 percent"}}, 'a share such as "5 %"'),
        ({"randomise": {"mass": -1.0}}, "at least 0"),
        ({"randomise": {"mass": 0.1}, "randomise_seed": 1.5}, "`randomise_seed` must be a whole number"),
        ({"task": "cross_current", "randomise": {"water.velocity": 0.1}}, "draws `water.velocity` itself"),
        ({"controller": "hover", "actions": "set_points"}, "must be a Controller"),
    ],
)
def test_a_mistake_is_one_sentence(given, sentence):
    with pytest.raises(ArgumentError, match=sentence) as raised:
        environment(NAME, **given)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"reward": lambda f: f.velocity}, r"The reward must return one number, but returns the shape \(3,\)"),
        ({"ends": {"deep": lambda f: f.depth}}, r"The end `deep` must return one truth value, but returns a number"),
    ],
)
def test_a_reward_is_one_number_and_an_end_is_true_or_false(given, sentence):
    with pytest.raises(CoadjointError, match=sentence):
        environment(NAME, **given)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"num_envs": 0}, "`num_envs` must be"),
        ({"num_envs": 2, "autoreset": "never"}, '"next_step", "same_step" or "disabled"'),
        ({"num_envs": 2, "reword": None}, "did you mean `reward`"),
        ({"num_envs": 2, "threads": 0}, "`threads` must be"),
    ],
)
def test_a_mistake_of_a_vector_environment_is_one_sentence(given, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        vector_environment(NAME, **given)


@pytest.fixture(scope="module")
def env():
    return environment(NAME)


def test_actions_and_resets_are_checked(env):
    env.reset(seed=1)
    for action, sentence in (
        (np.zeros(7), "shape \\(8,\\)"),
        (np.full(8, np.nan), "must be finite"),
        ("ahead", "must be numbers"),
        (0.5, "must be numbers of shape"),
    ):
        with pytest.raises(ArgumentError, match=sentence):
            env.step(action)
    before = env.stepper.state.q
    assert np.array_equal(env.stepper.state.q, before)
    for options, sentence in (
        ({"strat": {}}, "no key `strat`"),
        ({"start": 3}, "must be a dictionary"),
        ({"start": {"place": (0, 0, 0)}}, "no key `place`"),
        ({"start": {"position": (0, 0)}}, "three finite numbers"),
        ({"start": {"speed": 1, "velocity": (1, 0, 0)}}, "not both"),
    ):
        with pytest.raises(ArgumentError, match=sentence):
            env.reset(options=options)
    with pytest.raises(ArgumentError, match="`seed` must be"):
        env.reset(seed=-3)


def test_an_action_of_0_is_neutral_where_the_travel_is_uneven():
    uneven = Actions({"a": (2,)}, {"a": "m"}, np.array([-1.0, 0.0]), np.array([1.0, 1.0]), np.array([2.0, 5.0]))
    found = [uneven.commands([a, a], ()).tolist() for a in (-3.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0)]
    assert found == [[-1, 0], [-1, 0], [0, 0.5], [1, 1], [1.5, 3], [2, 5], [2, 5]]
    assert str(uneven) == "0: a[1] (m) at −1, 0, 1: -1, 1, 2\n1: a[2] (m) at −1, 0, 1: 0, 1, 5"


@pytest.mark.long
def test_nothing_is_stepped_before_the_first_reset():
    env = environment(NAME)
    with pytest.raises(ArgumentError, match="call reset"):
        env.step(np.zeros(8))
    many = vector_environment(NAME, num_envs=3)
    with pytest.raises(ArgumentError, match="call reset"):
        many.step(np.zeros((3, 8)))
    for mask in ([True, False, True], np.ones(2, bool)):
        with pytest.raises(ArgumentError, match="`reset_mask` must be"):
            many.reset(options={"reset_mask": mask})
    with pytest.raises(ArgumentError, match="first reset"):
        many.reset(options={"reset_mask": np.array([True, False, True])})
    with pytest.raises(ArgumentError, match="one for each of 3"):
        many.reset(seed=[1, 2])


def test_a_reward_that_is_not_finite_is_named(env):
    with pytest.raises(CoadjointError, match=r"not finite|must be finite"):
        mad = environment(NAME, HoldStation(), reward=lambda feedback: 1.0 / feedback.velocity[0])
        mad.reset(seed=1)


@pytest.mark.long
def test_without_gymnasium_the_library_is_whole_and_an_environment_says_what_to_install():
    script = f"""
import sys
from types import SimpleNamespace
from typing import Any
sys.modules["gymnasium"] = None
import coadjoint as co
assert co.vehicles.names()
try:
    co.vehicles.environment({NAME!r})
except co.errors.ArgumentError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert 'pip install "coadjoint-vehicles[learn]"' in done.stdout


# actions by themselves


def test_an_actuator_that_starts_outside_of_its_travel_has_its_middle_at_0():
    parts = {
        "fin": ((-0.5, 0.25), 0.0, "rad"), "screw": ((10.0, 30.0), 0.0, "rev/s"), "tank": ((-3.0, -1.0), 0.0, "m"),
    }  # fmt: skip
    commanded = [
        SimpleNamespace(
            name=name,
            title=f"`{name}",
            command=SimpleNamespace(shape=(), start=start, unit=unit),
            travel=lambda own: own,
        )
        for name, (_, start, unit) in parts.items()
    ]
    craft: Any = SimpleNamespace(
        vehicle=SimpleNamespace(name="boat", commanded=commanded),
        parameters=SimpleNamespace(**{name: ends for name, (ends, *_) in parts.items()}),
    )
    made = actions.actuator_actions(craft)
    assert (made.low.tolist(), made.middle.tolist(), made.high.tolist()) == (
        [-0.5, 10, -3],
        [0, 20, -2],
        [0.25, 30, -1],
    )
    assert str(made).splitlines()[1] == "1: screw (rev/s) at −1, 0, 1: 10, 20, 30"
    craft.parameters.fin = None
    with pytest.raises(ArgumentError, match="of boat has no limit"):
        actions.actuator_actions(craft)
    craft.vehicle.commanded = []
    with pytest.raises(ArgumentError, match="has no actuators"):
        actions.actuator_actions(craft)


def test_set_points_are_scaled_between_their_bounds():
    low, middle, high = actions._bounds({"depth": "m", "speed": "m/s"}, {"depth": (2.0, 5.0), "speed": (-1.0, 3.0)})
    assert (low.tolist(), middle.tolist(), high.tolist()) == ([2, -1], [3.5, 1], [5, 3])
    for bounds, told in (({}, "no bounds to scale"), ({"depth": (5.0, 2.0)}, "the lower one first"),
                         ({"depth": "deep"}, "two numbers"), ({"depth": (2.0, 2.0)}, "two numbers"),
                         ({"depth": (0.0, np.inf)}, "two numbers")):  # fmt: skip
        with pytest.raises(ArgumentError, match=told):
            actions._bounds({"depth": "m"}, bounds)
