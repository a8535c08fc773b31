"""The linearised motion of a vehicle that goes straight ahead: what its pilots' gains are proposed from."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import brentq

from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Array
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.spaces.named import Named, named
from coadjoint.vehicles.parts.part import Flow, Part

DOWN = np.array([0.0, 0.0, 1.0])
UNSTABLE = 0.7
"""The part of its fastest turn that a vehicle is asked for where fins must hold against the turn."""


class UnderWay(NamedTuple):
    """M d(v, ω)/dt = A δ(v, ω) + B δ(commands) near (v, ω) = (U, 0, 0, 0, 0, 0), level, order surge … yaw, about O.

    mass: M, (6, 6), body and added. damping: A, (6, 6), with Coriolis and Munk terms. effects: B, (6, k), per unit of
    each command. names: of the parts that are commanded, one for each column; lags (s), limits: theirs. trim: their
    commands at speed U. righting: m g r_g − B r_b, N m. speed: U, m/s. acting: which of the vehicle's commands the
    columns are; the others, such as a ballast's, push nothing.
    """

    mass: np.ndarray
    damping: np.ndarray
    effects: np.ndarray
    names: tuple[str, ...]
    lags: np.ndarray
    limits: np.ndarray
    trim: np.ndarray
    righting: np.ndarray
    speed: float
    acting: np.ndarray


def under_way(vehicle: Any, speed: float) -> UnderWay:
    """The vehicle linearised at a speed through the water (m/s), with the propulsion that keeps it.

    Raises ArgumentError where no propulsion does.
    """
    parts = vehicle.commanded
    trim = _trim(vehicle, speed)
    ahead = np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0])
    M = mass_matrix(vehicle)

    def push(nu: Array, commands: Array) -> Array:
        return coriolis(M, nu) + wrench(vehicle, nu, commands)

    damping, effects = evaluate(jax.jacfwd(push, argnums=(0, 1)), ahead, trim)
    names = np.array([part.name for part in parts for _ in range(_size(part))])
    acting = {name for name, column in zip(names, effects.T, strict=True) if np.any(column != 0)}
    kept = np.array([name in acting for name in names], dtype=bool)
    lags, limits = (_each(parts, key, missing)[kept] for key, missing in (("lag", 0.0), ("limit", np.inf)))
    _, righting = weight(vehicle)
    return UnderWay(
        M,
        damping,
        effects[:, kept],
        tuple(names[kept].tolist()),
        lags,
        limits,
        trim[kept],
        righting,
        float(speed),
        kept,
    )


def steady(
    vehicle: Any, motion: UnderWay, across: int, row: int, shares: np.ndarray, most: float
) -> tuple[float, float]:
    """(rate, δ) of the fastest steady turn in a plane that |δ| ≤ `most` (rad) holds, up to 1 rad/s.

    across, row: 1 and 5 for yaw, 2 and 4 for pitch. shares: of the commands in δ. Slip and δ balance force and torque.
    Where δ < 0 the turn is unstable, and UNSTABLE of the fastest rate is given.
    """
    rest = _at_rest(vehicle)

    def balance(x: Array, rate: Array) -> Array:
        nu = jnp.zeros(6).at[0].set(motion.speed).at[across].set(x[0]).at[row].set(rate)
        commands = jnp.asarray(rest).at[np.flatnonzero(motion.acting)].set(motion.trim + shares * x[1])
        found = coriolis(motion.mass, nu) + wrench(vehicle, nu, commands)
        return jnp.stack([found[across], found[row]])

    x = np.zeros(2)
    both = tabulate(lambda x, rate: (balance(x, rate), jax.jacfwd(balance)(x, rate)), x, np.float64(0))
    turns = [(0.0, 0.0)]
    for rate in np.geomspace(0.01, 1.0, 14):
        for _ in range(8):
            value, slope = both(x, np.float64(rate))
            change = np.linalg.solve(slope, -value)
            x = x + change
            if np.abs(change).max() < 1e-6:
                break
        else:
            break
        if abs(x[1]) > most or abs(x[0]) > motion.speed:
            break
        turns.append((float(rate), float(x[1])))
    rates, angles = np.transpose(turns)
    rate = rates[-1] if angles[-1] >= 0 else UNSTABLE * rates[-1]
    return float(rate), float(np.interp(rate, rates, angles))


def mass_matrix(vehicle: Any) -> np.ndarray:
    """M_RB + M_A about O, (6, 6), with what its parts hold at their start."""
    total = np.asarray(vehicle.added_mass) + np.block(
        [[np.zeros((3, 3)), np.zeros((3, 3))], [np.zeros((3, 3)), np.asarray(vehicle.inertia)]]
    )
    for mass, position in _masses(vehicle):
        hat = _hat(position)
        total = total + mass * np.block([[np.eye(3), -hat], [hat, -hat @ hat]])
    return total


def weight(vehicle: Any) -> tuple[float, np.ndarray]:
    """(W − B, Σ m g r_g − Σ ρ V g r_b), N and N m, with what its parts hold at their start."""
    net, righting = 0.0, np.zeros(3)
    g, density = float(vehicle.gravity), float(vehicle.fluid_density)
    for mass, position in _masses(vehicle):
        net, righting = net + mass * g, righting + mass * g * position
    volumes = [(vehicle.volume, vehicle.center_of_buoyancy)]
    for part in vehicle.parts:
        volumes.extend(part.displaced(_start(part), own(part)))
    for volume, position in volumes:
        push = density * float(volume) * g
        net, righting = net - push, righting - push * np.asarray(position)
    return float(net), righting


def _masses(vehicle: Any) -> list[tuple[float, np.ndarray]]:
    found = [(float(vehicle.mass), np.asarray(vehicle.center_of_mass))]
    for part in vehicle.parts:
        for mass, position, _ in part.lumps(_start(part), own(part)):
            found.append((float(mass), np.asarray(position)))
    return found


def coriolis(M: Any, nu: Array) -> Array:
    """(p × ω, π × ω + p × v) of (p, π) = M (v, ω): Kirchhoff's equations, the Munk moment in them."""
    p, pi = (M @ nu)[:3], (M @ nu)[3:]
    return jnp.concatenate([jnp.cross(p, nu[3:]), jnp.cross(pi, nu[3:]) + jnp.cross(p, nu[:3])])


