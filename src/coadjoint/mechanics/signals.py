"""Signals: inputs as functions of time, known before the run, that every rule takes at its own nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import inf

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError, must_give, shown
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.kernels.trace.jaxprs import Tracer

EARLY = 1e-9
"""A jump comes this part of the shortest interval early, so that rounding never puts a node at a jump before it."""


@dataclass(frozen=True)
class Signal:
    """u(t), a function of time written with jax.numpy.

        co.simulate(body, start, dt=0.01, duration=10.0,
                    inputs={"thrust": co.mechanics.Signal(lambda t: 3.0 * jnp.sin(t))})

    function: t (s) to a number or an array, of one shape at all times. It is evaluated at the nodes of the method's own
    quadrature, so that the method keeps its order where u is smooth enough. A plain function given as an input is a
    function of the motion instead, held over each step.

    Raises ArgumentError unless it is a function whose values are numbers.
    """

    function: Callable[[PyTree], PyTree]

    def __post_init__(self):
        checks.function(
            self.function, "Argument `function` of co.mechanics.Signal", "a function of time, such as jnp.sin"
        )

    def __call__(self, t: Array | float) -> Array:
        value = self.function(t)
        try:
            return jnp.asarray(value, dtype=float)
        except (TypeError, ValueError) as error:
            raise ArgumentError(f"A signal must be a number or an array of numbers, but is {shown(value)}.") from error


class _Table(Signal):
    """Values at times, kept before the first time and after the last.

    The row in force is found by bisection, so that a table may be long. Times and values may be parameters, inside
    forces or a Lagrangian: n rows of these cost about n selections.
    """

    def __init__(self, times: PyTree, values: PyTree):
        name = type(self).__name__
        times, values = float64(times, f"The times of co.{name}"), float64(values, f"The values of co.{name}")
        if np.ndim(times) != 1 or np.shape(times)[0] == 0 or np.shape(values)[:1] != np.shape(times):
            raise ArgumentError(
                f"co.{name} takes times of shape (k,) and k values, one at least, but got times of shape "
                f"{np.shape(times)} and values of shape {np.shape(values)}."
            )
        checks.increasing(times, f"The sequence of times of co.{name}")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", values)

    times: Array
    values: Array

    def _rows(self, number: PyTree) -> tuple[Array, list[Array]]:
        """Borders (k − 1,) and columns (k, …), computed by JAX or NumPy: row i holds from borders[i − 1] to [i]."""
        must_give(self, "_rows")

    @cached_property
    def _constants(self) -> tuple[Array, list[Array]]:
        """The rows of constants, with borders at infinity that make them 2ᵏ − 1."""
        borders, columns = self._rows(np)
        size = (1 << len(borders).bit_length()) - 1
        return np.concatenate([borders, np.full(size - len(borders), np.inf)]), columns

    def _time(self, t: Array | float) -> Scalar:
        """A time unchanged, several as an array; raises ArgumentError for anything else."""
        plain = isinstance(t, float) and abs(t) < inf
        return t if plain or isinstance(t, Tracer) else float64(t, f"The time of co.{type(self).__name__}")

    def _row(self, t: Array | float) -> list[Array]:
        """The row of every column that is in force at t."""
        if traced(self.times, self.values):
            return _row_by_halving(t, *self._rows(jnp))
        return _row_by_bisection(t, *self._constants)

    def _key(self) -> tuple[object, ...]:
        return type(self), np.asarray(self.times).tobytes(), np.shape(self.values), np.asarray(self.values).tobytes()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Table) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def __repr__(self) -> str:
        return f"co.{type(self).__name__}({len(self.times)} times)"


class Held(_Table):
    """u(t) = values[i] for times[i] ≤ t < times[i + 1]: piecewise constant, a zero-order hold.

        co.Held(times=[0.0, 5.0, 10.0], values=[0.0, 3.0, -3.0])

    times: (k,), s, increasing. values: (k, …), a number or an array for each. Before the first time and after the last
    u keeps the value of that end. Jumps reduce the order: put them on the grid of steps, and use a method whose nodes
    are inside the step, such as Midpoint.

    Raises ArgumentError for times that do not increase, and for shapes that do not match.
    """

    def _rows(self, number: PyTree) -> tuple[Array, list[Array]]:
        gaps = number.diff(self.times)
        early = EARLY * number.min(gaps) if len(gaps) else 0.0
        return self.times[1:] - early, [self.values]

    def __call__(self, t: Array | float) -> Array:
        return self._row(self._time(t))[0]


def jumps(source: object) -> bool:
    """Whether an input is a `Held` whose values differ."""
    return isinstance(source, Held) and bool(np.any(source.values != source.values[:1]))


class Linear(_Table):
    """u(t) linear from (times[i], values[i]) to the next: piecewise linear.

        co.Linear(times=[0.0, 5.0, 10.0], values=[[0.0, 0.0], [3.0, 0.1], [3.0, 0.0]])

    times: (k,), s, increasing. values: (k, …), a number or an array for each. Before the first time and after the last
    u keeps the value of that end. Kinks reduce orders above 2, unless they are on the grid of steps.

    Raises ArgumentError for times that do not increase, and for shapes that do not match.
    """

    def _rows(self, number: PyTree) -> tuple[Array, list[Array]]:
        times, values = number.asarray(self.times), number.asarray(self.values)
        lengths = number.diff(times).reshape(-1, *(1 for _ in values.shape[1:]))
        flat = number.zeros((1, *values.shape[1:]))
        slopes = number.concatenate([flat, number.diff(values, axis=0) / lengths, flat])
        begins, starts = number.concatenate([times[:1], times]), number.concatenate([values[:1], values])
        return times, [begins, starts, slopes]

    def __call__(self, t: Array | float) -> Array:
        t = self._time(t)
        begin, start, slope = self._row(t)
        return start + (t - begin) * slope


@jax.jit
def _row_by_bisection(t: Array | float, borders: Array, columns: list[Array]) -> list[Array]:
    """Row i of every column, borders[i − 1] ≤ t < borders[i], among 2ᵏ − 1 borders by k comparisons.

    Compiled, so that JAX traces it once for a shape.
    """
    look = (len(borders) + 1) // 2
    i = jnp.zeros(jnp.shape(t), int)
    while look:
        i = jnp.where(t >= _at(borders, i + (look - 1)), i + look, i)
        look //= 2
    return [_at(column, i) for column in columns]


def _at(column: Array, i: Array) -> Array:
    """column[i], the last row where i is beyond it."""
    return jnp.asarray(column).at[i].get(mode="clip", wrap_negative_indices=False)


def _row_by_halving(t: Array | float, borders: Array, columns: list[Array]) -> list[Array]:
    """Row i of every column, borders[i − 1] ≤ t < borders[i], by halving a number of rows that is a power of two.

    For numbers that are parameters, which lie nowhere in memory where an index could point: n rows cost about n
    selections.
    """
    count = len(columns[0])
    size = 1 << max(count - 1, 0).bit_length()
    borders = jnp.concatenate([jnp.asarray(borders), jnp.full(size - count + 1, jnp.inf)])
    columns = [jnp.concatenate([column, jnp.repeat(column[-1:], size - count, axis=0)]) for column in columns]
    while size > 1:
        size //= 2
        later = t >= borders[size - 1]
        borders = jnp.where(later, borders[size:], borders[:size])
        columns = [jnp.where(later, column[size:], column[:size]) for column in columns]
    return [column[0] for column in columns]
