"""Force curves: the thrust at a command, and the command for a wanted thrust.

A curve gives the bollard force F(u), N, of commands u of any shape, and its inverse; it never falls as u grows. Its
numbers are parameters of the part that has it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Any, ClassVar, cast

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.numbers import Numbers


@dataclass(frozen=True, eq=False)
class ForceCurve(Numbers, ABC):
    """F(u), N, never falling, with F = 0 at the neutral command. Its numbers are `p.thrusters.curve` of a system."""

    kind: ClassVar[str]
    """Its word in vehicle files."""

    @classmethod
    def of(cls, numbers: PyTree) -> ForceCurve:
        """The curve of the numbers under its word in a vehicle file."""
        return cast(Any, cls)(numbers)

    @property
    def counts(self) -> set[int]:
        """How many thrusters its numbers are of, where they differ between thrusters."""
        return set()

    @property
    def in_file(self) -> PyTree:
        """Its numbers in a vehicle file, of which `of` makes it again."""
        return getattr(self, fields(self)[0].name)

    @property
    def neutral(self) -> float:
        """The command of zero thrust."""
        return 0.0

    @property
    def reach(self) -> tuple[float, float] | None:
        """The commands that the curve is known for; None for all."""
        return None

    @abstractmethod
    def force(self, command: Array, own: Named) -> Array:
        """F(u), N, of commands of any shape."""

    @abstractmethod
    def command(self, force: Array, own: PyTree, limit: PyTree) -> Array:
        """u with F(u) = force, for forces between F(limit[0]) and F(limit[1])."""

    def require_growth(self, limit: tuple[float, float], name: str) -> None:
        """Raise ArgumentError if F falls anywhere between the limits: here it never does."""
        return


def _each(value: Any, key: str, kind: str) -> PyTree:
    """A number, or (n,) numbers, one for each thruster."""
    return _numbers(value, key, kind, (None,) if isinstance(value, (list, tuple)) or np.ndim(value) == 1 else ())


def _numbers(value: object, key: str, kind: str, shape: tuple[object, ...]) -> PyTree:
    found = float64(value, f"`{key}` of a {kind} force curve")
    if np.ndim(found) != len(shape) or (shape and np.shape(found)[0] == 0):
        expected = "a list of numbers" if shape else "one number"
        raise ArgumentError(f"`{key}` of a {kind} force curve must be {expected}, but has shape {np.shape(found)}.")
    return found


def _set(curve: ForceCurve, **values: object) -> None:
    for key, value in values.items():
        object.__setattr__(curve, key, value)


@dataclass(frozen=True, eq=False)
class Linear(ForceCurve):
    """F = s u. slope: s, N per unit of command, a number or that of each thruster, (n,)."""

    kind: ClassVar[str] = "linear"
    slope: Any

    def __post_init__(self) -> None:
        _set(self, slope=_each(self.slope, "slope", "linear"))
        if np.min(self.slope) <= 0:
            raise ArgumentError(f"The slope of a linear force curve must be positive, but is {np.min(self.slope):g}.")

    @property
    def counts(self) -> set[int]:
        return {np.size(self.slope)} if np.ndim(self.slope) else set()

    def force(self, command: Array, own: Named) -> Array:
        return own.slope * command

    def command(self, force: Array, own: PyTree, limit: PyTree) -> Array:
        return force / own.slope


@dataclass(frozen=True, eq=False)
class Quadratic(ForceCurve):
    """F = k₊ u² for u > 0 and −k₋ u² for u < 0, as of a propeller at bollard with u its revolutions.

    ahead, astern: k₊, k₋, N per unit of command squared, numbers or those of each thruster, (n,); astern is that ahead
    where it is left out.
    """

    kind: ClassVar[str] = "quadratic"
    ahead: Any
    astern: Any = None

    @classmethod
    def of(cls, numbers: PyTree) -> Quadratic:
        return cls(*numbers) if np.ndim(numbers) >= 1 else cls(numbers)

    @property
    def in_file(self) -> PyTree:
        return [self.ahead, self.astern]

    def __post_init__(self) -> None:
        astern = self.ahead if self.astern is None else self.astern
        _set(
            self,
            ahead=_each(self.ahead, "ahead", "quadratic"),
            astern=_each(astern, "astern", "quadratic"),
        )
        least, back = float(np.min(self.ahead)), float(np.min(np.asarray(self.astern)))
        if min(least, back) <= 0:
            raise ArgumentError(
                f"The factors of a quadratic force curve must be positive, but are ahead {least:g} and "
                f"astern {back:g}; a reversed thruster has a reversed direction."
            )

    @property
    def counts(self) -> set[int]:
        return {np.size(k) for k in (self.ahead, self.astern) if np.ndim(k)}

    def force(self, command: Array, own: Named) -> Array:
        return jnp.where(command > 0, own.ahead, own.astern) * jnp.abs(command) * command

    def command(self, force: Array, own: PyTree, limit: PyTree) -> Array:
        square = jnp.abs(force) / jnp.where(force > 0, own.ahead, own.astern)
        pushing = square > 0
        return jnp.sign(force) * jnp.where(pushing, jnp.sqrt(jnp.where(pushing, square, 1.0)), 0.0)


@dataclass(frozen=True, eq=False)
class Polynomial(ForceCurve):
    """F = c_1 u + c_2 u² + … + c_m u^m. coefficients: (c_1, …, c_m)."""

    kind: ClassVar[str] = "polynomial"
    coefficients: Any

    def __post_init__(self) -> None:
        _set(self, coefficients=_numbers(self.coefficients, "coefficients", "polynomial", (None,)))

    def force(self, command: Array, own: Named) -> Array:
        total = jnp.zeros(jnp.shape(command))
        for k in reversed(range(len(self.coefficients))):
            total = (total + own.coefficients[k]) * command
        return total

    def command(self, force: Array, own: PyTree, limit: PyTree) -> Array:
        """By halving, to 2⁻²⁰ of the limits, and four steps of Newton's method kept between them."""
        low = jnp.broadcast_to(jnp.asarray(limit[0], dtype=float), jnp.shape(force))
        high = jnp.broadcast_to(jnp.asarray(limit[1], dtype=float), jnp.shape(force))
        for _ in range(20):
            middle = 0.5 * (low + high)
            below = self.force(middle, own) < force
            low, high = jnp.where(below, middle, low), jnp.where(below, high, middle)
        u = 0.5 * (low + high)
        for _ in range(4):
            slope = self._slope(u, own)
            step = jnp.where(slope > 0, (force - self.force(u, own)) / jnp.where(slope > 0, slope, 1.0), 0.0)
            u = jnp.clip(u + step, low, high)
        return u

    def _slope(self, u: Array, own: Named) -> Array:
        total = jnp.zeros(jnp.shape(u))
        for k in reversed(range(len(self.coefficients))):
            total = total * u + (k + 1) * own.coefficients[k]
        return total

    def require_growth(self, limit: tuple[float, float], name: str) -> None:
        slope = np.polynomial.Polynomial([(k + 1) * c for k, c in enumerate(self.coefficients)])
        turns = [x.real for x in slope.deriv().roots() if abs(x.imag) < 1e-9 and limit[0] < x.real < limit[1]]
        least = min((slope(u), u) for u in (*limit, *turns))
        if least[0] < -1e-12 * float(np.max(np.abs(self.coefficients))):
            raise ArgumentError(
                f"The polynomial force curve of `{name}` must not fall between its limits {limit[0]:g} and "
                f"{limit[1]:g}, but falls at {least[1]:g}: narrow `limit`, or give a table."
            )


