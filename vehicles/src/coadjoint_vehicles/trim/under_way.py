"""The linearised motion of a vehicle that goes straight ahead: the basis of its controllers' proposed gains."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import brent, evaluate, legendre, named, tabulate
from coadjoint.groups import SE3
from coadjoint.mechanics import State
from coadjoint.spaces import Named
from coadjoint_vehicles.model.craft import Craft
from coadjoint_vehicles.model.vehicle import Vehicle

UNSTABLE = 0.7
"""The part of its fastest turn that a vehicle is asked for where fins must hold against the turn."""


class Level:
    """A vehicle level in still water at a depth of 0: the rates (6,) of its momenta (p, π), in the order surge … yaw.

    d(p, π)/dt = ad*_V MV + the forces of all parts, V = (v, ω), with ad* of SE(3) and M of the craft's own Lagrangian;
    weight and buoyancy are left out: `coadjoint.stability.Reduced` without them. commands: a row of numbers in the
    order of `vehicle.commanded`, where the actuators have come to.
    """

    def __init__(self, vehicle: Any):
        self.vehicle = vehicle
        self.rest = np.concatenate([np.zeros(0), *(np.full(size(p), p.command.start) for p in vehicle.commanded)])
        craft = Craft(vehicle)
        self._system, self._start = craft.system, craft.start()

    @cached_property
    def push(self) -> Callable[..., PyTree]:
        """(motion, commands) → d(p, π)/dt without weight and buoyancy, (6,); traced once, with its derivative."""
        return jax.jit(self._rates)

    def _rates(self, motion: Array, commands: Array) -> Array:
        at = self._at(motion, commands)
        torque, force = self._system.body_force(
            self._system.motion(at.xi, at.n, at.nu, at.a, at.t, at.inputs, at.internal)
        )
        return coadjoint(self.mass, motion) + jnp.concatenate([force, torque])

    def surge(self, speed: float, commands: PyTree = None) -> float:
        """The first row of `push` going straight ahead, N; actuators are at rest by default."""
        return float(self.rates(speed * np.eye(6)[0], self.rest if commands is None else commands)[0])

    @cached_property
    def mass(self) -> np.ndarray:
        """M = ∂(p, π)/∂(v, ω), (6, 6): body, parts, and added mass."""

        def momenta(motion: Array) -> Array:
            at = self._at(motion, self.rest)
            mu, pi = legendre(self._system, at.xi, at.n, at.nu, at.a, at.t, at.inputs, at.internal)
            return jnp.concatenate([pi, mu])

        return evaluate(jax.jacfwd(momenta), np.zeros(6))

    @cached_property
    def rates(self) -> Callable[..., PyTree]:
        """`push` on numbers."""
        return tabulate(self.push, np.zeros(6), self.rest)

    def slopes(self, motion: np.ndarray, commands: np.ndarray) -> np.ndarray:
        """∂`push`/∂(motion, commands), (6, 6 + commands)."""

        def along(at: object, direction: object) -> Callable[..., PyTree]:
            return jax.jvp(self.push, at, direction)[1]

        at = motion, commands
        one = tabulate(along, at, at)
        return np.transpose([one(at, (e[:6], e[6:])) for e in np.eye(6 + len(commands))])

    def _at(self, motion: PyTree, commands: PyTree) -> State:
        found, begin = {}, 0
        for part in self.vehicle.commanded:
            end = begin + size(part)
            row = jnp.reshape(jnp.asarray(commands)[begin:end], part.command.shape)
            found[part.name], begin = named(part.at_rest(row)), end
        return self._start.replace(nu=motion[:3], xi=motion[3:], internal=Named(**found) if found else None)


def coadjoint(M: Array, motion: Array) -> Array:
    """ad*_V MV on SE(3) of V = (v, ω), (6,): Coriolis terms and the Munk moment of a mass matrix."""
    momentum = M @ motion
    rate = SE3().ad_dual(jnp.roll(motion, 3), jnp.roll(momentum, 3))
    return jnp.roll(rate, 3)


class UnderWay(NamedTuple):
    """M d(v, ω)/dt = A δ(v, ω) + B δ(commands) near (v, ω) = (U, 0, 0, 0, 0, 0), level, order surge … yaw, about O.

    mass: M, (6, 6), body and added. damping: A, (6, 6), with Coriolis and Munk terms. effects: B, (6, k), per unit of
    each command. names: of the parts that are commanded, one for each column; lags (s), limits: theirs, on the side
    that pushes ahead. trim: their commands at speed U. speed: U, m/s. acting: which of the vehicle's commands the
    columns are; the others, such as a
    ballast's, push nothing. level: its equations of motion.
    """

    mass: np.ndarray
    damping: np.ndarray
    effects: np.ndarray
    names: tuple[str, ...]
    lags: np.ndarray
    limits: np.ndarray
    trim: np.ndarray
    speed: float
    acting: np.ndarray
    level: Level


def under_way(vehicle: Vehicle, speed: float) -> UnderWay:
    """The vehicle linearised at a speed through the water (m/s), with the propulsion that keeps it.

    Raises ArgumentError where no propulsion does.
    """
    level, parts = Level(vehicle), vehicle.commanded
    trim = propulsion_at(level, speed)
    ahead = speed * np.eye(6)[0]
    slopes = level.slopes(ahead, trim)
    damping, effects = slopes[:, :6], slopes[:, 6:]
    names = np.array([part.name for part in parts for _ in range(size(part))])
    acting = {name for name, column in zip(names, effects.T, strict=True) if np.any(column != 0)}
    kept = np.array([name in acting for name in names], dtype=bool)
    lags, limits = (_each(parts, key, missing)[kept] for key, missing in (("lag", 0.0), ("limit", np.inf)))
    limits = np.where(effects[0, kept] < 0, -_each(parts, "limit", np.inf, 0)[kept], limits)
    return UnderWay(
        level.mass, damping, effects[:, kept], tuple(names[kept].tolist()), lags, limits, trim[kept], float(speed),
        kept, level,
    )  # fmt: skip


def steady(motion: UnderWay, across: int, row: int, shares: np.ndarray, most: float) -> tuple[float, float]:
    """(rate, δ) of the fastest steady turn in a plane that |δ| ≤ `most` (rad) holds, up to 1 rad/s.

    across, row: 1 and 5 for yaw, 2 and 4 for pitch. shares: of the commands in δ. Slip and δ balance force and torque.
    Where δ < 0 the turn is unstable, and UNSTABLE of the fastest rate is given.
    """
    level = motion.level

    def balance(x: Array, rate: Array) -> Array:
        nu = jnp.zeros(6).at[0].set(motion.speed).at[across].set(x[0]).at[row].set(rate)
        commands = jnp.asarray(level.rest).at[np.flatnonzero(motion.acting)].set(motion.trim + shares * x[1])
        found = level.push(nu, commands)
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


def propulsion_at(level: Level, speed: float) -> np.ndarray:
    """The commands at which the propulsion balances the drag; all other actuators keep their starting values."""
    rest, highest = level.rest, _ahead(level)
    if np.all(highest == rest) or level.surge(speed) >= 0:
        return rest
    if level.surge(speed, highest) <= 0:
        raise ArgumentError(
            f"The vehicle `{level.vehicle.name}` cannot go {speed:g} m/s: at the limit of its propulsion the drag is "
            "larger."
        )

    def missing(share: float) -> float:
        return level.surge(speed, rest + share * (highest - rest))

    return rest + brent(missing, 0.0, 1.0, xtol=1e-12) * (highest - rest)


def _ahead(level: Level) -> np.ndarray:
    """The commands at which all propulsion pushes ahead as it can: that end of each which pushes more, or its rest.

    A propeller whose axis points aft pushes ahead at its lowest command.
    """
    parts, rest = level.vehicle.commanded, level.rest
    turning = np.array([part.command.unit == "rad" for part in parts for _ in range(size(part))], dtype=bool)
    ends = _each(parts, "limit", np.inf, 0), _each(parts, "limit", np.inf)
    found, still = rest.copy(), level.surge(0.0)
    for i in np.flatnonzero(~turning & np.isfinite(ends[1])):
        pushes = [level.surge(0.0, np.where(np.arange(len(rest)) == i, end, rest)) - still for end in ends]
        found[i] = ends[int(np.argmax(pushes))][i] if max(pushes) > 0 else rest[i]
    return found


def size(part: Any) -> int:
    """How many numbers command a part."""
    return int(np.prod(part.command.shape, dtype=int))


def _each(parts: Any, key: str, otherwise: float, which: int = -1) -> np.ndarray:
    """A number for each command; of two limits the higher, or with `which` = 0 the lowest command."""
    found = [np.zeros(0)]
    for part in parts:
        value = np.asarray(part.parameters().get(key, otherwise), dtype=float)
        end = value[which] if value.ndim else (-value if which == 0 else value)
        found.append(np.broadcast_to(end, (size(part),)))
    return np.concatenate(found)
