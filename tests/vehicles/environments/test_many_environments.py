"""Many vehicles as one vector environment: each member is what a single one is, and begins anew when it should."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from scripted import GOES, LATE, MIDDLE_ENDS, Scripted

from coadjoint.errors import ArgumentError
from coadjoint_vehicles.environments import HoldStation, environment, vector_environment

NAME = "bluerov2_heavy_von_benzon"
TASK = HoldStation(far=3.2, seconds=2.0)
COUNT = 5


@pytest.fixture(scope="module")
def single():
    return environment(NAME, TASK)


@pytest.fixture(scope="module")
def envs():
    return {mode: vector_environment(NAME, TASK, num_envs=COUNT, autoreset=mode) for mode in ("next_step", "same_step")}


def actions(count: int) -> np.ndarray:
    """Ahead with all there is, so that some come too far."""
    random = np.random.default_rng(5).uniform(-0.3, 0.3, (count, COUNT, 8))
    return np.clip(random + np.array([-0.7, -0.7, 0.7, 0.7, 0, 0, 0, 0]), -1, 1)


def alone(single, member: int, seed: int, given: np.ndarray) -> list[list[tuple]]:
    """The episodes of a member by a single environment: lists of (row, reward, terminated, truncated)."""
    episodes, row = [], single.reset(seed=seed + member)[0]
    episodes.append([(row, 0.0, False, False)])
    for action in given[:, member]:
        row, reward, terminated, truncated, info = single.step(action)
        episodes[-1].append((row, reward, terminated, truncated, info.get("end")))
        if terminated or truncated:
            episodes.append([(single.reset()[0], 0.0, False, False)])
    return episodes


@pytest.mark.long
def test_members_are_single_environments_that_begin_anew_at_once(single, envs):
    many, given, seed = envs["same_step"], actions(60), 3
    assert many.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
    rows = [many.reset(seed=seed)[0]]
    found = [many.step(action) for action in given]
    ends = set()
    for member in range(COUNT):
        expected = alone(single, member, seed, given)
        assert len(expected) > 2
        assert np.allclose(rows[0][member], expected[0][0][0], rtol=0, atol=1e-12)
        step = 0
        for episode, following in zip(expected, [*expected[1:], None], strict=True):
            for row, reward, terminated, truncated, end in episode[1:]:
                seen, rewards, terminations, truncations, infos = found[step]
                step += 1
                assert (terminations[member], truncations[member]) == (terminated, truncated)
                assert rewards[member] == pytest.approx(reward, rel=0, abs=1e-11)
                if terminated or truncated:
                    ends.add(end)
                    assert np.allclose(infos["final_obs"][member], row, rtol=0, atol=1e-12)
                    assert infos["final_info"]["end"][member] == end and infos["_final_obs"][member]
                    row = following[0][0]
                else:
                    assert not infos or not infos["_final_obs"][member]
                assert np.allclose(seen[member], row, rtol=0, atol=1e-12)
    assert ends == {"far", "time"}


@pytest.mark.long
def test_members_begin_anew_at_their_next_step(single, envs):
    many, given, seed = envs["next_step"], actions(60), 3
    assert many.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    many.reset(seed=seed)
    over, member, begun = False, 1, 0
    single.reset(seed=seed + member)
    for action in given:
        seen, rewards, terminations, truncations, infos = many.step(action)
        if over:
            row, _ = single.reset()
            begun += 1
            assert np.allclose(seen[member], row, rtol=0, atol=1e-12)
            assert (rewards[member], terminations[member], truncations[member]) == (0.0, False, False)
            over = False
            continue
        row, reward, terminated, truncated, info = single.step(action[member])
        over = terminated or truncated
        assert np.allclose(seen[member], row, rtol=0, atol=1e-12)
        assert rewards[member] == pytest.approx(reward, rel=0, abs=1e-11)
        assert (terminations[member], truncations[member]) == (terminated, truncated)
        assert not over or (infos["_end"][member] and infos["end"][member] == info["end"])
    assert begun >= 2


@pytest.mark.long
def test_the_same_seed_gives_the_same_bits_and_later_episodes_are_others(envs):
    many, given = envs["same_step"], actions(30)

    def run(seed):
        rows = [many.reset(seed=seed)[0]]
        return np.array(rows + [many.step(action)[0] for action in given])

    first = run(7)
    assert np.array_equal(first, run(7)) and not np.array_equal(first, run(8))
    begun = many.reset()[0]
    assert not np.array_equal(begun, first[0])
    listed = many.reset(seed=[7, 8, 9, 10, 11])[0]
    assert np.array_equal(listed, first[0])


@pytest.mark.long
def test_a_member_that_fails_is_terminated_and_told_and_nothing_is_nan():
    task = HoldStation(far=1e9, seconds=5000.0)
    many = vector_environment(NAME, task, num_envs=COUNT, dt=50.0, period=50.0, autoreset="next_step")
    many.reset(seed=1)
    many.reset(
        options={
            "start": {"position": (0, 0, 100.0), "angular_velocity": (30.0, -30.0, 30.0)},
            "reset_mask": np.arange(COUNT) == 2,
        }
    )
    told = ""
    for _ in range(20):
        seen, rewards, terminations, _, infos = many.step(np.zeros((COUNT, 8)))
        assert np.all(np.isfinite(seen)) and np.all(np.isfinite(rewards))
        if "failure" in infos and infos["_failure"][2]:
            told = infos["failure"][2]
            break
    assert "of member 2" in told and "did not converge" in told
    assert terminations[2] and infos["end"][2] == "failure" and not infos["is_success"][2]
    many.step(np.zeros((COUNT, 8)))
    assert not many.stepper.failed[2]


@pytest.mark.long
def test_wrappers_of_gymnasium_count_returns_and_lengths(envs):
    many = RecordEpisodeStatistics(envs["next_step"])
    many.reset(seed=3)
    total, given = np.zeros(COUNT), actions(60)
    for action in given:
        _, rewards, terminations, truncations, infos = many.step(action)
        total += rewards
        if terminations[0] or truncations[0]:
            break
    assert infos["episode"]["r"][0] == pytest.approx(total[0], rel=1e-9)
    assert many.observation_space.contains(many.step(given[0])[0])


def seen_of(envs, script: Scripted) -> list[tuple]:
    """Rewards, terminations and truncations of each period, as lists."""
    return [tuple(part.tolist() for part in envs.step(None)[1:4]) for _ in script.script]


def test_a_member_that_has_ended_begins_in_the_same_period_and_shows_its_last_row():
    script = Scripted(GOES, MIDDLE_ENDS, LATE, failing={3: {2: "no step"}})
    envs = script.envs("same_step")
    with pytest.raises(ArgumentError, match=r"call reset\(\) first"):
        envs.step(None)
    np.testing.assert_array_equal(envs.reset()[0], [[-1, 1]] * 3)
    seen, rewards, terminated, truncated, infos = envs.step("given")
    np.testing.assert_array_equal(seen, [[1, 1], [2, 2], [3, 3]])
    assert script.commands == ["given"] and rewards.tolist() == [0.1, 0.2, 0.3] and infos == {}
    assert not terminated.any() and not truncated.any()
    seen, rewards, terminated, truncated, infos = envs.step(None)
    np.testing.assert_array_equal(seen, [[4, 4], [-1, 2], [6, 6]])
    assert script.begun == [[0, 1, 2], [1]] and rewards.tolist() == [0.4, 0.5, 0.6]
    assert terminated.tolist() == [False, True, False] and not truncated.any()
    assert infos["final_obs"][1].tolist() == [5, 5] and infos["final_obs"][0] is None
    assert infos["_final_obs"].tolist() == infos["_final_info"].tolist() == [False, True, False]
    last = infos["final_info"]
    assert last["end"].tolist() == [None, "arrived", None] and last["is_success"].tolist() == [False, True, False]
    assert "failure" not in last and last["_end"].tolist() == last["_is_success"].tolist() == [False, True, False]
    seen, rewards, terminated, truncated, infos = envs.step(None)
    np.testing.assert_array_equal(seen, [[-1, 3], [8, 8], [-1, 3]])
    assert rewards.tolist() == pytest.approx([0.7, 0.8, 0.9 - 10.0])
    assert terminated.tolist() == [False, False, True] and truncated.tolist() == [True, False, False]
    last = infos["final_info"]
    assert last["end"].tolist() == ["time", None, "failure"] and not last["is_success"].any()
    assert last["failure"].tolist() == [None, None, "no step"] and last["_failure"].tolist() == [False, False, True]


def test_a_member_that_has_ended_begins_in_the_next_period_which_counts_for_nothing():
    script = Scripted(MIDDLE_ENDS, [[1, 1, 0.1, 0, 0], [2, 2, 0.2, 1, 0], [3, 3, 0.3, 0, 1]], GOES, LATE, GOES)
    envs = script.envs("next_step")
    envs.reset()
    assert seen_of(envs, script) == [
        ([0.4, 0.5, 0.6], [False, True, False], [False] * 3),
        ([0.1, 0.0, 0.3], [False, False, True], [False] * 3),
        ([0.1, 0.2, 0.0], [False, False, False], [True, False, False]),
        ([0.0, 0.8, 0.9], [False, False, True], [False] * 3),
        ([0.1, 0.2, 0.0], [False, False, False], [False, True, False]),
    ]
    assert script.begun == [[0, 1, 2], [1], [2], [0], [2]]


def test_without_autoreset_ended_members_are_those_of_a_mask():
    script = Scripted(MIDDLE_ENDS, GOES)
    envs = script.envs("disabled")
    mask = np.array([False, True, False])
    with pytest.raises(ArgumentError, match=r"The first reset\(\) is that of all members"):
        envs.reset(options={"reset_mask": mask})
    envs.reset()
    envs.step(None)
    with pytest.raises(ArgumentError, match="The episodes of 1 members have ended"):
        envs.step(None)
    for wrong in (mask.tolist(), mask.astype(float), mask[:2]):
        with pytest.raises(ArgumentError, match=r"truth values of shape \(3,\), but is"):
            envs.reset(options={"reset_mask": wrong})
    np.testing.assert_array_equal(envs.reset(options={"reset_mask": mask, "start": 7.0})[0], [[4, 4], [7, 2], [6, 6]])
    assert script.begun == [[0, 1, 2], [1]]
    assert envs.step(None)[1].tolist() == [0.1, 0.2, 0.3]
    with pytest.raises(ArgumentError, match="has no key `mask`"):
        envs.reset(options={"mask": mask})


@pytest.mark.parametrize(
    ("seed", "expected"), [(7, [7, 8, 9]), ([4, None, 5], [4, None, 5]), (None, [None] * 3), (np.int64(2), [2, 3, 4])]
)
def test_members_have_seeds_one_after_the_other_or_those_of_a_list(seed, expected):
    script = Scripted()
    envs = script.envs("same_step", own_seed=20)
    envs.reset(seed=seed)
    for member, (own, (random, varying)) in enumerate(zip(expected, script.random, strict=True)):
        assert own is None or random.uniform() == np.random.Generator(np.random.PCG64(own)).uniform()
        assert varying.uniform() == np.random.default_rng([20 + member, 1]).uniform()
    before = list(script.random)
    envs.reset()
    assert script.random == before
    envs.reset(seed=[None, 3, None])
    assert [new is old for new, old in zip(script.random, before, strict=True)] == [True, False, True]
    for wrong, told in (([1, 2], "one for each of 3, but is 2"), ([1, 2, "a"], "seed"), (-1, "seed")):
        with pytest.raises(ArgumentError, match=told):
            envs.reset(seed=wrong)
