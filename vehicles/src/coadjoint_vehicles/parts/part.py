"""The part of a vehicle: it pushes, it may be commanded, and it may hold mass or displace water."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.mechanics import Course, Force
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import check_fields
from coadjoint_vehicles.parts.numbers import Numbers

AHEAD = np.array([1.0, 0.0, 0.0])
"""The direction of the hull, body axes."""


class Flow(NamedTuple):
    """The water as a part meets it; body axes forward, starboard, down, about the body origin O.

    velocity: v = ν − R⁻¹c, of O through the water, (3,) m/s. omega: ω, (3,) rad/s. density: ρ, kg/m³. down: direction
    of down. depth: of O, m. t: s. elsewhere: r ↦ R⁻¹(c(r) − c(O)), how the current at the point r of the body differs
    from that at O; None where it does not.
    """

    velocity: Array
    omega: Array
    density: Array
    down: Array
    depth: Array
    t: Array
    elsewhere: Callable[[Array], Array] | None = None

    def at(self, position: PyTree) -> Array:
        """v + ω × r minus the extra current at r: the velocity of the body's point r through the water."""
        moving = self.velocity + jnp.cross(self.omega, position)
        return moving if self.elsewhere is None else moving - self.elsewhere(position)


class Passing(NamedTuple):
    """How a craft goes at a node, as its momenta have it: velocity of O, through the water where that is uniform and
    steady, (3,) m/s, body axes; omega, (3,) rad/s; turn: R, from the body to space."""

    velocity: Array
    omega: Array
    turn: Array


@dataclass(frozen=True)
class Command:
    """The command of a part: the unit and shape of the command, and where the actuator starts."""

    unit: str
    shape: tuple[int, ...] = ()
    start: float = 0.0


@dataclass(frozen=True, eq=False)
class Part(Numbers, ABC):
    """One thing on a vehicle: a line of its energy budget, and an actuator where it has a `command`.

    name: a word, unique on a vehicle. Fields of a kind that hold numbers are its parameters: `area` of the part
    `rudder` is `p.rudder.area` of the system, and its methods get `p.rudder` as `own`.
    """

    kind: ClassVar[str] = ""
    """Its word in vehicle files."""
    name: str
    passive: ClassVar[bool] = False
    """Whether it can only extract energy from a vehicle in still water; certificates of runs report violations."""

    @property
    def no_signal(self) -> float | None:
        """The command that means no signal, which stops the actuator; None where every command is one."""
        return None

    def __post_init__(self) -> None:
        fits = isinstance(self.name, str) and self.name.isidentifier()
        checks.expect(fits, self.name, "The name of a part", "a word such as 'rudder'")
        check_fields(self, self.title)

    @property
    def title(self) -> str:
        """Its description in messages, without the closing quote."""
        return f"{self.kind.replace('_', ' ') or type(self).__name__} `{self.name}"

    @property
    def command(self) -> Command | None:
        """The command that a controller may set; None for a part without one."""
        return None

    def advance(self, actual: PyTree, command: Array, h: Scalar, own: Named) -> PyTree:
        """The actuator over h, co.mechanics.Course: ẋ = clip((u − x)/τ, ±rate) with u = clip(command, ±limit), exact
        for u held.

        limit, τ = own.lag (s) and own.rate (per s) count where the part has them; τ = 0: immediately, or at that rate.
        """
        wanted = jnp.clip(command, -own.limit, own.limit) if "limit" in own else command
        return towards(actual, wanted, h, own)

    def follow(self, actual: PyTree, command: Array, h: Scalar, own: Named, passing: Passing) -> PyTree:
        """As `advance`, for a part that needs to know how the craft goes at the node."""
        return self.advance(actual, command, h, own)

    @abstractmethod
    def force(self, flow: Flow, actual: PyTree, own: Named) -> Force:
        """Force and torque about O on the vehicle, body axes; `actual` is None without a command."""

    def travel(self, own: Named) -> tuple[PyTree, PyTree] | None:
        """The range of the actuator, (lowest, highest), None without one."""
        if "low" in own:
            return own.low, own.high
        if "limit" not in own:
            return None
        return (own.limit[0], own.limit[1]) if np.ndim(own.limit) else (-own.limit, own.limit)

    @property
    def units(self) -> dict[str, str] | None:
        """Units of the keys of the actuator's internal state, where that is a dictionary."""
        return None

    def at_rest(self, where: object) -> PyTree:
        """The actuator's internal state at rest where this command has taken it."""
        return where

    def lumps(self, actual: PyTree, own: Named) -> tuple[tuple[Array, Array, Array], ...]:
        """((mass, position, velocity in the hull), …): masses that this part moves, kg, m, m/s, beyond the body's."""
        return ()

    def displaced(self, actual: PyTree, own: Named) -> tuple[tuple[Array, Array], ...]:
        """((volume, position), …): volume that this part adds to the body's, m³ and m."""
        return ()

    def released(self, actual: PyTree, own: Named) -> tuple[tuple[Array, Array], ...]:
        """((momentum in space, place on the body), …), N s and m, of the masses that have left this part."""
        return ()

    @property
    def holds_mass(self) -> bool:
        """Whether it has lumps or displaces water."""
        return type(self).lumps is not Part.lumps or type(self).displaced is not Part.displaced

    def set(self, **values: object) -> None:
        """Give checked values to fields; for `__post_init__` of the kinds of parts."""
        for key, value in values.items():
            object.__setattr__(self, key, value)


def towards(x: Array, wanted: Array, h: Scalar, own: Named) -> Course:
    """The course over h of ẋ = clip((u − x)/τ, ±r) with u held, in closed form: at the rate r, then by the lag τ.

    x, wanted: u, of one shape. h: s. own: τ = own.lag (s) and r = own.rate (per s), where it has them; without both, x
    is u immediately. With e = u − x the first part takes it to e − m in the time |m|/r, m = clip(e − clip(e, ±rτ),
    ±rh).
    """
    gap, lag = wanted - x, own.lag if "lag" in own else jnp.zeros(())
    late = lag > 0
    moved = first = 0.0
    at_once = 1.0
    if "rate" in own:
        within = own.rate * lag
        moved = jnp.clip(gap - jnp.clip(gap, -within, within), -own.rate * h, own.rate * h)
        first, at_once = jnp.abs(moved) / own.rate, 0.0
    left = gap - moved
    share = jnp.where(late, -jnp.expm1(-(h - first) / jnp.where(late, lag, 1.0)), at_once)
    total = (gap - 0.5 * moved) * first + left * lag * share
    # A finished motion ends exactly at its command; a part at rest keeps its exact value.
    arrived = (share == 1) | (~late & (left == 0))
    end = jnp.where(arrived, wanted, x + (moved + left * share))
    begin = x if "rate" in own else jnp.where(late, x, wanted)
    return Course(end, x + (gap - total / h), begin)


def acting_at(position: PyTree, force: Array) -> Force:
    """A force at r as force and torque about O: (r × F, F)."""
    return Force(torque=jnp.cross(position, force), force=force)


def speed_of(vector: Array) -> Array:
    """|v|, with derivative 0 at rest."""
    square = vector @ vector
    moving = square > 0
    return jnp.where(moving, jnp.sqrt(jnp.where(moving, square, 1.0)), 0.0)
