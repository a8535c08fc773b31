"""Filters of an hour's log at 100 Hz: by the vehicle's own model, by an inertial unit, and that written by hand."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

import coadjoint as co
from benchmarks import filters_by_hand as by_hand
from benchmarks.clock import Contender, interleaved, table_of
from coadjoint.estimation import (
    Filter,
    GaussMarkov,
    InertialState,
    Measurement,
    ModelProcess,
    RandomWalk,
    StrapdownProcess,
)

H, G = 0.01, 9.81
HAND = "hand-written, numba"
COMMANDS = {"stern_planes": 0.0, "rudder": 0.02, "propeller": 25.0}
EVERY = (20, 10, 50, 200)
"""Steps between measurements of velocity, depth, heading and place: 5, 10, 2 and 0.5 Hz."""
VARIANCES = np.array([0.01**2, 0.03**2, 0.02**2, 0.5**2])
LEVER = np.array([0.3, 0.0, 0.05])
NOISE = (4e-5, 4e-4)
"""rad/s/√Hz and m/s²/√Hz."""
SPREAD = (0.01, 0.03, 0.3, 1e-5, 1e-3)
"""Of attitude, velocity, place and both biases at the start."""


def measure(quick: bool) -> dict[str, Any]:
    """Processor time of a step and of the whole log, set-up apart; how far each is from the truth."""
    seconds, times = (120, 1) if quick else (3600, 3)
    unit, numba = inertial(seconds)
    by_model = {"ModelProcess, with biases of sensors": model(seconds, True), "ModelProcess": model(seconds, False)}
    cases = {"inertial unit": {HAND: numba, "StrapdownProcess": unit}, "model": by_model}
    found: dict[str, Any] = {"seconds": seconds, "steps": round(seconds / H)}
    for name, runs in cases.items():
        steps = seconds / H
        timed = interleaved({label: Contender(run, steps) for label, (run, _) in runs.items()}, times)
        rows = table_of(timed, next(iter(runs)))
        for label, (run, size) in runs.items():
            rows[label] |= {"errors": float(size), "off": run()}
        found[name] = rows
    return found


def remus(biases: bool = False) -> tuple[Filter, Any, Any]:
    """(A filter of REMUS 100 that seeks the current; with `biases` those of its sensors and the propeller's
    effectiveness too, the craft, the start)."""
    water = co.vehicles.water.UniformWater((0.18, 0.24, 0.0))
    craft = co.vehicles.Craft(co.vehicles.load("remus_100"), water=water)
    start = craft.start(position=(0, 0, 20), speed=1.5, actuators={"propeller": 25.0})
    drifting = {"water.velocity": GaussMarkov([0.03, 0.03, 0.0], 900.0, mean=(0.18, 0.24, 0.0))}
    spread = {"g": 0.01, "q": 0.3, "xi": 0.005, "nu": 0.03, "water.velocity": [0.03, 0.03, 0.0]}
    walks = {}
    if biases:
        drifting["propeller.effectiveness"] = GaussMarkov(0.05, 900.0, mean=1.0)
        walks = {"gyroscope": RandomWalk([1e-8] * 3), "log": RandomWalk([1e-6] * 3), "gauge": RandomWalk([1e-5])}
        spread |= {"propeller.effectiveness": 0.05, "gyroscope": 1e-5, "log": 1e-3, "gauge": 0.01}
    process = ModelProcess(
        craft.system, start, inputs=COMMANDS, noise={"torque": 0.02, "force": 0.2}, drifting=drifting, biases=walks
    )
    known = {
        "gyroscope": Measurement(lambda m, p, b: m.xi + b.gyroscope, (NOISE[0] / np.sqrt(H)) ** 2),
        "velocity": Measurement(lambda m, p, b: m.nu + jnp.cross(m.xi, LEVER) + b.log, VARIANCES[0]),
        "depth": Measurement(lambda m, p, b: m.q[2] + b.gauge[0], VARIANCES[1]),
    } if biases else {
        "gyroscope": Measurement(lambda m: m.xi, (NOISE[0] / np.sqrt(H)) ** 2),
        "velocity": Measurement(lambda m: m.nu + jnp.cross(m.xi, LEVER), VARIANCES[0]),
        "depth": Measurement(lambda m: m.q[2], VARIANCES[1]),
    }  # fmt: skip
    known["place"] = Measurement(lambda m: m.q, VARIANCES[3])
    return Filter(process, start, measurements=known, deviations=spread), craft, start


def model(seconds: int, biases: bool) -> tuple[Any, int]:
    """(The filter of REMUS 100 over a log, which returns the RMS error of its place, m; how many error states)."""
    filter, craft, start = remus(biases)
    steps, random = round(seconds / H), np.random.default_rng(1)
    run = co.simulate(craft.system, start, dt=H, duration=seconds, inputs=COMMANDS)
    xi, nu, q = (run.dataset[name].values for name in ("xi", "nu", "q"))
    truth = {"gyroscope": xi, "velocity": nu + np.cross(xi, LEVER), "depth": q[:, 2:], "place": q}
    at = dict(zip(("velocity", "depth", "place"), (EVERY[0], EVERY[1], EVERY[3]), strict=True))
    seen = {}
    for name, values in truth.items():
        k = np.arange(at.get(name, 1), steps + 1, at.get(name, 1))
        size = np.sqrt(filter.measurements[name].covariance)
        seen[name] = (H * k, values[k] + size * random.normal(size=(len(k), values.shape[1])))
    return run_of(filter, seen, {}, q[100::100], seconds), filter.process.width


def run_of(filter: Filter, seen: Any, inputs: Any, truth: np.ndarray, seconds: int) -> Any:
    """A filter's run over a log from its start, with what it says of the place every second."""
    begun = filter.rows.copy(), filter.P.copy()

    def run() -> float:
        filter.rows, filter.P = begun[0].copy(), begun[1].copy()
        found = filter.run(seen, dt=H, until=float(seconds), inputs=inputs, save_every=100)
        place = found.states.q if isinstance(filter.process, ModelProcess) else found.states.position
        return off(place[1:], truth)

    return run


