"""A vector environment as Stable-Baselines3 takes it: a subclass of its `VecEnv`, made where it is installed."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv

from coadjoint import checks
from coadjoint.errors import ArgumentError


def baselines(envs: VectorEnv[Any, Any, Any]) -> Any:
    """The `VecEnv` of a vector environment whose members are reset in the step that ends their episodes."""
    if envs.metadata["autoreset_mode"] is not AutoresetMode.SAME_STEP:
        raise ArgumentError(
            "Stable-Baselines3 resets members in the step that ends their episodes: make the environment with "
            'autoreset="same_step".'
        )
    return _kind()(envs)


@cache
def _kind() -> Any:
    """The subclass of `VecEnv`."""
    library = checks.library(
        "stable_baselines3.common.vec_env", "This adapter needs", "stable-baselines3", "Stable-Baselines3"
    )

    class BaselinesVecEnv(_Members, library.VecEnv):
        """A vector environment by the methods of Stable-Baselines3's `VecEnv`."""

        def __init__(self, envs: VectorEnv[Any, Any, Any]):
            self.envs = envs
            seen: Any = envs.single_observation_space
            low, high = (side.astype(np.float32) for side in (seen.low, seen.high))
            library.VecEnv.__init__(self, envs.num_envs, Box(low, high, dtype=np.float32), envs.single_action_space)
            self._begin()

        def __reduce__(self) -> Any:
            return _standing_as, (self.envs, self._state())

    return BaselinesVecEnv


def _standing_as(envs: VectorEnv[Any, Any, Any], state: dict[str, object]) -> Any:
    made = baselines(envs)
    made.__dict__.update(state)
    return made


class _Members:
    """The methods, by those of `envs`; an episode that ends has its return and its length under "episode"."""

    envs: VectorEnv[Any, Any, Any]
    num_envs: int
    render_mode: None = None
    _seeds: list[int | None]

    def _begin(self) -> None:
        self._actions: np.ndarray | None = None
        self._returns, self._lengths = np.zeros(self.num_envs), np.zeros(self.num_envs, np.int64)
        self._since = time.perf_counter()

    def _state(self) -> dict[str, object]:
        return {name: self.__dict__[name] for name in ("_returns", "_lengths", "_seeds")}

    def reset(self) -> np.ndarray:
        """New episodes of all members, with the seeds of `seed`."""
        given = [one for one in self._seeds if one is not None]
        seeds: Any = self._seeds if given else None
        observations, _ = self.envs.reset(seed=seeds)
        self._seeds = [None] * self.num_envs
        self._begin()
        return observations.astype(np.float32)

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions (num_envs, size) of the next `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, object]]]:
        """One period: observations, rewards, dones, and a dictionary for each member."""
        observations, rewards, terminated, truncated, found = self.envs.step(self._actions)
        dones = terminated | truncated
        self._returns += rewards
        self._lengths += 1
        infos: list[dict[str, object]] = [{} for _ in range(self.num_envs)]
        if found:
            for member in np.flatnonzero(dones):
                infos[member] = self._ended(int(member), found, bool(truncated[member]))
            self._returns[dones], self._lengths[dones] = 0.0, 0
        return observations.astype(np.float32), rewards.astype(np.float32), dones, infos

    def _ended(self, member: int, found: dict[str, Any], truncated: bool) -> dict[str, object]:
        """The info of a member whose episode has ended."""
        last = found["final_info"]
        shown = {name: last[name][member] for name in ("end", "is_success")}
        if "failure" in last and last["failure"][member] is not None:
            shown["failure"] = last["failure"][member]
        seconds = round(time.perf_counter() - self._since, 6)
        return shown | {
            "terminal_observation": found["final_obs"][member].astype(np.float32),
            "TimeLimit.truncated": truncated,
            "episode": {"r": float(self._returns[member]), "l": int(self._lengths[member]), "t": seconds},
        }

    def close(self) -> None:
        """Close the vector environment."""
        self.envs.close()

    def _indices(self, indices: int | Sequence[int] | None) -> Sequence[int]:
        if indices is None:
            return range(self.num_envs)
        return [indices] if isinstance(indices, int) else indices

    def get_attr(self, attr_name: str, indices: int | Sequence[int] | None = None) -> list[object]:
        """An attribute of the vector environment, for each of the members."""
        return [getattr(self.envs, attr_name, None) if attr_name == "render_mode" else getattr(self.envs, attr_name)
                for _ in self._indices(indices)]  # fmt: skip

    def set_attr(self, attr_name: str, value: object, indices: int | Sequence[int] | None = None) -> None:
        """Raise ArgumentError: members share their attributes."""
        raise ArgumentError(f"Members share `{attr_name}`: set it where the vector environment is made.")

    def env_method(
        self, method_name: str, *arguments: object, indices: int | Sequence[int] | None = None, **named: object
    ) -> list[object]:
        """Raise ArgumentError: members are no environments by themselves."""
        raise ArgumentError(f"Members have no `{method_name}`: call that of `envs`, the vector environment.")

    def env_is_wrapped(self, wrapper_class: object, indices: int | Sequence[int] | None = None) -> list[bool]:
        """False, but for its Monitor, whose returns and lengths the infos have."""
        is_monitor = getattr(wrapper_class, "__name__", "") == "Monitor"
        return [is_monitor for _ in self._indices(indices)]
