"""Line-of-sight guidance: which course, and which pitch, leads on to the straight line between two way points."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from coadjoint.groups.group import Array


class Leg(NamedTuple):
    """Where a point stands beside a straight leg: `course` and `climb` of the leg (rad), distances in m.

    climb: positive upwards. length: of the leg over ground. along: over ground, from its start; beside: to starboard of
    it; beneath: under it, across it in the vertical plane.
    """

    course: Array
    climb: Array
    length: Array
    along: Array
    beside: Array
    beneath: Array


def leg(position: Array, start: Array, end: Array) -> Leg:
    """(along, beside) = (cos χ (n − n₀) + sin χ (e − e₀), −sin χ (n − n₀) + cos χ (e − e₀)), χ = atan2(Δe, Δn).

    beneath = cos γ (d − d₀) + sin γ · along, γ = −atan2(Δd, √(Δn² + Δe²)). position, start, end: (north, east, depth).
    """
    way, off = end - start, position - start
    length = jnp.sqrt(way[0] ** 2 + way[1] ** 2 + 1e-300)
    course, climb = jnp.arctan2(way[1], way[0]), -jnp.arctan2(way[2], length)
    along = jnp.cos(course) * off[0] + jnp.sin(course) * off[1]
    beside = jnp.cos(course) * off[1] - jnp.sin(course) * off[0]
    return Leg(course, climb, length, along, beside, jnp.cos(climb) * off[2] + jnp.sin(climb) * along)


def line_of_sight(across: Array, integral: Array, look_ahead: Any, gain: Any, period: Any) -> tuple[Array, Array]:
    """(χ, I): the angle χ = −atan((y + σI)/Δ) to the leg, and I ← I + T Δy/(Δ² + (y + σI)²).

    across: y, m, to starboard of the leg (or beneath it). look_ahead: Δ, m. gain: σ, m/s: what the integral moves the
    aim by; 0 for plain line of sight. In a current across, or with sideslip, y goes to 0 and σI to Δ tan of the angle
    that holds against it. The integral grows slowly far from the path, so that it hardly winds up.
    Source: Børhaug, Pavlov, Pettersen (2008), (9)–(10); Fossen (2021), 12.4.
    """
    aim = across + gain * integral
    following = integral + period * look_ahead * across / (look_ahead**2 + aim**2)
    return -jnp.arctan((across + gain * following) / look_ahead), following


def arrived(position: Array, here: Leg, end: Array, acceptance: Any) -> Array:
    """Whether a way point is within the circle of acceptance (m, over ground), or its leg is behind."""
    gap = position[:2] - end[:2]
    return (gap @ gap < acceptance**2) | (here.along > here.length)
