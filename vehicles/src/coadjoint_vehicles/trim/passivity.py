"""States in which the parts of a vehicle put energy in, with its actuators off."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.arrays import Array
from coadjoint.extending import tabulate
from coadjoint_vehicles.trim.under_way import Level

STATES = 4096
ROUNDS = 12
"""States that are tried at random, and how often again, ever nearer to the worst."""
ROUND_OFF = 1e-9
"""1/s: smaller inputs of energy are round-off."""
SLIP = np.radians(30.0)
"""The largest angle between bow and motion that counts as going ahead."""


class Driven(NamedTuple):
    """The state in which parts put most energy in: P/E, 1/s, E = ½νᵀ(M_RB + M_A)ν; P, W; v, m/s; ω, rad/s.

    share: of the states that were tried, in which P > 0.
    """

    rate: float
    power: float
    velocity: np.ndarray
    angular_velocity: np.ndarray
    share: float


def driven(vehicle: Any, speed: float = 1.0, *, ahead: bool = False) -> Driven | None:
    """Where parts drive a vehicle in still water with its actuators as they start; None if none was found.

    None, too, for a vehicle that is `pushed` at rest.

    P = F·v + T·ω of all parts together, which a passive vehicle has below zero in every motion; Coriolis terms do no
    work. Of STATES motions at random and then ROUNDS times as many ever nearer to the worst, with one seed: an active
    motion may remain undetected.

    speed: largest |v|, m/s; ends of the hull turn at up to twice that. ahead: only motions within SLIP of the bow, with
    ends that turn at up to half of the speed.
    """
    size = float(vehicle.length) if vehicle.length is not None else 2 * float(np.cbrt(vehicle.volume))
    level = Level(vehicle)
    if pushed(level):
        return None
    M = level.mass

    def rates(V: Array) -> Array:
        def one(nu):
            return level.push(nu, level.rest) @ nu / (0.5 * nu @ M @ nu)

        return jax.vmap(one)(V)

    random = np.random.default_rng(1)
    turning = (0.5 if ahead else 2.0) * 2 * speed / size
    V = _motions(random, speed, turning, ahead)
    compute = tabulate(rates, V)
    found = np.asarray(compute(V))
    share = float(np.mean(found > ROUND_OFF))
    best, rate = V[np.argmax(found)], float(np.max(found))
    for k in range(ROUNDS):
        near = best + 0.5**k * _motions(random, speed, turning, False)
        near = _within(near, speed, turning, ahead)
        found = np.asarray(compute(near))
        if np.max(found) > rate:
            best, rate = near[np.argmax(found)], float(np.max(found))
    if rate <= ROUND_OFF:
        return None
    return Driven(rate, rate * float(0.5 * best @ M @ best), best[:3], best[3:], share)


def pushed(level: Level) -> bool:
    """Whether its parts push a vehicle at rest with its actuators as they start, as a propeller that always turns."""
    return bool(np.any(np.asarray(level.rates(np.zeros(6), level.rest)) != 0))


def _motions(random: np.random.Generator, speed: float, turning: float, ahead: bool) -> np.ndarray:
    """(STATES, 6) motions, v in a ball or a cone of it, ω in a ball; every eighth without turning."""
    v, omega = random.normal(size=(2, STATES, 3))
    v *= speed * np.cbrt(random.uniform(size=(STATES, 1))) / np.linalg.norm(v, axis=1, keepdims=True)
    omega *= turning * np.cbrt(random.uniform(size=(STATES, 1))) / np.linalg.norm(omega, axis=1, keepdims=True)
    omega[::8] = 0.0
    return _within(np.concatenate([v, omega], axis=1), speed, turning, ahead)


def _within(V: np.ndarray, speed: float, turning: float, ahead: bool) -> np.ndarray:
    """The motions brought into the bounds; without any, a little ahead."""
    v, omega = V[:, :3].copy(), V[:, 3:].copy()
    if ahead:
        v[:, 0] = np.maximum(np.abs(v[:, 0]), 1e-3 * speed)
        across = np.linalg.norm(v[:, 1:], axis=1, keepdims=True)
        v[:, 1:] *= np.minimum(1.0, np.tan(SLIP) * v[:, :1] / np.maximum(across, 1e-300))
    fast = np.linalg.norm(v, axis=1, keepdims=True)
    v *= np.minimum(1.0, speed / np.maximum(fast, 1e-300))
    most = turning * (np.linalg.norm(v, axis=1, keepdims=True) / speed if ahead else 1.0)
    omega *= np.minimum(1.0, most / np.maximum(np.linalg.norm(omega, axis=1, keepdims=True), 1e-300))
    return np.concatenate([v, omega], axis=1)
