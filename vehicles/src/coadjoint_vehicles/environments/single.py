"""One vehicle as a Gymnasium environment."""

from __future__ import annotations

import gymnasium
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, StepError
from coadjoint_vehicles.environments.episodes import Episodes
from coadjoint_vehicles.environments.picture import PoseAt, picture
from coadjoint_vehicles.environments.simulated import Simulated, Simulating
from coadjoint_vehicles.environments.spaces import boxes, varying_from, whole_or_none


class VehicleEnv(Simulating, gymnasium.Env):
    """A vehicle with a task, one period a step.

    Observations are those of `fields`, name → place in the row, float64 and in SI units; actions lie between −1 and 1,
    and `actions` describes the command of each. `stepper` is the underlying `co.Stepper`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(self, simulated: Simulated, episodes: Episodes, own_seed: int | None, render_mode: str | None):
        self.simulated, self.episodes, self._own_seed = simulated, episodes, own_seed
        self.observation_space, self.action_space = boxes(simulated)
        self.metadata = {**self.metadata, "render_fps": round(1 / simulated.wanted.period)}
        self.render_mode = render_mode
        self.track: list[PoseAt] = []
        """Where the vehicle has been in this episode, where pictures are wanted."""
        self._periods: int | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, PyTree] | None = None) -> tuple[np.ndarray, dict]:
        """A new episode. options: {"start": …} begins there, as `Craft.start` takes it, instead of the task's start.

        Raises ArgumentError.
        """
        whole_or_none(seed, "seed")
        super().reset(seed=None if seed is None else int(seed))
        if seed is not None or self.episodes.random[0] is None:
            own = self._own_seed if self._own_seed is not None else self.np_random_seed
            self.episodes.seed(0, self.np_random, varying_from(own))
        self._begin(options or {})
        self._periods, self.track = 0, []
        self._remember()
        return self._seen(), {}

    def _begin(self, options: dict[str, object]) -> None:
        checks.all_known(options, ("start",), "key", "Argument `options`")
        if "start" in options:
            self.episodes.begin_at(np.array([0]), options["start"])
        else:
            self.episodes.begin(np.array([0]))

    def step(self, action: object) -> tuple[np.ndarray, float, bool, bool, dict[str, PyTree]]:
        """One period under an action: observation, reward, terminated, truncated and info.

        info: at the end of an episode `end`, its name, "time" or "failure", and `is_success`; of a step that failed
        `failure`, a sentence, too. Raises ArgumentError for an invalid action, and if no episode is under way.
        """
        if self._periods is None:
            raise ArgumentError("No episode is under way: call reset() first, and after an episode has ended.")
        self.simulated.command(action)
        self._periods += 1
        info: dict[str, object] = {}
        row = self.simulated.rows
        try:
            self.simulated.step()
        except StepError as error:
            if not self.stepper.failed:
                raise
            info = {"failure": str(error), "end": "failure", "is_success": False}
        self._remember()
        reward, *ended = row[self.simulated.width :].tolist()
        terminated, truncated = bool(info) or 1.0 in ended, self._periods >= self.simulated.most
        if info:
            reward -= self.simulated.task.penalty
        elif terminated:
            which = ended.index(1.0)
            info = {"end": list(self.simulated.ends)[which], "is_success": bool(self.simulated.successes[which])}
        elif truncated:
            info = {"end": "time", "is_success": False}
        if terminated or truncated:
            self._periods = None
        return row[: self.simulated.width].copy(), reward, terminated, truncated and not terminated, info

    def _seen(self) -> np.ndarray:
        return self.simulated.rows[: self.simulated.width].copy()

    def _remember(self) -> None:
        if self.render_mode is not None:
            state = self.stepper.state
            R = state.places.group.matrix(state.g)
            self.track.append(PoseAt(float(state.t), np.asarray(state.q), np.asarray(R)))

    def render(self) -> np.ndarray | None:
        """The track over ground and the depth so far, (height, width, 3) of 0 to 255; None without a render mode."""
        if self.render_mode is None:
            return None
        if not self.track:
            raise ArgumentError("There is nothing to draw before the first reset().")
        return picture(self.track, self.simulated.task.goal(), self.simulated.seconds)
