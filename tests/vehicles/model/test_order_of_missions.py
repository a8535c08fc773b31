"""Vehicles with actuators and sampled controllers: order 2 against DOP853 that begins anew at every command."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.mechanics.continuous import vector_field
from coadjoint.spaces.named import Named
from coadjoint_vehicles import Craft

PERIOD, DURATION = 0.1, 10.0
"""Of the controllers, and of the missions, s: every command is at a node of all step sizes."""


class Mission(NamedTuple):
    depth: float
    speed: float
    set_points: dict[str, float]
    actuators: dict[str, Any]
    body: dict[str, float]
    controller: dict[str, float]


MISSIONS = {
    "remus_100": Mission(10.0, 1.5, {"depth": 10.3, "heading": 0.17, "speed": 1.5}, {"propeller": 15.0}, {}, {}),
    "lrauv_tethys": Mission(10.0, 1.0, {"depth": 10.3, "heading": 0.17, "speed": 1.0}, {}, {}, {}),
    "nps_auv_ii": Mission(10.0, 1.5, {"depth": 10.3, "heading": 0.09, "speed": 1.5}, {}, {}, {}),
    # The curve of its thrusters is a table. Where commands cross its rows the error is of order 2, too, but of another
    # size at each crossing: these go on between two rows, with a load and from the commands of going ahead.
    "bluerov2_heavy_von_benzon": Mission(
        5.0, 0.3, {"depth": 5.02, "heading": 0.03, "speed": 0.3},
        {"thrusters": [1391.0] * 2 + [1599.0] * 2 + [1431.0] * 2 + [1420.0] * 2},
        {"mass": 14.4}, {"weigh": 1.0},
    ),
}  # fmt: skip


class Flight(NamedTuple):
    craft: Craft
    start: co.State
    inputs: dict[str, Any]

    def error(self, dt: float, places: np.ndarray) -> float:
        """The largest distance from the places at the samples, m."""
        run = co.simulate(
            self.craft.system, self.start, dt=dt, duration=DURATION, inputs=self.inputs, monitors=False, accuracy=False
        )
        return float(np.max(np.linalg.norm(run.records.q[:: round(PERIOD / dt)] - places, axis=1)))


def flight(name: str) -> Flight:
    mission, shipped = MISSIONS[name], vehicles.load(name)
    vehicle: Any = replace(shipped, **mission.body)
    craft = Craft(vehicle, controller=replace(shipped.controller, **mission.controller))
    start = craft.start(position=(0, 0, mission.depth), speed=mission.speed, actuators=mission.actuators)
    return Flight(craft, start, {key: co.Held([0.0], [value]) for key, value in mission.set_points.items()})


def speeds(craft: Craft, actual: dict[str, Any], value: Any, p: Any) -> dict[str, Any]:
    """ẋ = clip((u − x)/τ, ±rate) of each actuator, u where its command would take it in the end; those without stay."""
    found = {}
    for part in craft.vehicle.commanded:
        x, own = actual[part.name], getattr(p, part.name)
        found[part.name] = jax.tree.map(jnp.zeros_like, x)
        if "lag" in own and part.name in value:
            u = part.advance(x, getattr(value, part.name), jnp.asarray(1e9), own).end
            found[part.name] = (u - x) / own.lag
    return found


def exact(craft: Craft, start: co.State, inputs: dict[str, Any]) -> np.ndarray:
    """The places at the samples."""
    system, driven, p = craft.system, craft.system.driven(inputs), craft.parameters
    names = [part.name for part in craft.vehicle.commanded]
    begun = (start.g, start.n, start.a, start.xi, start.nu, {name: getattr(start.internal, name) for name in names})
    leaves, structure = jax.tree.flatten(jax.tree.map(lambda x: np.asarray(x, float), begun))
    ends = np.cumsum([leaf.size for leaf in leaves])[:-1]

    def state(t, y, controller):
        parts = [part.reshape(leaf.shape) for part, leaf in zip(jnp.split(y, ends), leaves, strict=True)]
        g, n, a, xi, nu, actual = jax.tree.unflatten(structure, parts)
        internal = start.internal.replace(controller=controller, **actual)
        return start.replace(t=t, g=g, n=n, a=a, xi=xi, nu=nu).holding(internal), actual

    @jax.jit
    def sample(t, y, controller):
        at, h = state(t, y, controller)[0], jnp.asarray(1e-3)
        return Named(**craft.rule(driven.motion_at(at, None, h), h, p)["controller"])

    @jax.jit
    def rate(t, y, controller):
        at, actual = state(t, y, controller)
        slope = vector_field(system, at)
        moving = (slope.g, slope.n, slope.a, slope.xi, slope.nu, speeds(craft, actual, controller.value, p))
        return jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree.leaves(moving)])

    y, controller = np.concatenate([leaf.ravel() for leaf in leaves]), start.internal.controller
    places = [start.q]
    with co.float64():
        for t in PERIOD * np.arange(round(DURATION / PERIOD)):
            controller = sample(t, y, controller)

            def slope(t, y, controller=controller):
                return np.asarray(rate(t, y, controller))

            y = solve_ivp(slope, (t, t + PERIOD), y, method="DOP853", rtol=1e-10, atol=1e-11).y[:, -1]
            places.append(np.asarray(state(t, y, controller)[0].q))
    return np.array(places)


SLOW = pytest.mark.long
NAMES = [name if name == "remus_100" else pytest.param(name, marks=SLOW) for name in MISSIONS]


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_missions_are_of_order_two_and_off_by_less_than_two_millimetres(name):
    flown = flight(name)
    places = exact(*flown)
    errors = np.array([flown.error(dt, places) for dt in (0.05, 0.025, 0.0125)])
    print(name, 1e3 * errors, np.log2(errors[:-1] / errors[1:]))
    assert errors[0] < 2e-3
    assert np.all(np.log2(errors[:-1] / errors[1:]) > 1.9)