def off(place: np.ndarray, truth: np.ndarray) -> float:
    """RMS distance, m."""
    return float(np.sqrt(np.mean(np.sum((place - truth) ** 2, axis=1))))


def inertial(seconds: int) -> tuple[tuple[Any, int], tuple[Any, int]]:
    """(Run, error states) of a `StrapdownProcess`, and of the same by hand, over the same log."""
    steps, random = round(seconds / H), np.random.default_rng(2)
    R, v, q, exact = spiral(steps)
    deviation = np.repeat(NOISE, 3) / np.sqrt(H)
    bias = np.repeat(SPREAD[3:], 3) * random.normal(size=6)
    imu = exact + bias + deviation * random.normal(size=(steps, 6))
    truth = {
        "velocity": np.einsum("kji,kj->ki", R, v) + np.cross(np.concatenate([exact[:1, :3], exact[:, :3]]), LEVER),
        "depth": q[:, 2:],
        "heading": np.arctan2(R[:, 1, 0], R[:, 0, 0])[:, None],
        "place": q,
    }
    seen = {}
    for (name, values), every, variance in zip(truth.items(), EVERY, VARIANCES, strict=True):
        k = np.arange(every, steps + 1, every)
        seen[name] = H * k, values[k] + np.sqrt(variance) * random.normal(size=(len(k), values.shape[1]))
    known = {
        "velocity": Measurement(lambda m: m.nu + jnp.cross(m.xi, LEVER), VARIANCES[0]),
        "depth": Measurement(lambda m: m.q[2], VARIANCES[1]),
        "heading": Measurement(lambda m: jnp.arctan2(m.g[1, 0], m.g[0, 0]), VARIANCES[2], space=co.SO2()),
        "place": Measurement(lambda m: m.q, VARIANCES[3]),
    }
    process = StrapdownProcess(gravity=G, noise={"gyroscope": NOISE[0], "accelerometer": NOISE[1]})
    names = ("attitude", "velocity", "position", "gyroscope_bias", "accelerometer_bias")
    spread = dict(zip(names, SPREAD, strict=True))
    row = process.row(InertialState(0.0, R[0], v[0], q[0]))
    inputs = {"imu": (H * np.arange(steps), imu)}
    filter = Filter(process, row, measurements=known, deviations=spread)
    ours = run_of(filter, seen, inputs, q[100::100], seconds)
    P = np.diag(np.repeat(np.array(SPREAD) ** 2, 3))
    values = [np.ascontiguousarray(part[1]) for part in seen.values()]

    def hand() -> float:
        place, _ = by_hand.filtered(
            R[0].copy(), v[0].copy(), q[0].copy(), P, imu, H, G, np.array(NOISE), LEVER, *values, np.array(EVERY),
            VARIANCES,
        )  # fmt: skip
        return off(place, q[100::100])

    return (ours, process.width), (hand, by_hand.SIZE)


def spiral(steps: int) -> tuple[np.ndarray, ...]:
    """(R, v, q at the nodes, exact readings (steps, 6)) of a vehicle that turns and swings."""
    t = H * np.arange(steps)
    rates = np.stack([0.02 * np.sin(t), 0.02 * np.cos(0.7 * t), 0.05 + 0.02 * np.sin(0.05 * t)], axis=1)
    R, v, q = (np.empty((steps + 1, *shape)) for shape in ((3, 3), (3,), (3,)))
    R[0], v[0], q[0] = np.eye(3), (1.5, 0.0, 0.0), (0.0, 0.0, 20.0)
    readings = np.empty((steps, 6))
    for k in range(steps):
        push = np.cross([0.0, 0.0, rates[k, 2]], v[k]) - [0.0, 0.0, G + 0.01 * (q[k, 2] - 20.0) + 0.1 * v[k, 2]]
        readings[k] = np.concatenate([rates[k], R[k].T @ push])
        R[k + 1], v[k + 1], q[k + 1] = by_hand.stepped(R[k], v[k], q[k], readings[k, :3], readings[k, 3:], H, G)
    return R, v, q, readings