def wrench(vehicle: Any, nu: Array, commands: Any = None) -> Array:
    """Forces and torques of all parts, (6,), about O, in water of the vehicle's density, level at the surface.

    commands: a row of numbers, in the order of `vehicle.commanded`, where the actuators have come to; their starts by
    default.
    """
    actual = _actual(vehicle, _at_rest(vehicle) if commands is None else commands)
    zero = jnp.zeros(())
    flow = Flow(nu[:3], nu[3:], jnp.asarray(vehicle.fluid_density), jnp.asarray(DOWN), zero, zero)
    total = jnp.zeros(6)
    for part in vehicle.parts:
        found = part.force(flow, actual.get(part.name), own(part))
        zeros = jnp.zeros(3)
        force = zeros if found.force is None else found.force
        total = total + jnp.concatenate([force, zeros if found.torque is None else found.torque])
    return total


def own(part: Part) -> Named:
    """The part's parameters as its methods read them."""
    return Named(**part.parameters())


def _trim(vehicle: Any, speed: float) -> np.ndarray:
    """The commands at which what pushes ahead balances the drag: all else stays as it starts."""
    parts, rest = vehicle.commanded, _at_rest(vehicle)
    ahead = np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0])

    pushed = tabulate(lambda commands: wrench(vehicle, jnp.asarray(ahead), commands)[0], rest)

    def surge(commands: np.ndarray) -> float:
        return float(pushed(commands))

    limits = _each(parts, "limit", np.inf)
    turning = np.array([part.command.unit == "rad" for part in parts for _ in range(_size(part))], dtype=bool)
    highest = np.where(turning | np.isinf(limits), rest, limits)
    if np.all(highest == rest) or surge(rest) >= 0:
        return rest
    if surge(highest) <= 0:
        raise ArgumentError(
            f"The vehicle `{vehicle.name}` cannot go {speed:g} m/s: at the limit of its propulsion the drag is larger."
        )
    share = float(brentq(lambda x: surge(rest + x * (highest - rest)), 0.0, 1.0, xtol=1e-12))  # pyright: ignore
    return rest + share * (highest - rest)


def _size(part: Any) -> int:
    return int(np.prod(part.command.shape, dtype=int))


def _start(part: Any) -> Any:
    """Where the actuator of a part starts; None where it has none."""
    if part.command is None:
        return None
    return named(part.at_rest(np.full(part.command.shape, part.command.start, dtype=float)))


def _at_rest(vehicle: Any) -> np.ndarray:
    starts = [np.full(_size(part), part.command.start, dtype=float) for part in vehicle.commanded]
    return np.concatenate(starts) if starts else np.zeros(0)


def _each(parts: Any, key: str, otherwise: float) -> np.ndarray:
    """A number for each command; of two limits the higher."""
    values = [np.full(_size(part), np.max(part.parameters().get(key, otherwise)), dtype=float) for part in parts]
    return np.concatenate(values) if values else np.zeros(0)


def _actual(vehicle: Any, commands: Any) -> dict[str, Any]:
    """A row of numbers as where the actuators are, by the names of the parts."""
    found, start = {}, 0
    for part in vehicle.commanded:
        end = start + _size(part)
        found[part.name] = named(part.at_rest(jnp.reshape(jnp.asarray(commands)[start:end], part.command.shape)))
        start = end
    return found


def _hat(r: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
