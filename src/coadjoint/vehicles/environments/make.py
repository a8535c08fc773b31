"""From a vehicle and a task to a Gymnasium environment."""

from __future__ import annotations

import os
from collections.abc import Mapping
from difflib import get_close_matches
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from coadjoint.errors import ArgumentError, shown
from coadjoint.vehicles.environments.episodes import Episodes
from coadjoint.vehicles.environments.hold_station import HoldStation
from coadjoint.vehicles.environments.simulated import Simulated, Wanted
from coadjoint.vehicles.environments.task import Function, Task
from coadjoint.vehicles.files.registry import load_vehicle
from coadjoint.vehicles.model.controller import Controller
from coadjoint.vehicles.model.vehicle import Vehicle
from coadjoint.vehicles.water.water import Water

if TYPE_CHECKING:
    from coadjoint.vehicles.environments.single import VehicleEnv

TASKS: dict[str, type[Task]] = {"hold_station": HoldStation}


def environment(
    vehicle: str | os.PathLike[str] | Vehicle,
    task: str | Task = "hold_station",
    *,
    actions: str = "actuators",
    observe: Any = None,
    reward: Function | None = None,
    ends: Mapping[str, Any] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    controller: Controller | None = None,
    water: Water | None = None,
    dt: float = 0.05,
    period: float = 0.1,
    seconds: float | None = None,
    render_mode: str | None = None,
) -> VehicleEnv:
    """A vehicle with a task as a `gymnasium.Env`.

        env = co.vehicles.environment("bluerov2_heavy_von_benzon", task="hold_station")
        observation, info = env.reset(seed=1)
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

    vehicle: the name of one that is shipped, the path of a file, or a Vehicle. task: its name or a `Task`.
    actions: "actuators", their commands between the ends of their travel, or "set_points", those of a controller
    between `bounds`; both are scaled to −1 … 1, and `env.actions` tells the units.
    observe: names, or name → name or function of the `Feedback`, or of it and the parameters; by default those of the
    task. reward: such a function to one number, in place of the task's. ends: name → such a function to a truth value,
    or `End`, in place of the task's. bounds: name → (lowest, highest), of set points. controller: whose set points
    actions are, by default that of the task. water: in place of the task's, which is still by default.
    dt: h, s. period: how long an action is held, a whole number of dt, s. seconds: after which an episode is truncated,
    by default those of the task. render_mode: "rgb_array" or None.
    Raises ArgumentError for what does not fit, and where Gymnasium is not installed.
    """
    _require_gymnasium()
    from coadjoint.vehicles.environments.single import VehicleEnv

    if render_mode not in (None, "rgb_array"):
        raise ArgumentError(f'Argument `render_mode` must be "rgb_array" or None, but is {shown(render_mode)}.')
    wanted = Wanted(
        actions=actions, observe=observe, reward=reward, ends=ends, bounds=bounds, controller=controller, water=water,
        dt=dt, period=period, seconds=seconds,
    )  # fmt: skip
    simulated = Simulated(_vehicle(vehicle), _task(task), wanted, None, ())
    return VehicleEnv(simulated, Episodes(simulated, None), None, render_mode)


def _vehicle(given: Any) -> Vehicle:
    return given if isinstance(given, Vehicle) else load_vehicle(given)


def _task(given: Any) -> Task:
    if isinstance(given, Task):
        return given
    if isinstance(given, str) and given in TASKS:
        return TASKS[given]()
    near = get_close_matches(given, TASKS, n=1) if isinstance(given, str) else []
    hint = f": did you mean `{near[0]}`?" if near else "."
    raise ArgumentError(f"Argument `task` must be a Task or one of {', '.join(TASKS)}, but is {shown(given)}{hint}")


def _require_gymnasium() -> None:
    if find_spec("gymnasium") is None:
        raise ArgumentError('Environments need Gymnasium, which is not installed: pip install "coadjoint[learn]".')
