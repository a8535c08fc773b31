"""From a vehicle and a task to a Gymnasium environment."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.checks import whole
from coadjoint.errors import ArgumentError, shown
from coadjoint_vehicles.environments.cross_current import CrossCurrent
from coadjoint_vehicles.environments.dock import Dock
from coadjoint_vehicles.environments.episodes import Episodes
from coadjoint_vehicles.environments.follow_path import FollowPath
from coadjoint_vehicles.environments.hold_station import HoldStation
from coadjoint_vehicles.environments.simulated import Simulated, Wanted
from coadjoint_vehicles.environments.task import Function, Task
from coadjoint_vehicles.files.registry import load_vehicle
from coadjoint_vehicles.model.controller import Controller
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.water.water import Water

if TYPE_CHECKING:
    from coadjoint_vehicles.environments.many import VehicleVectorEnv
    from coadjoint_vehicles.environments.single import VehicleEnv

TASKS: dict[str, type[Task]] = {
    "hold_station": HoldStation,
    "follow_path": FollowPath,
    "dock": Dock,
    "cross_current": CrossCurrent,
}


def environment(
    vehicle: str | os.PathLike[str] | Vehicle,
    task: str | Task = "hold_station",
    *,
    actions: str = "actuators",
    observe: object = None,
    reward: Function | None = None,
    ends: Mapping[str, object] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    controller: Controller | None = None,
    water: Water | None = None,
    dt: float = 0.05,
    period: float = 0.1,
    seconds: float | None = None,
    randomise: bool | Mapping[str, PyTree] = False,
    randomise_seed: int | None = None,
    render_mode: str | None = None,
    accuracy: bool = True,
) -> VehicleEnv:
    """A vehicle with a task as a `gymnasium.Env`.

        env = co.vehicles.environment("bluerov2_heavy_von_benzon", task="hold_station")
        observation, info = env.reset(seed=1)
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

    vehicle: the name of one that is shipped, the path of a file, or a Vehicle. task: its name or a `Task`.
    actions: "actuators", their commands between the ends of their travel, or "set_points", those of a controller
    between `bounds`; both are scaled to −1 … 1, and `env.actions` gives the units.
    observe: names, or name → name or function of the `Feedback`, or of it and the parameters; by default those of the
    task. reward: such a function to one number, in place of the task's. ends: name → such a function to a truth value,
    or `End`, in place of the task's. bounds: name → (lowest, highest), of set points. controller: whose set points
    actions are, by default that of the task. water: in place of the task's, which is still by default.
    dt: h, s. period: how long an action is held, an integer multiple of dt, s. seconds: after which an episode is
    truncated, by default those of the task.
    randomise: True, and every episode has parameters with the uncertainties that the vehicle file states; or path →
    standard deviation, in the parameter's unit (SI) or a share such as "5 %" (`Uncertain`). randomise_seed: a separate
    seed for them; by default they restart with that of `reset`. render_mode: "rgb_array" or None.
    accuracy: whether a sample of the steps is judged, as of `co.Stepper`, by default True.
    Raises ArgumentError for arguments that do not fit, and if Gymnasium is not installed.
    """
    _require_gymnasium()
    from coadjoint_vehicles.environments.single import VehicleEnv
    from coadjoint_vehicles.environments.spaces import whole_or_none

    whole_or_none(randomise_seed, "randomise_seed")
    if render_mode is not None:
        checks.choice(render_mode, "render_mode", ("rgb_array",))
    wanted = Wanted(
        actions=actions, observe=observe, reward=reward, ends=ends, bounds=bounds, controller=controller, water=water,
        dt=dt, period=period, seconds=seconds, accuracy=accuracy,
    )  # fmt: skip
    simulated, episodes = _made(vehicle, task, wanted, None, randomise)
    return VehicleEnv(simulated, episodes, randomise_seed, render_mode)


def vector_environment(
    vehicle: str | os.PathLike[str] | Vehicle,
    task: str | Task = "hold_station",
    *,
    num_envs: int,
    autoreset: str = "next_step",
    threads: int = 1,
    randomise: bool | Mapping[str, PyTree] = False,
    randomise_seed: int | None = None,
    **wanted: Any,
) -> VehicleVectorEnv:
    """Many vehicles with a task as a `gymnasium.vector.VectorEnv`; a period of all of them is one call of machine code.

        envs = co.vehicles.vector_environment("bluerov2_heavy_von_benzon", task="hold_station", num_envs=2048)

    num_envs: how many. autoreset: when a member whose episode has ended is reset, "next_step" (its next step does
    only that), "same_step" (immediately; the last observation is in `infos["final_obs"]`), or "disabled" (by `reset`
    with `options={"reset_mask": …}`). threads: how many share the members. wanted: the other arguments of
    `environment`, without render_mode. vehicle, task, randomise, randomise_seed: as there; member i has randomise_seed
    + i. Raises ArgumentError.
    """
    _require_gymnasium()
    from coadjoint_vehicles.environments.many import MODES, VehicleVectorEnv
    from coadjoint_vehicles.environments.spaces import whole_or_none

    whole_or_none(randomise_seed, "randomise_seed")
    checks.choice(autoreset, "autoreset", MODES)
    known = [field.name for field in fields(Wanted)]
    wanted.pop("render_mode", None)
    checks.all_known(wanted, known, "argument", "A vector environment")
    count, threads = whole(num_envs, "num_envs"), whole(threads, "threads")
    simulated, episodes = _made(vehicle, task, Wanted(**wanted), count, randomise)
    simulated.stepper.threads = threads
    return VehicleVectorEnv(simulated, episodes, randomise_seed, autoreset)


def _made(
    vehicle: Any, task: object, wanted: Wanted, members: int | None, randomise: object
) -> tuple[Simulated, Episodes]:
    simulated = Simulated(_vehicle(vehicle), _task(task), wanted, members, randomise)
    return simulated, Episodes(simulated)


def _vehicle(given: Any) -> Vehicle:
    return given if isinstance(given, Vehicle) else load_vehicle(given)


def _task(given: object) -> Task:
    if isinstance(given, Task):
        return given
    if isinstance(given, str) and given in TASKS:
        return TASKS[given]()
    near = checks.nearest(given, TASKS) if isinstance(given, str) else ""
    hint = f": did you mean `{near}`?" if near else "."
    raise ArgumentError(f"Argument `task` must be a Task or one of {', '.join(TASKS)}, but is {shown(given)}{hint}")


def _require_gymnasium() -> None:
    checks.library("gymnasium", "Environments need", "coadjoint-vehicles[learn]", "Gymnasium")
