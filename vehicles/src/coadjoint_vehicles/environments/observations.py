"""Observations of an environment, by name: functions of the `Feedback`, traced into the machine code."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import partial
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.extending import replace_parameters
from coadjoint.mechanics import State, continuous
from coadjoint.spaces import Named
from coadjoint_vehicles.environments.actions import Actions, actuator_actions
from coadjoint_vehicles.environments.task import Function
from coadjoint_vehicles.model.actuators import seen
from coadjoint_vehicles.model.controller import Feedback
from coadjoint_vehicles.model.craft import Craft
from coadjoint_vehicles.readings.observed import observations
from coadjoint_vehicles.serving.inertial import inertial
from coadjoint_vehicles.serving.served import standing

Observation = Callable[[State, PyTree], PyTree]
"""As a stepper takes it."""
FIELDS = (
    *("position", "velocity", "ground_velocity", "omega", "down", "north"),
    *("roll", "pitch", "heading", "depth", "sink", "t"),
)
"""Those of the `Feedback`."""


def feedback_of(craft: Craft, state: State, p: PyTree) -> Feedback:
    """The craft at a node, with the velocities that its momenta there have."""
    xi, nu = continuous.velocities(replace_parameters(craft.system, p), state)
    motion: Any = SimpleNamespace(n=state.n, a=state.named.a, t=state.t, internal=state.internal, xi=xi, nu=nu)
    return seen(craft.water, craft.vehicle, motion, p, state.inputs)


class Common:
    """The `Feedback` of the state that functions were last asked about: many functions ask about one state."""

    def __init__(self, craft: Craft):
        self.craft = craft
        self._last: tuple[PyTree, PyTree, PyTree] = (None, None, None)

    def __getstate__(self) -> dict[str, object]:
        """Without the state, which is one of the trace."""
        return {"craft": self.craft, "_last": (None, None, None)}

    def __call__(self, state: State, p: PyTree) -> Feedback:
        last, own, found = self._last
        if found is None or last is not state or own is not p:
            found = feedback_of(self.craft, state, p)
            self._last = state, p, found
        return found


def of_feedback(common: Common, function: Function) -> Callable[[State, PyTree], PyTree]:
    """A function of the `Feedback`, or of it and the parameters, as a stepper observes it."""
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    takes = [x for x in inspect.signature(function).parameters.values() if x.kind in kinds and x.default is x.empty]

    def observe(state: State, p: Named) -> PyTree:
        feedback = common(state, p)
        return function(feedback) if len(takes) < 2 else function(feedback, p)

    return observe


def actuators(craft: Craft) -> Callable[[State, PyTree], PyTree]:
    """The positions of the actuators, scaled as actions: between −1 and 1, one after the other."""
    scale = actuator_actions(craft)

    def observe(state: State, p: Named) -> PyTree:
        found = []
        for name, place in scale.places.items():
            where = jnp.ravel(standing(name, state))[: place.stop - place.start]
            off = where - scale.middle[place]
            up, down = (scale.high - scale.middle)[place], (scale.middle - scale.low)[place]
            found.append(jnp.where(off > 0, off / up, off / down))
        return jnp.concatenate(found)

    return observe


def observable(
    common: Common, actions: Actions, added: Mapping[str, Function]
) -> dict[str, Callable[[State, PyTree], PyTree]]:
    """All that can be observed by name, as a stepper takes it; `added` by the task."""

    def commands(state: State) -> PyTree:
        return jnp.concatenate([jnp.ravel(getattr(state.inputs, name)) for name in actions.shapes])

    found: dict[str, PyTree] = {
        name: of_feedback(common, partial(lambda name, feedback: getattr(feedback, name), name)) for name in FIELDS
    }
    craft = common.craft
    found["actuators"] = actuators(craft)
    found["commands"] = lambda state, p: commands(state)
    found["specific_force"] = lambda state, p: inertial(craft.system, jnp.zeros(3), state, p).specific_force
    found |= observations(craft)
    return {**found, **{name: of_feedback(common, function) for name, function in added.items()}}


def chosen(common: Common, known: Mapping[str, object], asked: object) -> dict[str, Observation]:
    """The observations of names, or of name → function of the `Feedback`; raises ArgumentError."""
    names = [asked] if isinstance(asked, str) else asked
    if not isinstance(names, (list, tuple, Mapping)) or not names:
        raise ArgumentError(
            "Argument `observe` must be names such as ('offset', 'velocity'), or name → function, but is "
            f"{shown(asked)}."
        )
    found = {}
    for name in names:
        given = names[name] if isinstance(names, Mapping) else name
        if isinstance(given, str):
            found[str(name)] = _known(known, given)
        elif callable(given):
            found[str(name)] = of_feedback(common, given)
        else:
            raise ArgumentError(f"The observation `{shown(name)}` must be a name or a function, but is {shown(given)}.")
    return found


def _known(known: Mapping[str, object], name: str) -> Any:
    return known[checks.known(name, known, "observation", "An environment")]
