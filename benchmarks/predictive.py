"""Model predictive control of BlueROV2 Heavy: it holds its station in a tide, and each real-time iteration is timed.

The model has the thrusts of all eight thrusters as inputs, with their lag and limits; its commands become pulses by the
inverse of the T200's curve. The vehicle that is simulated has that curve with its dead zone, masses and inertia 10 %
larger, linear damping 10 % smaller and quadratic damping 10 % larger, and a current of 0.3 m/s that turns once in two
minutes. What of the motion the model did not foresee is taken for a current, which the controller then counts with.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np

import coadjoint as co
from coadjoint.spaces.named import Named
from coadjoint_vehicles import Craft, load
from coadjoint_vehicles.parts.force_curves import Linear
from coadjoint_vehicles.water import TimeCurrent, UniformWater

PERIOD, STAGES, STATION, START = 0.1, 40, np.array([0.0, 0.0, 2.0]), (0.5, -0.3, 2.2)
SPEED, TURN, ERROR, GAIN = 0.3, 120.0, 0.1, 8.0
SETTLED = 10.0


def measure(quick: bool) -> dict[str, Any]:
    """The distance from the station, and times of both phases, over 30 s or two minutes."""
    return {"tide": _held(30.0 if quick else TURN)}


def _model(vehicle: Any) -> Craft:
    """The vehicle that the controller knows: thrusts as commands, and a current that it is told."""
    part = vehicle.part("thrusters")
    linear = replace(part, curve=Linear(1.0), unit="N", limit=list(part.extremes))
    parts = tuple(linear if p is part else p for p in vehicle.parts)
    return Craft(replace(vehicle, parts=parts), water=UniformWater((0.0, 0.0, 0.0)))


def _simulated(vehicle: Any) -> Craft:
    """The vehicle that is flown: other masses and damping, in the tide."""

    def tide(t: Any) -> Any:
        angle = 2 * jnp.pi * t / TURN
        return SPEED * jnp.stack([jnp.cos(angle), jnp.sin(angle), 0.0 * angle])

    damping, more, less = vehicle.part("damping"), 1 + ERROR, 1 - ERROR
    return Craft(vehicle, water=TimeCurrent(tide)).replace(
        mass=more * vehicle.mass, volume=more * vehicle.volume, inertia=more * vehicle.inertia,
        damping={"linear": less * damping.linear, "quadratic": more * damping.quadratic},
    )  # fmt: skip


def controller(model: Craft) -> co.control.Controller:
    """Eight thrusts, each between its limits, that hold the station."""
    low, high = model.vehicle.part("thrusters").limit

    def errors(motion, p):
        turned = jnp.ravel(motion.g - jnp.eye(3))
        return jnp.concatenate([6 * (motion.q - STATION), 3 * turned, motion.nu, 0.5 * motion.xi])

    def errors_and_thrusts(motion, p):
        return jnp.concatenate([errors(motion, p), motion.inputs.thrusters / 40])

    return co.control.Problem(
        model.system, model.start(), dt=PERIOD, steps=STAGES,
        inputs={"thrusters": co.control.Input((8,), lower=low, upper=high)},
        cost=co.control.squares(errors_and_thrusts), final_cost=co.control.squares(errors),
    ).controller(changing=("water",))  # fmt: skip


def _held(duration: float) -> dict[str, Any]:
    vehicle = load("bluerov2_heavy_von_benzon")
    model, flown = _model(vehicle), _simulated(vehicle)
    steering, curve = controller(model), vehicle.part("thrusters").curve
    pulses, forces = np.asarray(curve.commands), np.asarray(curve.forces)
    kept = np.append(True, np.diff(forces) > 0)  # of the dead zone the lower end
    begin = flown.start(position=START, euler_zyx=(0.3, 0.1, 0.0))
    stepper = co.Stepper(flown.system, begin, dt=PERIOD / 5, inputs={"thrusters": np.full(8, curve.neutral)})
    current, expected, rows = np.zeros(3), np.asarray(START), []
    for _ in range(round(duration / PERIOD)):
        state = stepper.state
        q, R = np.asarray(state.q), np.asarray(state.g)
        current = current + GAIN * (q - expected)
        steering.change(water={"velocity": current})
        thrusts = np.interp(np.asarray(state.internal.thrusters), pulses, forces)
        measured, clock, wall = (
            state.replace(internal=Named(thrusters=thrusts)),
            time.process_time(),
            time.perf_counter(),
        )
        prepared = steering.prepare()
        between = time.process_time()
        answer = steering(measured, velocities=True)
        seconds = between - clock, time.process_time() - between, prepared, time.perf_counter() - wall - prepared
        expected = answer.nodes[1, :9].reshape(3, 3) @ answer.nodes[1, 9:12]
        angle = np.degrees(np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1)))
        rows.append((float(np.linalg.norm(q - STATION)), angle, answer.status == "solved", *seconds))
        stepper.step({"thrusters": np.interp(answer.command["thrusters"], forces[kept], pulses[kept])}, n=5)
    return _summary(np.array(rows, float), steering)


def _summary(rows: np.ndarray, steering: co.control.Controller) -> dict[str, Any]:
    settled = rows[round(SETTLED / PERIOD) :]
    found = {"distance": settled[:, 0].max(), "angle": settled[:, 1].max(), "solved": float(rows[:, 2].mean())}
    for kind, first in (("processor", 3), ("wall", 5)):
        both = {"preparation": rows[1:, first], "feedback": rows[1:, first + 1]}
        both["iteration"] = both["preparation"] + both["feedback"]
        found[kind] = {name: [float(x) for x in np.percentile(s, [50, 99])] for name, s in both.items()}
    return {**found, "states": len(steering.names), "stages": STAGES}
