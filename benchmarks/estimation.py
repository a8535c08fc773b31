"""Filters and identification next to plain NumPy and SciPy: calls of a filter, an hour of log, parameters of a log.

The same steps, measurements and errors by hand: an extended Kalman filter of a turning rigid body with errors on the
group, whose Jacobians are derived on paper, and least squares through a Runge–Kutta simulation of Euler's equations,
with SciPy's differences for derivatives.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import least_squares

import coadjoint as co
from benchmarks import filters
from benchmarks.clock import Contender, interleaved, table_of
from coadjoint.estimation import Filter, Measurement, ModelProcess
from coadjoint.identification import Log, identify, synthetic_log

HAND, SCIPY = "hand-written, NumPy", "hand-written, NumPy and SciPy"
H, INERTIA, NOISE = 0.01, np.array([1.0, 2.0, 3.0]), 0.02
GYRO = 0.01
"""rad/s, deviation of a reading."""
DRAG = np.array([0.2, 0.3, 0.4])
SEEN = ("p", "q", "r")
REMUS = {
    "hull.axial_drag": 0.42, "hull.crossflow_drag": 1.1, "rudder.area": 0.0133, "stern_planes.area": 0.0133,
    "propeller.effectiveness": 1.0, "rudder.lag": 0.1,
}  # fmt: skip


def measure(quick: bool) -> dict[str, Any]:
    """Processor times, and ratios to what is written by hand in the same repetition."""
    return {**filters.measure(quick), "calls": _calls(200 if quick else 2000), "identified": _identified(quick)}


def _calls(count: int) -> dict[str, dict[str, float]]:
    """A prediction and an update, of 6 errors next to those by hand, and of 15 of REMUS 100."""
    found: dict[str, dict[str, float]] = {}
    body, by_hand = _turning(), HandFilter()
    reading = np.array([0.1, 0.02, -0.1])
    vehicle, _, _ = filters.remus()
    expected = vehicle.expected()["gyroscope"]
    pairs: dict[str, dict[str, Callable[[], object]]] = {
        "predict, 6 errors": {HAND: lambda: by_hand.predict(H), "Filter": lambda: body.predict(H)},
        "update, 6 errors": {
            HAND: lambda: by_hand.update(reading), "Filter": lambda: body.update({"gyroscope": reading}),
        },
        "predict, REMUS 100, 15 errors": {"Filter": lambda: vehicle.predict(H)},
        "update, REMUS 100, 15 errors": {"Filter": lambda: vehicle.update({"gyroscope": expected})},
    }  # fmt: skip
    for name, calls in pairs.items():
        timed = interleaved({key: Contender(_repeated(call, count), count) for key, call in calls.items()}, 5)
        for key, row in table_of(timed, next(iter(calls))).items():
            found[f"{name}: {key}"] = row if len(calls) > 1 else {"seconds": row["seconds"]}
    return found


def _repeated(call: Callable[[], object], count: int) -> Callable[[], None]:
    def run() -> None:
        for _ in range(count):
            call()

    return run


def _turning() -> Filter:
    """The filter of a rigid body with a gyroscope."""
    system = co.System(co.SO3(), lambda xi: 0.5 * xi @ (INERTIA * xi))
    start = system.state(xi=[0.1, 0.02, -0.1])
    seen = {"gyroscope": Measurement(lambda m: m.xi, deviation=GYRO)}
    process = ModelProcess(system, start, noise={"torque": NOISE})
    return Filter(process, start, measurements=seen, deviations={"g": 0.1, "xi": 0.1}, accuracy=False)


def hat(v: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


class HandFilter:
    """R, μ and P of a rigid body; errors (η, δμ) with R exp(η): the midpoint rule and its slopes by one Newton step."""

    def __init__(self) -> None:
        self.R, self.mu = np.eye(3), INERTIA * np.array([0.1, 0.02, -0.1])
        self.P = np.diag([0.01] * 3 + list((0.1 * INERTIA) ** 2))
        self.H = np.concatenate([np.zeros((3, 3)), np.diag(1 / INERTIA)], axis=1)

    def predict(self, h: float) -> None:
        mu, inverse, one = self.mu, np.diag(1 / INERTIA), np.eye(3)
        after = mu + h * np.cross(mu, mu / INERTIA)
        for _ in range(2):
            mean = 0.5 * (mu + after)
            slope = hat(mean) @ inverse - hat(mean / INERTIA)
            after = after - np.linalg.solve(
                one - 0.5 * h * slope, after - mu - h * np.cross(mean, mean / INERTIA)
            )  # fmt: skip
        mean = 0.5 * (mu + after)
        slope = 0.5 * h * (hat(mean) @ inverse - hat(mean / INERTIA))
        by_mu = np.linalg.solve(one - slope, one + slope)
        x = hat(0.5 * h * mean / INERTIA)
        turn = np.linalg.solve(one - x, one + x)
        Phi = np.block([[turn.T, 0.5 * h * inverse @ (one + by_mu)], [np.zeros((3, 3)), by_mu]])
        self.R, self.mu, self.P = self.R @ turn, after, Phi @ self.P @ Phi.T
        self.P[3:, 3:] += h * NOISE**2 * one

    def update(self, reading: np.ndarray) -> None:
        off = reading - self.mu / INERTIA
        S = self.H @ self.P @ self.H.T + GYRO**2 * np.eye(3)
        K = np.linalg.solve(S, self.H @ self.P).T
        e, rest = K @ off, np.eye(6) - K @ self.H
        self.P = rest @ self.P @ rest.T + GYRO**2 * K @ K.T
        x = hat(0.5 * e[:3])
        self.R = self.R @ np.linalg.solve(np.eye(3) - x, np.eye(3) + x)
        self.mu = self.mu + e[3:]
        reset = np.eye(6)
        reset[:3, :3] -= x
        self.P = reset @ self.P @ reset.T


def _identified(quick: bool) -> dict[str, dict[str, float]]:
    """Six parameters from a log of 60 s, begun 30 % off: of a turning body next to SciPy, and of REMUS 100."""
    found = _of_a_body(20.0 if quick else 60.0)
    craft = co.vehicles.Craft(co.vehicles.load("remus_100"))
    t = np.arange(0.0, 60.0, 0.1)
    commands = {
        "rudder": 0.15 * np.sign(np.sin(0.5 * t) + 1e-9), "stern_planes": 0.1 * np.sin(0.3 * t),
        "propeller": 20 + 4 * np.sign(np.sin(0.4 * t) + 1e-9),
    }  # fmt: skip
    start = craft.start(position=(0, 0, 30), speed=1.5, actuators={"propeller": 24.0})
    held = {name: co.Held(t, values) for name, values in commands.items()}
    run = co.simulate(
        craft.system, start, dt=0.0125, duration=59.9, inputs=held, save_every=8, monitors=False, progress=False
    )
    noise = dict.fromkeys(("north", "east"), 0.3) | {"depth": 0.05} | dict.fromkeys(("roll", "pitch", "heading"), 0.01)
    noise |= dict.fromkeys("uvw", 0.02) | dict.fromkeys("pqr", 0.005)
    system = craft.system
    for k, (name, value) in enumerate(REMUS.items()):
        part, key = name.split(".")
        system = system.replace(**{part: {key: (1.3 if k % 2 else 0.7) * value}})
    for seed, label in enumerate(("first", "again")):
        log = synthetic_log(run, noise=noise, seed=seed)
        log = Log(log.time, log.columns, log.inputs, units=log.units)
        began = time.process_time()
        result = identify(system, log, start=start, parameters=list(REMUS), progress=False)
        seconds = time.process_time() - began
        off = max(abs(result[name].value - value) / result[name].standard_error for name, value in REMUS.items())
        found[f"REMUS 100, {label}: identify"] = {"seconds": seconds, "off": off}
    return found


def _of_a_body(duration: float) -> dict[str, dict[str, float]]:
    """Moments of inertia and drags from the rates of a body that known torques turn."""
    t = 0.1 * np.arange(round(duration / 0.1))
    random = np.random.default_rng(7)
    torque = np.repeat(random.normal(size=(len(t) // 15 + 1, 3)), 15, axis=0)[: len(t)]
    truth = np.concatenate([INERTIA, DRAG])
    guess = truth * np.where(np.arange(6) % 2, 1.3, 0.7)
    seen = turned(truth, t, torque) + GYRO * random.normal(size=(len(t), 3))
    hand_began = time.process_time()
    fit = least_squares(lambda x: (turned(x[:6], t, torque, x[6:]) - seen).ravel() / GYRO, np.append(guess, seen[0]))
    hand = time.process_time() - hand_began
    spread = np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))[:6]
    found = {f"a turning body: {SCIPY}": {"seconds": hand, "ratio": 1.0, "off": _worst(fit.x[:6] - truth, spread)}}

    def lagrangian(xi: Any, p: Any) -> Any:
        return 0.5 * xi @ (p.inertia * xi)

    def forces(motion: Any, p: Any) -> Any:
        return co.Force(torque=motion.inputs.torque - p.drag * motion.xi)

    system = co.System(co.SO3(), lagrangian, forces=forces, parameters=co.Parameters(inertia=guess[:3], drag=guess[3:]))
    log = Log(t, dict(zip(SEEN, seen.T, strict=True)), {"torque": torque})
    start = system.state(xi=seen[0], inputs={"torque": np.zeros(3)})
    measured = {name: (lambda s, i=i: s.xi[i]) for i, name in enumerate(SEEN)}
    for label in ("first", "again"):
        began = time.process_time()
        result = identify(system, log, start=start, parameters=["inertia", "drag"], measured=measured, progress=False)
        seconds = time.process_time() - began
        values = list(result.estimates.values())
        off = _worst(np.array([one.value for one in values]) - truth, np.array([one.standard_error for one in values]))
        found[f"a turning body, {label}: identify"] = {"seconds": seconds, "ratio": seconds / hand, "off": off}
    return found


def _worst(errors: np.ndarray, spread: np.ndarray) -> float:
    """The largest error in standard errors."""
    return float(np.max(np.abs(errors) / spread))


def turned(
    x: np.ndarray, t: np.ndarray, torque: np.ndarray, begun: np.ndarray | None = None, h: float = 0.05
) -> np.ndarray:
    """Rates (n, 3) of I ω̇ = u − d ω − ω × Iω from `begun`, by default rest, with torques held between the times."""
    inertia, drag = x[:3], x[3:6]

    def rate(w: np.ndarray, u: np.ndarray) -> np.ndarray:
        L = inertia * w
        gyro = np.array([w[1] * L[2] - w[2] * L[1], w[2] * L[0] - w[0] * L[2], w[0] * L[1] - w[1] * L[0]])
        return (u - drag * w - gyro) / inertia

    w = np.zeros(3) if begun is None else np.array(begun)
    found = [w]
    for u in torque[:-1]:
        for _ in range(round((t[1] - t[0]) / h)):
            a = rate(w, u)
            b = rate(w + 0.5 * h * a, u)
            c = rate(w + 0.5 * h * b, u)
            w = w + h / 6 * (a + 2 * b + 2 * c + rate(w + h * c, u))
        found.append(w)
    return np.stack(found)
