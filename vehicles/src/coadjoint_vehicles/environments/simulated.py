"""A vehicle with a task as one stepper: commands in, observations, rewards and ends out, by one call."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, LagrangianError, StepError, shown
from coadjoint.extending import Fields, StepperBase, require_portable
from coadjoint.mechanics import State
from coadjoint.simulation import Stepper
from coadjoint.spaces import Named
from coadjoint_vehicles.environments.actions import Actions, actuator_actions, set_point_actions
from coadjoint_vehicles.environments.observations import Common, actuators, chosen, observable, of_feedback
from coadjoint_vehicles.environments.task import End, Function, Task
from coadjoint_vehicles.environments.uncertainties import Uncertain, of_file
from coadjoint_vehicles.model.craft import Craft
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.water.water import Water

ROW = "row"
"""The stepper's name for the complete row."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """The options of an environment other than vehicle and task; see `environment`."""

    actions: str = "actuators"
    observe: Any = None
    reward: Function | None = None
    ends: Mapping[str, PyTree] | None = None
    bounds: Mapping[str, PyTree] | None = None
    controller: Any = None
    water: Water | None = None
    dt: float = 0.05
    period: float = 0.1
    seconds: float | None = None
    accuracy: bool = True


class Simulated:
    """A stepper whose observations are those asked for, then the reward, then a 1 for each end that has come.

    steps: of one period. most: periods after which an episode is truncated. ends: by name. fields: name → place of
    each observation in a row.
    """

    def __init__(self, vehicle: Vehicle, task: Task, wanted: Wanted, members: int | None, randomise: object = False):
        self.task, self.wanted, self.members = task, wanted, members
        self._given = vehicle, task, wanted, members, randomise
        self.steps = _periods(wanted.period, wanted.dt, "period", "dt")
        self.seconds = task.seconds if wanted.seconds is None else wanted.seconds
        self.most = _periods(self.seconds, wanted.period, "seconds", "period")
        self.craft = _craft(vehicle, task, wanted)
        self.common = Common(self.craft)
        self.actions = _actions(self.craft, task, wanted)
        self.ends = _ends(task.ends() if wanted.ends is None else wanted.ends)
        known = observable(self.common, self.actions, task.observations())
        asked = task.observed if wanted.observe is None else wanted.observe
        self.base = self.craft.start(actuators=task.actuators(vehicle))
        self.uncertain = _uncertain(self.craft, randomise)
        self.drawn = {} if wanted.water is not None else dict(task.parameters(np.random.default_rng(0)))
        if both := sorted(set(self.drawn) & set(self.uncertain.nominal if self.uncertain else ())):
            raise ArgumentError(f"The task draws `{both[0]}` itself: leave it out of `randomise`.")
        self._shown = chosen(self.common, known, asked)
        self._shapes: dict[str, tuple[int, ...]] = {}
        self._reward = self._rewarded()
        self.stepper = Stepper(
            self.craft.system,
            self.base,
            dt=wanted.dt,
            inputs=self.actions.starts,
            observe={ROW: self._row},
            members=members,
            changing=(*self.drawn, *(self.uncertain.nominal if self.uncertain else ())),
            accuracy=wanted.accuracy,
        )
        self.fields = {name: place for name, _, place in Fields.of(self._shapes).places()}
        self.width = Fields.of(self._shapes).size
        self.successes = np.array([end.success for end in self.ends.values()], dtype=bool)

    @property
    def rows(self) -> np.ndarray:
        """The current observation of the stepper."""
        return self.stepper.observed

    def __reduce__(self) -> tuple[object, ...]:
        """By its arguments, whose functions are named, and the state of its stepper."""
        require_portable(self._given, "The environment")
        return _standing_as, (type(self), self._given, self.stepper)

    def __deepcopy__(self, memo: object) -> Simulated:
        made = copy.copy(self)
        made.stepper = self.stepper.clone()
        return made

    def __copy__(self) -> Simulated:
        made = object.__new__(type(self))
        made.__dict__.update(self.__dict__)
        return made

    def _row(self, state: State, p: Named) -> Array:
        """All observations, one number after the other, by one function, so that shared terms are traced once."""
        seen = {name: jnp.asarray(function(state, p), dtype=float) for name, function in self._shown.items()}
        self._shapes = {name: np.shape(value) for name, value in seen.items()}
        parts = [*seen.values(), self._reward(state, p), self._ended(state, p)]
        return jnp.concatenate([jnp.ravel(part) for part in parts])

    def _rewarded(self) -> Callable[[State, PyTree], PyTree]:
        """r − c mean(a²) + Σ of the rewards of the ends that have come; a user's reward excludes the effort."""
        given, effort = self.wanted.reward, self.task.effort
        if given is not None:
            checks.function(given, "reward", "a function of the Feedback")
        places = actuators(self.craft) if given is None and effort else None
        inner = of_feedback(self.common, self.task.reward if given is None else given)

        def reward(state: State, p: Named) -> Array:
            found = _one(inner(state, p), "The reward", "one number")
            if places is not None:
                found = found - effort * jnp.mean(places(state, p) ** 2)
            ended = self._ended(state, p)
            return found + sum(end.reward * ended[i] for i, end in enumerate(self.ends.values()))

        return reward

    def _ended(self, state: State, p: Named) -> Array:
        """A 1 for each end that has come, (ends,)."""
        found = [of_feedback(self.common, end.when)(state, p) for end in self.ends.values()]
        came = [
            _one(one, f"The end `{name}`", "one truth value", bool) for name, one in zip(self.ends, found, strict=True)
        ]
        return jnp.array([jnp.where(one, 1.0, 0.0) for one in came]) if came else jnp.zeros(0)

    def step(self) -> None:
        """One period; raises StepError if the step of a single craft fails, or if an observation is not finite."""
        try:
            self.stepper.step(None, self.steps)
        except StepError:
            bad = np.flatnonzero(~np.all(np.isfinite(np.atleast_2d(self.rows)), axis=0))
            if not len(bad):
                raise
            names = [name for name, place in self.fields.items() if place.start <= bad[0] < place.stop]
            what = f"The observation `{names[0]}`" if names else "The reward"
            raise StepError(f"{what} is not finite: look for a division by zero in its function.") from None

    def command(self, actions: object) -> None:
        """Set the commands of actions; raises ArgumentError and leaves them as they were."""
        lead = () if self.members is None else (self.members,)
        found = self.actions.commands(actions, lead)
        commands = self.stepper.command
        for name, place in self.actions.places.items():
            command = commands[name]
            command[...] = found[..., place].reshape(command.shape)


