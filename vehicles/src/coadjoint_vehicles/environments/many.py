"""Many vehicles as one Gymnasium vector environment: one call of the machine code for a period of all of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint_vehicles.environments.baselines import baselines
from coadjoint_vehicles.environments.episodes import Episodes
from coadjoint_vehicles.environments.simulated import Simulated, Simulating
from coadjoint_vehicles.environments.spaces import boxes, varying_from, whole_or_none

MODES = {"next_step": AutoresetMode.NEXT_STEP, "same_step": AutoresetMode.SAME_STEP, "disabled": AutoresetMode.DISABLED}


class VehicleVectorEnv(Simulating, VectorEnv):
    """`num_envs` vehicles with a task, each with separate episodes; a step advances all of them by one period.

    `metadata["autoreset_mode"]` says when a member whose episode has ended is reset. Arrays have a first axis of
    members; otherwise as `VehicleEnv`. Infos are arrays by name, each with the mask `_name` of the members it is of.
    """

    metadata: dict[str, object] = {"render_modes": []}  # noqa: RUF012

    def __init__(self, simulated: Simulated, episodes: Episodes, own_seed: int | None, mode: str):
        assert simulated.members is not None
        self.simulated, self.episodes, self._own_seed = simulated, episodes, own_seed
        self.num_envs = simulated.members
        self.single_observation_space, self.single_action_space = boxes(simulated)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.metadata = {**self.metadata, "autoreset_mode": MODES[mode]}
        self.mode = MODES[mode]
        self._now, self._first, self._earliest = 0, np.zeros(self.num_envs, np.int64), 0
        """Periods so far, those before the episode of each member, and the least of these."""
        self._over, self._resting = np.ones(self.num_envs, bool), False
        """Whose episodes have ended and wait for a reset, and whether there are any."""
        self._begun = False

    def reset(self, *, seed: object = None, options: dict[str, PyTree] | None = None) -> tuple[np.ndarray, dict]:
        """New episodes. seed: an integer, member i has seed + i as a single environment would; or one for each.

        options: {"start": …} begins there; {"reset_mask": (num_envs,) truth values}: only these members. Raises
        ArgumentError.
        """
        options = options or {}
        checks.all_known(options, ("start", "reset_mask"), "key", "Argument `options`")
        members = self._meant(options.get("reset_mask"))
        seeds = self._seeds(seed)
        super().reset(seed=int(seed) if isinstance(seed, (int, np.integer)) else None)
        for member in members:
            if seeds[member] is not None or self.episodes.random[member] is None:
                random, entropy = seeding.np_random(seeds[member])
                own = entropy if self._own_seed is None else self._own_seed + int(member)
                self.episodes.seed(int(member), random, varying_from(own))
        if "start" in options:
            self.episodes.begin_at(members, options["start"])
        else:
            self.episodes.begin(members)
        self._over[members], self._begun = False, True
        self._resting = bool(self._over.any())
        self._count_from_now(members)
        return self._seen(), {}

    def stable_baselines(self) -> Any:
        """This environment as a `VecEnv` of Stable-Baselines3, for autoreset="same_step".

            envs = co.vehicles.vector_environment("remus_100", num_envs=64, autoreset="same_step")
            PPO("MlpPolicy", envs.stable_baselines()).learn(500_000)

        Observations and rewards are float32; infos have "terminal_observation", "TimeLimit.truncated", and "episode",
        as those of its Monitor. Raises ArgumentError for other modes, and where Stable-Baselines3 is not installed.
        """
        return baselines(self)

    def _meant(self, mask: object) -> np.ndarray:
        if mask is None:
            return np.arange(self.num_envs)
        if not isinstance(mask, np.ndarray) or mask.dtype != bool or mask.shape != (self.num_envs,):
            raise ArgumentError(
                f"`reset_mask` must be an array of truth values of shape ({self.num_envs},), but is {shown(mask)}."
            )
        if not self._begun and not mask.all():
            raise ArgumentError("The first reset() is that of all members: leave out `reset_mask`.")
        return np.flatnonzero(mask)

    def _seeds(self, seed: Any) -> list[int | None]:
        if isinstance(seed, (list, tuple, np.ndarray)):
            if len(seed) != self.num_envs:
                raise ArgumentError(
                    f"Argument `seed` must be one for each of {self.num_envs}, but is {len(seed)} of them."
                )
            for one in seed:
                whole_or_none(one, "seed")
            return [None if one is None else int(one) for one in seed]
        whole_or_none(seed, "seed")
        return [None if seed is None else int(seed) + i for i in range(self.num_envs)]

    def step(self, actions: object) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, PyTree]]:
        """One period: observations (num_envs, size), rewards, terminations, truncations (num_envs,), and infos.

        A member whose step failed is terminated, `failure` says why, and it shows its last good node. Raises
        ArgumentError for invalid actions, and if an ended member has not been reset.
        """
        if not self._begun:
            raise ArgumentError("No episode is under way: call reset() first.")
        before, again = self._over, self._resting
        if self.mode is AutoresetMode.DISABLED and again:
            raise ArgumentError(
                f"The episodes of {int(before.sum())} members have ended: call reset(options={{'reset_mask': …}}) "
                "first."
            )
        simulated, width = self.simulated, self.simulated.width
        simulated.command(actions)
        simulated.step()
        self._now += 1
        rows, failed = simulated.rows, self.stepper.failed
        rewards, ends = rows[:, width].copy(), rows[:, width + 1 :]
        due = self._now - self._earliest >= simulated.most
        if not (again or due or ends.max(initial=0.0) > 0.5 or failed.any()):
            return self._seen(), rewards, failed, np.zeros(self.num_envs, bool), {}
        ended, late = ends > 0.5, self._now - self._first >= simulated.most
        rewards[failed] -= simulated.task.penalty
        terminated = failed | ended.any(axis=1)
        truncated = late & ~terminated
        if again:  # these members have just been reset: their last steps count for nothing
            rewards[before], terminated[before], truncated[before] = 0.0, False, False
        self._over = terminated | truncated
        self._resting = bool(self._over.any())
        infos = self._infos(ended, failed & ~before) if self._resting else {}
        if self.mode is AutoresetMode.SAME_STEP:
            infos = self._final(infos)
            self._begin(self._over)
            self._over, self._resting = np.zeros(self.num_envs, bool), False
        else:
            self._begin(before)
        return self._seen(), rewards, terminated, truncated, infos

    def _begin(self, which: np.ndarray) -> None:
        if which.any():
            self.episodes.begin(np.flatnonzero(which))
            self._count_from_now(which)

    def _count_from_now(self, members: np.ndarray) -> None:
        """Count the periods of the episodes of these members, by indices or truth values, from now on."""
        self._first[members] = self._now
        self._earliest = int(self._first.min())

    def _infos(self, ended: np.ndarray, failed: np.ndarray) -> dict[str, object]:
        """How episodes have ended: `end`, `is_success`, and `failure` of steps that failed."""
        over, names = self._over, np.array([*self.simulated.ends, "time"], dtype=object)
        first = np.where(ended.any(axis=1), ended.argmax(axis=1) if ended.shape[1] else 0, len(names) - 1)
        successes = np.append(self.simulated.successes, False)
        ends = np.where(failed, "failure", names[first])
        ends[~over] = None
        found: dict[str, PyTree] = {
            "end": ends,
            "_end": over.copy(),
            "is_success": over & successes[first] & ~failed,
            "_is_success": over.copy(),
        }
        if failed.any():
            sentences = np.full(self.num_envs, None, dtype=object)
            for member, sentence in self.stepper.failures.items():
                sentences[member] = sentence if failed[member] else None
            found |= {"failure": sentences, "_failure": failed}
        return found

    def _final(self, infos: Mapping[str, object]) -> dict[str, object]:
        """The last observation and info of an episode, if the next one begins in the same step."""
        if not infos:
            return {}
        seen = np.full(self.num_envs, None, dtype=object)
        for member in np.flatnonzero(self._over):
            seen[member] = self.simulated.rows[member, : self.simulated.width].copy()
        over = self._over.copy()
        return {"final_obs": seen, "_final_obs": over, "final_info": dict(infos), "_final_info": over}

    def _seen(self) -> np.ndarray:
        return self.simulated.rows[:, : self.simulated.width].copy()
