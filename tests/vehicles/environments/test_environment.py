"""One vehicle as a Gymnasium environment: what it shows, rewards and ends, and that it is what Gymnasium expects."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError
from coadjoint_vehicles import Craft
from coadjoint_vehicles.environments import HoldStation
from coadjoint_vehicles.environments.make import environment

NAME = "bluerov2_heavy_von_benzon"
START = {
    "position": (0.5, -0.4, 4.5),
    "euler_zyx": (0.3, 0.1, -0.2),
    "velocity": (0.3, 0.1, 0.2),
    "angular_velocity": (0.1, 0.2, 0.3),
}


@pytest.fixture(scope="module")
def env(optimised):
    return environment(NAME, "hold_station", render_mode=None)


def actions(count: int, size: int = 8) -> np.ndarray:
    return np.random.default_rng(5).uniform(-1, 1, (count, size))


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:.*Box observation space m")
def test_gymnasium_finds_nothing_to_object_to(env):
    check_env(env, skip_render_check=True)


@pytest.mark.long
def test_a_start_is_to_round_off_that_of_the_craft(env):
    env.reset(options={"start": START})
    there = env.stepper.state
    env.stepper.reset(env.simulated.craft.start(**START))
    here = env.stepper.state
    for name in ("g", "n", "mu", "pi", "xi", "nu"):
        assert np.allclose(getattr(here, name), getattr(there, name), rtol=0, atol=1e-14)


@pytest.mark.long
def test_observations_are_to_the_bit_those_of_a_stepper(env):
    env.reset(options={"start": START})
    craft = Craft(vehicles.load(NAME))
    middle = np.full(8, 1500.0)
    stepper = co.Stepper(
        craft.system,
        craft.start(),
        dt=0.05,
        inputs={"thrusters": middle},
        observe={"q": lambda s: s.q, "down": lambda s: s.named.a.down, "thrusters": lambda s: s.internal.thrusters},
    )
    stepper.restore(env.stepper.state)
    for action in actions(20):
        row = env.step(action)[0]
        seen = stepper.step({"thrusters": 1500.0 + 400.0 * action}, n=2)
        assert np.array_equal(row[env.fields["down"]], seen["down"])
        assert np.array_equal(row[env.fields["actuators"]], (seen["thrusters"] - middle) / 400.0)
        assert np.array_equal(env.stepper.state.q, seen["q"])


def test_the_reward_is_that_of_a_formula_in_numpy(env):
    env.reset(options={"start": START})
    for action in actions(20):
        row, reward, *_ = env.step(action)
        state = env.stepper.state
        R, q = np.asarray(state.g), np.asarray(state.q)
        ahead = 0.5 * (1 - R[0, 0]) + 0.5 * (1 - R[2, 2])
        effort = 0.05 * np.mean(((state.internal.thrusters - 1500.0) / 400.0) ** 2)
        assert reward == pytest.approx(-np.linalg.norm(q - [0, 0, 5.0]) / 2.0 - ahead - effort, rel=1e-10)
        assert np.allclose(row[env.fields["offset"]], R.T @ ([0, 0, 5.0] - q), rtol=0, atol=1e-14)


def test_the_velocity_is_that_of_the_momenta_at_the_node(env):
    env.reset(options={"start": START})
    p = env.simulated.craft.parameters
    for action in actions(5):
        row = env.step(action)[0]
    state = env.stepper.state
    place, center = np.asarray(p.added_mass), np.asarray(p.center_of_mass)
    omega, nu = row[env.fields["omega"]], row[env.fields["ground_velocity"]]
    pi = p.mass * (nu + np.cross(omega, center)) + place[:3, :3] @ nu + place[:3, 3:] @ omega
    assert np.allclose(pi, state.pi, rtol=0, atol=1e-12)


def test_the_same_seed_gives_the_same_episode_and_another_one_another(env):
    def episode(seed):
        rows = [env.reset(seed=seed)[0]]
        return np.array(rows + [env.step(action)[0] for action in actions(5)])

    first = episode(3)
    assert np.array_equal(first, episode(np.int64(3))) and not np.array_equal(first, episode(4))
    episode(3)
    following = env.reset()[0]
    episode(3)
    assert np.array_equal(following, env.reset()[0]) and not np.array_equal(following, first[0])


def test_an_episode_is_cut_off_after_its_time(env):
    env.reset(seed=1)
    for k in range(299):
        assert env.step(np.zeros(8))[2:4] == (False, False), k
    assert env.step(np.zeros(8))[2:] == (False, True, {"end": "time", "is_success": False})
    with pytest.raises(ArgumentError, match="No episode is under way"):
        env.step(np.zeros(8))


def test_an_episode_ends_badly_far_from_the_station(env):
    env.reset(options={"start": {"position": (9.99, 0.0, 5.0), "velocity": (1.0, 0.0, 0.0)}})
    _, reward, terminated, truncated, info = env.step(np.zeros(8))
    assert terminated and not truncated and info == {"end": "far", "is_success": False}
    assert reward < -50.0


@pytest.mark.long
def test_a_step_that_fails_ends_the_episode_and_says_why():
    env = environment(NAME, HoldStation(far=1e9), dt=50.0, period=50.0, seconds=5000.0)
    env.reset(options={"start": {"position": (0, 0, 100.0), "angular_velocity": (30.0, -30.0, 30.0)}})
    for _ in range(20):
        row, reward, terminated, _, info = env.step(np.ones(8))
        if terminated:
            break
    assert info["end"] == "failure" and "did not converge" in info["failure"] and not info["is_success"]
    assert np.all(np.isfinite(row)) and np.isfinite(reward)


@pytest.mark.long
def test_a_picture_shows_the_track_so_far():
    env = environment(NAME, render_mode="rgb_array")
    with pytest.raises(ArgumentError, match="nothing to draw"):
        env.render()
    env.reset(options={"start": START})
    first = env.render()
    for _ in range(20):
        env.step(np.ones(8))
    later = env.render()
    assert first.dtype == np.uint8 and first.shape == later.shape == (340, 720, 3)
    assert np.mean(first != later) > 1e-3 and np.mean(first == 255) > 0.5
    assert env.metadata["render_fps"] == 10


@pytest.mark.long
def test_rewards_ends_and_observations_may_be_ones_own():
    env = environment(
        NAME,
        observe={"deep": lambda feedback: feedback.depth, "mass": lambda feedback, p: p.mass, "where": "position"},
        reward=lambda feedback: -jnp.abs(feedback.depth - 3.0),
        ends={"shallow": lambda feedback: feedback.depth < 4.0},
    )
    row, _ = env.reset(options={"start": {"position": (1.0, 2.0, 4.0625), "velocity": (0.0, 0.0, -0.5)}})
    assert list(row) == [4.0625, 13.5, 1.0, 2.0, 4.0625]
    for _ in range(30):
        row, reward, terminated, _, info = env.step(np.zeros(8))
        assert reward == -abs(row[0] - 3.0)
        if terminated:
            break
    assert info["end"] == "shallow" and row[0] < 4.0
