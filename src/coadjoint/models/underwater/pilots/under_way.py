"""The linearised motion of a vehicle that goes straight ahead: what its pilots' gains are proposed from."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import brentq

from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Array
from coadjoint.kernels.evaluate import evaluate
from coadjoint.models.underwater.parts.part import Flow, Part
from coadjoint.spaces.named import Named

DOWN = np.array([0.0, 0.0, 1.0])


class UnderWay(NamedTuple):
    """M d(v, ω)/dt = A δ(v, ω) + B δ(commands) near (v, ω) = (U, 0, 0, 0, 0, 0), level, order surge … yaw, about O.

    mass: M, (6, 6), body and added. damping: A, (6, 6), with Coriolis and Munk terms. effects: B, (6, k), per unit of
    each command. names: of the parts that are commanded, one for each column; lags (s), limits: theirs. trim: their
    commands at speed U. righting: m g r_g − B r_b, N m. speed: U, m/s.
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


def under_way(vehicle: Any, speed: float) -> UnderWay:
    """The vehicle linearised at a speed through the water (m/s), with the propulsion that keeps it.

    Raises ArgumentError where no propulsion does.
    """
    parts, rest = vehicle.commanded, _at_rest(vehicle)
    trim = _trim(vehicle, speed, rest)
    ahead = np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0])
    M = mass_matrix(vehicle)

    def push(nu: Array, commands: Array) -> Array:
        return coriolis(M, nu) + wrench(vehicle, nu, _shaped(parts, commands))

    damping, effects = evaluate(jax.jacfwd(push, argnums=(0, 1)), ahead, trim)
    W, B = vehicle.mass * vehicle.gravity, vehicle.buoyancy
    return UnderWay(
        M, damping, effects,
        tuple(part.name for part in parts for _ in range(_size(part))),
        _each(parts, "lag", 0.0), _each(parts, "limit", np.inf), trim,
        W * vehicle.center_of_mass - B * vehicle.center_of_buoyancy, float(speed),
    )  # fmt: skip


def mass_matrix(vehicle: Any) -> np.ndarray:
    """M_RB + M_A about O, (6, 6), with what its parts hold at their start."""
    m, r = float(vehicle.mass), _hat(np.asarray(vehicle.center_of_mass))
    body = np.block([[m * np.eye(3), -m * r], [m * r, np.asarray(vehicle.inertia) - m * r @ r]])
    for part in vehicle.parts:
        for mass, position in part.lumps(_start(part), own(part)):
            hat = _hat(np.asarray(position))
            body = body + float(mass) * np.block([[np.eye(3), -hat], [hat, -hat @ hat]])
    return body + np.asarray(vehicle.added_mass)


def coriolis(M: Any, nu: Array) -> Array:
    """(p × ω, π × ω + p × v) of (p, π) = M (v, ω): Kirchhoff's equations, the Munk moment in them."""
    p, pi = (M @ nu)[:3], (M @ nu)[3:]
    return jnp.concatenate([jnp.cross(p, nu[3:]), jnp.cross(pi, nu[3:]) + jnp.cross(p, nu[:3])])


def wrench(vehicle: Any, nu: Array, actual: dict[str, Any]) -> Array:
    """Forces and torques of all parts, (6,), about O, in water of the vehicle's density, level at the surface."""
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


def _trim(vehicle: Any, speed: float, rest: np.ndarray) -> np.ndarray:
    """The commands at which a propeller, or what else pushes ahead, balances the drag: all else stays as it starts."""
    parts = vehicle.commanded
    ahead = np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0])

    def surge(commands: np.ndarray) -> float:
        return float(evaluate(lambda c: wrench(vehicle, jnp.asarray(ahead), _shaped(parts, c))[0], commands))

    limits = _each(parts, "limit", np.inf)
    screws = np.array([part.command.unit != "rad" and np.isfinite(l) for part, l in _columns(parts, limits)])
    if not screws.any():
        return rest
    highest = np.where(screws, limits, rest)
    if surge(np.where(screws, 0.0, rest)) >= 0:
        return rest
    if surge(highest) <= 0:
        raise ArgumentError(
            f"The vehicle `{vehicle.name}` cannot go {speed:g} m/s: at the limit of its propulsion the drag is larger."
        )
    share = brentq(lambda x: surge(rest + x * (highest - rest)), 0.0, 1.0, xtol=1e-12)
    return rest + share * (highest - rest)  # pyright: ignore[reportOperatorIssue]


def _columns(parts: Any, values: np.ndarray) -> list[tuple[Any, Any]]:
    owners = [part for part in parts for _ in range(_size(part))]
    return list(zip(owners, values, strict=True))


def _size(part: Any) -> int:
    return int(np.prod(part.command.shape, dtype=int))


def _start(part: Any) -> Any:
    return None if part.command is None else np.full(part.command.shape, part.command.start, dtype=float)


def _at_rest(vehicle: Any) -> np.ndarray:
    starts = [np.ravel(_start(part)) for part in vehicle.commanded]
    return np.concatenate(starts) if starts else np.zeros(0)


def _each(parts: Any, key: str, otherwise: float) -> np.ndarray:
    """A number for each command; of two limits the higher."""
    values = [np.full(_size(part), np.max(part.parameters().get(key, otherwise)), dtype=float) for part in parts]
    return np.concatenate(values) if values else np.zeros(0)


def _shaped(parts: Any, commands: Any) -> dict[str, Any]:
    """A row of numbers as commands by the names of the parts."""
    found, start = {}, 0
    for part in parts:
        end = start + _size(part)
        found[part.name] = jnp.reshape(jnp.asarray(commands)[start:end], part.command.shape)
        start = end
    return found


def _hat(r: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
