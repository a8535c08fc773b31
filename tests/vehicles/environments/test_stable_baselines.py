"""The adapter to Stable-Baselines3: its interface over a vector environment, with the returns of its Monitor."""

from __future__ import annotations

import copy
import pickle
import sys
from types import ModuleType

import numpy as np
import pytest
from scripted import GOES, LATE, MIDDLE_ENDS, Scripted

from coadjoint.errors import ArgumentError
from coadjoint_vehicles.environments import HoldStation, baselines, vector_environment

COUNT = 3


class VecEnv:
    """As `stable_baselines3.common.vec_env.VecEnv` begins, seeds and steps."""

    def __init__(self, num_envs, observation_space, action_space):
        self.num_envs, self.observation_space, self.action_space = num_envs, observation_space, action_space
        self._seeds = [None] * num_envs
        self.render_mode = self.get_attr("render_mode")[0]

    def seed(self, seed):
        self._seeds = [seed + k for k in range(self.num_envs)]

    def step(self, actions):
        self.step_async(actions)
        return self.step_wait()


@pytest.fixture(scope="module")
def envs():
    made = {"autoreset": "same_step", "num_envs": COUNT}
    return [vector_environment("bluerov2_heavy_von_benzon", HoldStation(seconds=0.5), **made) for _ in range(2)]


@pytest.fixture
def library(monkeypatch):
    module = ModuleType("stable_baselines3.common.vec_env")
    module.VecEnv = VecEnv
    for name in ("stable_baselines3", "stable_baselines3.common"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setitem(sys.modules, module.__name__, module)
    baselines._kind.cache_clear()
    yield
    baselines._kind.cache_clear()


@pytest.mark.long
def test_steps_are_those_of_the_vector_environment_and_ends_have_their_return(envs, library):
    adapter, plain = envs[0].stable_baselines(), envs[1]
    assert isinstance(adapter, VecEnv) and adapter.env_is_wrapped(int) == [False] * COUNT
    adapter.seed(7)
    np.testing.assert_array_equal(adapter.reset(), plain.reset(seed=7)[0].astype(np.float32))
    returns, random = np.zeros(COUNT), np.random.default_rng(0)
    for step in range(1, 8):
        actions = random.uniform(-1, 1, (COUNT, 8))
        seen, rewards, dones, infos = adapter.step(actions)
        expected, own, terminated, truncated, found = plain.step(actions)
        np.testing.assert_array_equal(seen, expected.astype(np.float32))
        np.testing.assert_allclose(rewards, own, rtol=1e-6)
        np.testing.assert_array_equal(dones, terminated | truncated)
        returns += own
        assert seen.dtype == rewards.dtype == np.float32 and dones.all() == (step == 5)
        for member, info in enumerate(infos):
            if step != 5:
                assert info == {}
                continue
            assert info["TimeLimit.truncated"] and info["end"] == "time" and info["episode"]["l"] == 5
            assert info["episode"]["r"] == pytest.approx(returns[member], rel=1e-12)
            np.testing.assert_array_equal(info["terminal_observation"], found["final_obs"][member].astype(np.float32))
        if step == 5:
            returns[:] = 0.0


@pytest.mark.long
def test_a_copy_and_a_pickle_go_on_alike(envs, library):
    adapter, actions = envs[0].stable_baselines(), np.full((COUNT, 8), 0.2)
    adapter.seed(1)
    adapter.reset()
    adapter.step(actions)
    others = [copy.deepcopy(adapter), pickle.loads(pickle.dumps(adapter))]
    for _ in range(5):
        first, *rest = (one.step(actions) for one in (adapter, *others))
        for other in rest:
            for part, own in zip(first[:3], other[:3], strict=True):
                np.testing.assert_array_equal(part, own)
            returns = [[info.get("episode", {}).get("r") for info in found[3]] for found in (first, other)]
            assert returns[0] == returns[1]


@pytest.fixture
def adapted(library):
    """An adapter over a script: member 1 arrives in the second period, the others end in the third."""
    script = Scripted(GOES, MIDDLE_ENDS, LATE, GOES, failing={3: {2: "no step"}})
    return script, script.envs("same_step").stable_baselines()


def test_infos_of_members_that_end_have_their_return_length_and_last_row(adapted):
    script, adapter = adapted
    adapter.seed(5)
    begun = adapter.reset()
    assert begun.tolist() == [[-1, 1]] * 3 and begun.dtype == adapter.observation_space.dtype == np.float32
    assert script.random[1][0].uniform() == np.random.default_rng(6).uniform() and adapter._seeds == [None] * 3
    seen, rewards, dones, infos = adapter.step("given")
    assert script.commands == ["given"] and infos == [{}] * 3 and not dones.any()
    assert seen.tolist() == [[1, 1], [2, 2], [3, 3]] and rewards == pytest.approx([0.1, 0.2, 0.3])
    assert seen.dtype == rewards.dtype == np.float32
    *_, dones, infos = adapter.step(None)
    assert dones.tolist() == [False, True, False] and infos[0] == infos[2] == {}
    episode = infos[1].pop("episode")
    assert (episode["r"], episode["l"]) == (pytest.approx(0.7), 2) and 0 <= episode["t"] < 100
    assert infos[1].pop("terminal_observation").tolist() == [5, 5]
    assert infos[1] == {"end": "arrived", "is_success": True, "TimeLimit.truncated": False}
    *_, dones, infos = adapter.step(None)
    assert dones.tolist() == [True, False, True] and infos[1] == {}
    assert infos[0]["TimeLimit.truncated"] and "failure" not in infos[0] and infos[0]["episode"]["l"] == 3
    assert infos[2]["failure"] == "no step" and not infos[2]["TimeLimit.truncated"]
    assert infos[2]["episode"]["r"] == pytest.approx(0.3 + 0.6 + 0.9 - 10.0)
    assert adapter._returns == pytest.approx([0.0, 0.8, 0.0]) and adapter._lengths.tolist() == [0, 1, 0]
    assert adapter.env_is_wrapped(int) == [False] * 3 and adapter.env_is_wrapped(type("Monitor", (), {}), 1) == [True]
    assert adapter.get_attr("mode", [0, 2]) == [adapter.envs.mode] * 2 and adapter.get_attr("render_mode") == [None] * 3
    made, (envs, state) = adapter.__reduce__()
    assert made(envs, state)._returns is adapter._returns and made(envs, state)._lengths.tolist() == [0, 1, 0]
    adapter.reset()
    assert not adapter._returns.any() and not adapter._lengths.any()


def test_wrong_uses_raise(adapted, monkeypatch):
    _, adapter = adapted
    for make, told in (
        (Scripted().envs("next_step").stable_baselines, 'autoreset="same_step"'),
        (lambda: adapter.set_attr("seconds", 3.0), "Members share `seconds`"),
        (lambda: adapter.env_method("render"), "Members have no `render`"),
    ):
        with pytest.raises(ArgumentError, match=told):
            make()
    baselines._kind.cache_clear()
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    with pytest.raises(ArgumentError, match='pip install "stable-baselines3"'):
        adapter.envs.stable_baselines()