@dataclass(frozen=True, eq=False)
class Table(ForceCurve):
    """F(u) linear from row to row, and constant beyond the ends.

    F = F_z + Σ_{i≥z} s_i clip(u − u_i, 0, u_{i+1} − u_i) − Σ_{i<z} s_i clip(u_{i+1} − u, 0, u_{i+1} − u_i), where row z
    is that of the least |F|: a sum without any search, exactly zero in a dead band, of about three operations a row.
    The inverse is of the same form; where rows of equal force leave a choice, it is their middle.

    commands: u_i, (k,), growing. forces: F_i, (k,) N, never falling, from F ≤ 0 to F ≥ 0.
    """

    kind: ClassVar[str] = "table"
    commands: Any
    forces: Any

    @classmethod
    def of(cls, numbers: PyTree) -> Table:
        rows = np.asarray(numbers, dtype=float)
        checks.shape(rows, "A table of forces, (command, force),", "(n, 2)")
        return cls(rows[:, 0], rows[:, 1])

    @property
    def in_file(self) -> PyTree:
        return np.column_stack([self.commands, self.forces])

    def __post_init__(self) -> None:
        commands = _numbers(self.commands, "commands", "table", (None,))
        forces = _numbers(self.forces, "forces", "table", (None,))
        _set(self, commands=commands, forces=forces)
        if len(commands) < 2 or commands.shape != forces.shape:
            raise ArgumentError(
                f"A table of forces takes two rows at least, each a command and a force, but got {len(commands)} "
                f"commands and {len(forces)} forces."
            )
        for values, word in (
            (np.diff(commands) <= 0, "commands must grow"),
            (np.diff(forces) < 0, "forces must not fall"),
        ):
            if np.any(values):
                i = int(np.argmax(values))
                raise ArgumentError(
                    f"In a table of forces the {word} from row to row, but rows {i + 1} and {i + 2} are "
                    f"({commands[i]:g}, {forces[i]:g} N) and ({commands[i + 1]:g}, {forces[i + 1]:g} N)."
                )
        if forces[0] > 0 or forces[-1] < 0:
            raise ArgumentError(
                f"A table of forces must hold a command without force, but its forces are {forces[0]:g} to "
                f"{forces[-1]:g} N: add the row of rest."
            )

    @property
    def neutral(self) -> float:
        crossing = np.flatnonzero(self.forces == 0)
        if len(crossing):
            return float(0.5 * (self.commands[crossing[0]] + self.commands[crossing[-1]]))
        return float(np.interp(0.0, self.forces, self.commands))

    @property
    def reach(self) -> tuple[float, float]:
        return float(self.commands[0]), float(self.commands[-1])

    @property
    def _rest(self) -> int:
        return int(np.argmin(np.abs(self.forces)))

    def force(self, command: Array, own: Named) -> Array:
        z, u, F = self._rest, own.commands, own.forces
        total = jnp.zeros(jnp.shape(command)) + F[z]
        for i in range(len(self.commands) - 1):
            width = u[i + 1] - u[i]
            part = jnp.clip(command - u[i] if i >= z else u[i + 1] - command, 0.0, width)
            total = total + (part if i >= z else -part) * ((F[i + 1] - F[i]) / width)
        return total

    def command(self, force: Array, own: PyTree, limit: PyTree) -> Array:
        z, u, F = self._rest, own.commands, own.forces
        total = jnp.zeros(jnp.shape(force)) + u[z]
        for i in range(len(self.commands) - 1):
            rise = F[i + 1] - F[i]
            beyond = force - F[i] if i >= z else F[i + 1] - force
            flat = rise == 0
            share = jnp.where(
                flat, 0.5 * (1 + jnp.sign(beyond)), jnp.clip(beyond / jnp.where(flat, 1.0, rise), 0.0, 1.0)
            )
            total = total + (share if i >= z else -share) * (u[i + 1] - u[i])
        return total


CURVES: dict[str, type[ForceCurve]] = {curve.kind: curve for curve in (Linear, Quadratic, Polynomial, Table)}
"""The kinds of curves, by their words in vehicle files."""
