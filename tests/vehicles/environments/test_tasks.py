"""The tasks: what they reward, by formulas in NumPy, where they begin and how they end."""

from __future__ import annotations

from itertools import pairwise

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from coadjoint.errors import ArgumentError
from coadjoint_vehicles.environments import CrossCurrent, FollowPath, environment
from coadjoint_vehicles.environments.task import End
from coadjoint_vehicles.water import UniformWater

NAME = "bluerov2_heavy_von_benzon"
MOVING = {"euler_zyx": (0.3, 0.1, -0.2), "velocity": (0.4, 0.1, 0.2), "angular_velocity": (0.1, 0.2, 0.3)}


def where(env) -> tuple[np.ndarray, np.ndarray]:
    """q and R."""
    state = env.stepper.state
    return np.asarray(state.q), np.asarray(state.g)


def effort(env, row: np.ndarray) -> float:
    return 0.05 * float(np.mean(row[env.fields["actuators"]] ** 2))


@pytest.mark.long
def test_following_a_path_is_rewarded_along_its_nearest_leg():
    points = np.array([[0, 0, 5.0], [8, 0, 5.0], [8, 8, 6.0]])
    env = environment(NAME, FollowPath(points=points, far=30.0, seconds=20.0))

    def formula(q, R, row):
        found = []
        for start, end in pairwise(points):
            for share in np.linspace(0, 1, 20001):  # the foot point by trial
                found.append((np.linalg.norm(start + share * (end - start) - q), tuple(end - start)))
        distance, way = min(found)
        along = np.array(way) / np.linalg.norm(way)
        made_good = R @ row[env.fields["ground_velocity"]] @ along
        return min(made_good, 0.5) / 0.5 - distance / 30.0

    env.reset(seed=0)
    for position in ((3.0, 1.0, 4.0), (9.0, 5.0, 7.0), (-2.0, 0.5, 5.0)):
        env.reset(options={"start": {"position": position, **MOVING}})
        row, reward, *_ = env.step(np.full(8, 0.2))
        assert reward == pytest.approx(formula(*where(env), row) - effort(env, row), rel=1e-6)
    env.reset(options={"start": {"position": (8.0, 7.3, 6.0)}})
    assert env.step(np.zeros(8))[2:] == (True, False, {"end": "arrived", "is_success": True})


@pytest.fixture(scope="module")
def crossing():
    return environment(NAME, CrossCurrent(place=(6.0, 8.0, 5.0)))


@pytest.mark.long
def test_every_episode_has_a_current_of_its_own_across_the_way(crossing):
    crossing.reset(seed=3)
    found = []
    for _ in range(30):
        row, _ = crossing.reset()
        current = np.asarray(crossing.stepper.parameters.water.velocity)
        found.append(current)
        state = crossing.stepper.state
        assert np.allclose(state.qdot, current, rtol=0, atol=1e-12)
        drift = where(crossing)[1] @ row[crossing.fields["ground_velocity"]]
        assert np.allclose(drift, current, rtol=0, atol=1e-12)
    across = np.array(found) @ [-0.8, 0.6, 0.0]
    assert np.allclose(found, np.outer(across, [-0.8, 0.6, 0.0]))
    assert np.all(np.abs(across) <= 0.4) and len(set(across)) == 30 and across.min() < -0.2 and across.max() > 0.2


@pytest.mark.long
def test_a_vehicle_drifts_with_the_current_of_its_episode(crossing):
    crossing.reset(seed=3)
    current = np.asarray(crossing.stepper.parameters.water.velocity)
    for _ in range(10):
        crossing.step(np.zeros(8))
    assert np.allclose(where(crossing)[0][:2], current[:2] * 1.0, atol=2e-3)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:.*Box observation space m")
def test_set_points_of_a_torpedo_are_actions_and_gymnasium_makes_it_by_its_id():
    import coadjoint_vehicles.environments.ids  # noqa: F401

    env = gymnasium.make("coadjoint/FollowPath-v0", vehicle="remus_100", actions="set_points", bounds={"speed": (1, 2)})
    check_env(env.unwrapped, skip_render_check=True)
    actions = env.unwrapped.actions
    assert list(actions.shapes) == ["depth", "heading", "speed"]
    assert np.allclose(actions.commands([-1.0, 0.0, 0.5], ()), [0.0, 0.0, 1.75])
    env.reset(seed=0)
    env.unwrapped.reset(options={"start": {"position": (0, 0, 5.0), "speed": 1.5}})
    for _ in range(100):
        env.step(np.array([0.0, 0.0, 0.0]))
    state = env.unwrapped.stepper.state
    assert abs(state.q[2] - 5.0) < 0.1 and abs(state.nu[0] - 1.5) < 0.1
    many = gymnasium.make_vec("coadjoint/FollowPath-v0", num_envs=3, vehicle="remus_100")
    assert many.unwrapped.num_envs == 3 and many.action_space.shape == (3, 3)


@pytest.mark.long
def test_a_water_of_ones_own_is_that_of_every_episode():
    env = environment(NAME, CrossCurrent(), water=UniformWater((0.1, 0.2, 0.0)))
    for seed in range(3):
        env.reset(seed=seed)
        assert np.allclose(env.stepper.state.qdot, [0.1, 0.2, 0.0], atol=1e-14)


def test_a_path_needs_two_points_that_differ():
    for points in (((0, 0, 5.0),), ((0, 0, 5.0), (0, 0, 5.0)), "home", ((0, 0), (1, 1))):
        with pytest.raises(ArgumentError, match="Argument `points`"):
            FollowPath(points=points)
    with pytest.raises(ArgumentError, match="above or below"):
        CrossCurrent(place=(0, 0, 8.0))


def test_an_end_has_no_reward_and_is_no_success_unless_it_says_so():
    assert End(bool) == (bool, 0.0, False)
