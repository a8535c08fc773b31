"""Currents as functions: of time, of the tides, of place and time."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError
from coadjoint.extending import evaluate, traced
from coadjoint.mechanics import Held
from coadjoint.models.quantities import vector
from coadjoint_vehicles.water.functions import returned
from coadjoint_vehicles.water.water import Water

HOUR = 3600.0
TIDES = {
    "M2": 12.4206012 * HOUR, "S2": 12.0 * HOUR, "N2": 12.65834751 * HOUR, "K2": 11.96723606 * HOUR,
    "K1": 23.93447213 * HOUR, "O1": 25.81933871 * HOUR, "P1": 24.06588766 * HOUR, "M4": 6.210300601 * HOUR,
}  # fmt: skip
"""Periods of tidal constituents, s (NOAA, harmonic constituents)."""


def _arguments(function: Callable[..., object]) -> int:
    """How many arguments a function takes that it must be given, or that are the time."""
    known = inspect.signature(function).parameters.values()
    return sum(given.default is given.empty or given.name == "t" for given in known)


def _require_finite(velocity: PyTree, what: str) -> None:
    if not np.all(np.isfinite(velocity)):
        raise ArgumentError(f"{what} must be finite, but is {np.asarray(velocity).tolist()} at the origin at t = 0.")


@dataclass(frozen=True, eq=False)
class TimeCurrent(Water):
    """The current function(t), (3,) m/s, the same everywhere: a function of time, t in s, in terms of jax.numpy.

    co.Linear(times, velocities) and co.mechanics.Signal are such functions; not co.Held, because a current that jumps
    pushes infinitely hard. Raises ArgumentError for an invalid current.
    """

    function: Callable[[PyTree], PyTree]

    steady = False

    def __post_init__(self) -> None:
        checks.function(self.function, "function", "a function of time")
        if isinstance(self.function, Held):
            raise ArgumentError(
                "A current must not jump, as co.Held does: take co.Linear, with a short time in between."
            )
        _require_finite(evaluate(lambda t: self.current(jnp.zeros(3), t, None, None), np.float64(0.0)), "The current")

    def current(self, position: Array, t: Scalar, internal: PyTree, own: PyTree) -> Array:
        return returned(self.function, (t,), (3,), "The current as a function of time")


@dataclass(frozen=True, eq=False)
class CurrentField(Water):
    """The current function(position) or function(position, t), (3,) m/s, in terms of jax.numpy.

    position: (3,) m, north, east, down. t: s. Its derivatives in position and time are taken by differentiation. An
    argument with a default is not t, unless that is its name. Raises ArgumentError for any other function.
    """

    function: Callable[..., PyTree]

    uniform = False

    def __post_init__(self) -> None:
        fits = callable(self.function) and _arguments(self.function) in (1, 2)
        checks.expect(fits, self.function, "function", "a function of (position) or (position, t)")
        here = evaluate(lambda q, t: self.current(q, t, None, None), np.zeros(3), np.float64(0.0))
        _require_finite(here, "The current")

    @property
    def steady(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return _arguments(self.function) == 1

    def current(self, position: Array, t: Scalar, internal: PyTree, own: PyTree) -> Array:
        arguments = (position,) if self.steady else (position, t)
        return returned(self.function, arguments, (3,), "The current as a function of place")


@dataclass(frozen=True, eq=False)
class TidalCurrent(Water):
    """c(t) = mean + Σ_i amplitudes_i cos(2πt/T_i − phases_i), everywhere.

    constituents: k of them, by their names in `TIDES`, such as "M2", or by their periods in s. amplitudes: (k, 3) m/s,
    north, east, down. phases: (k, 3) rad at t = 0, by default 0; a quarter turn between north and east is a current
    that goes round. mean: (3,) m/s. Raises ArgumentError for unknown names, periods ≤ 0 and wrong shapes.
    """

    constituents: Sequence[object]
    amplitudes: Any
    phases: Any = None
    mean: PyTree = (0.0, 0.0, 0.0)

    steady = False

    def __post_init__(self) -> None:
        fits = not isinstance(self.constituents, (str, float, int)) and len(self.constituents) != 0
        checks.expect(fits, self.constituents, "constituents", "a list such as ['M2']")
        periods = float64([self._period(one) for one in self.constituents], "Argument `constituents`")
        shape = (len(periods), 3)
        amplitudes = checks.array(self.amplitudes, "amplitudes", shape)
        phases = np.zeros(shape) if self.phases is None else checks.array(self.phases, "phases", shape)
        for name, value in (("amplitudes", amplitudes), ("phases", phases), ("periods", periods)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "mean", vector(self.mean, "mean"))

    periods = None

    @staticmethod
    def _period(one: Any) -> Any:
        if isinstance(one, str):
            if one not in TIDES:
                raise ArgumentError(
                    f"The constituent {one!r} is not known: give its period in s, or one of {', '.join(TIDES)}."
                )
            return TIDES[one]
        checks.expect(traced(one) or one > 0, one, "The period of a constituent", "positive, in s")
        return one

    def parameters(self) -> dict[str, PyTree]:
        return {"periods": self.periods, "amplitudes": self.amplitudes, "phases": self.phases, "mean": self.mean}

    def current(self, position: Array, t: Scalar, internal: PyTree, own: PyTree) -> Array:
        angle = 2 * jnp.pi * t / own.periods[:, None] - own.phases
        return own.mean + jnp.sum(own.amplitudes * jnp.cos(angle), axis=0)