def _standing_as(kind: type[Simulated], given: tuple[PyTree, ...], stepper: StepperBase) -> Simulated:
    """The pickled object, with the state of its stepper."""
    made = kind(*given)
    made.stepper.stand_as(stepper)
    return made


def _periods(long: Any, short: Any, name: str, unit: str) -> int:
    """long/short, an integer; raises ArgumentError."""
    for value, what in ((short, unit), (long, name)):
        fits = not isinstance(value, bool) and isinstance(value, (int, float, np.number)) and (0 < value < np.inf)
        checks.expect(fits, value, what, "a positive number of seconds")
    count = checks.steps(long, short, close=1e-6)
    if count is None:
        raise ArgumentError(
            f"Argument `{name}` must be a whole number of times `{unit}`, but is {float(long)!r} of {float(short)!r} s."
        )
    return count


def _craft(vehicle: Vehicle, task: Task, wanted: Wanted) -> Craft:
    checks.choice(wanted.actions, "actions", ("actuators", "set_points"))
    if wanted.actions == "actuators":
        for name in ("bounds", "controller"):
            if getattr(wanted, name) is not None:
                raise ArgumentError(f'Argument `{name}` is for actions="set_points": leave it out, or ask for them.')
        return Craft(vehicle, water=task.water() if wanted.water is None else wanted.water)
    controller = task.helm(vehicle) if wanted.controller is None else wanted.controller
    return Craft(vehicle, controller=controller, water=task.water() if wanted.water is None else wanted.water)


def _actions(craft: Craft, task: Task, wanted: Wanted) -> Actions:
    if wanted.actions == "actuators":
        return actuator_actions(craft)
    assert craft.controller is not None
    known = {name: ends for name, ends in task.bounds().items() if name in craft.controller.inputs}
    checks.expect(isinstance(wanted.bounds or {}, Mapping), wanted.bounds, "bounds", "name → (lowest, highest)")
    return set_point_actions(craft, {**known, **(wanted.bounds or {})})


def _uncertain(craft: Craft, given: object) -> Uncertain | None:
    if isinstance(given, Mapping):
        return Uncertain(craft, given) if given else None
    checks.instance(given, "randomise", bool, "True, False, or path → standard deviation")
    return Uncertain(craft, of_file(craft)) if given else None


def _ends(given: Any) -> dict[str, End]:
    """Name → End, of functions too; raises ArgumentError."""
    checks.instance(given, "ends", Mapping, "name → function of the Feedback, or End")
    found = {name: end if isinstance(end, End) else End(end) for name, end in given.items()}
    for name, end in found.items():
        checks.function(end.when, f"The end `{shown(name)}`", "a function of the Feedback")
    return found


class Simulating:
    """The common properties of single and vector environments."""

    simulated: Simulated

    @property
    def actions(self) -> Actions:
        """The command of each action, and its unit."""
        return self.simulated.actions

    @property
    def fields(self) -> dict[str, slice]:
        """Name → place of each observation in a row."""
        return self.simulated.fields

    @property
    def stepper(self) -> Stepper:
        """The stepper beneath."""
        return self.simulated.stepper


def _one(value: PyTree, what: str, expected: str, kind: type = float) -> Array:
    """A value of a user's function as one number; raises LagrangianError for others, and for truth from numbers."""
    array = jnp.asarray(value)
    if array.size != 1 or (kind is bool and array.dtype != bool):
        found = f"the shape {array.shape}" if array.size != 1 else f"a number ({array.dtype})"
        raise LagrangianError(f"{what} must return {expected}, but returns {found}.")
    return jnp.reshape(array, ())
