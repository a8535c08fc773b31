"""Inputs that change within a step: linear between nodes, or a given function of time with free numbers.

A step sees them at the times where its method samples them: in the program by the functions below, in the run of the
optimum as `co.Linear` and `co.mechanics.Signal`, which are the same functions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree, Scalar
from coadjoint.checks import float64
from coadjoint.control.numbers import number, require_between, spread
from coadjoint.errors import ArgumentError, LagrangianError, shown
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.tracer import Tracer, flat
from coadjoint.mechanics.inputs import Between, Command
from coadjoint.mechanics.signals import Held, Linear, Signal
from coadjoint.mechanics.signatures import require_signature
from coadjoint.mechanics.state import NodeMotion
from coadjoint.mechanics.trace_checks import in_words, require_float64

COURSES = ("held", "linear")
"""The courses of an input over a step."""


@dataclass(frozen=True, eq=False)
class Profile:
    """An input u(t) = function(t, θ) with numbers θ that the optimum chooses.

        co.control.Profile(lambda t, theta: theta[0] * jnp.sin(theta[1] * t), guess=[1.0, 2.0], lower=0.0)

    function: t (s) and θ to a number or an array, written with `jax.numpy`; evaluated where the method samples it.
    guess: θ at the start of the solver, a number or (m,), which fixes their count. lower, upper: bounds of θ,
    numbers or of its shape, by default none. u itself is bounded by `path`.

    Raises ArgumentError and LagrangianError for other arguments.
    """

    function: Callable[[PyTree, PyTree], PyTree]
    guess: PyTree
    lower: Any = -math.inf
    upper: Any = math.inf

    def __post_init__(self):
        checks.function(self.function, "The function of co.control.Profile", "a function of t and its numbers θ")
        require_signature(self.function, "The function of co.control.Profile", ["t", "theta"])
        guess = float64(number(self.guess, "guess"), "Argument `guess` of co.control.Profile")
        checks.shape(guess, "Argument `guess` of co.control.Profile", (), "(m,)")
        object.__setattr__(self, "guess", guess)
        for name in ("lower", "upper"):
            object.__setattr__(self, name, spread(getattr(self, name), guess.shape, name, "a profile"))
        require_between(self.lower, self.upper, "a profile")

    @property
    def size(self) -> int:
        """The count of numbers θ."""
        return int(self.guess.size)

    def signal(self, theta: np.ndarray) -> Signal:
        """u(t) with these numbers."""
        return Signal(lambda t: self.function(t, theta))

    def require(self, name: str, t: float) -> None:
        """Raise LagrangianError or ArgumentError unless the function gives finite numbers at the start."""
        what = f"The profile `{name}`"
        require_float64(self.function, what, (np.float64(t), self.guess))
        with in_words(what):
            try:
                value = np.asarray(evaluate(self.function, np.float64(t), self.guess), float)
            except (TypeError, ValueError) as error:
                raise LagrangianError(f"{what} must return a number or an array of numbers.") from error
        if not np.all(np.isfinite(value)):
            raise ArgumentError(f"{what} must be finite at the start, t = {t:g} s, but is {shown(value)}.")


class Columns(NamedTuple):
    """The places of an input among the numbers u of a step: at its beginning and at its end, equal if held."""

    name: str
    given: Any
    begin: slice
    end: slice


def columns(inputs: list[tuple[str, PyTree]]) -> list[Columns]:
    """The places of inputs in u, in their order."""
    found, place = [], 0
    for name, given in inputs:
        size = int(np.prod(given.shape))
        begin = end = slice(place, place + size)
        if given.course == "linear":
            end = slice(place + size, place + 2 * size)
        found.append(Columns(name, given, begin, end))
        place = end.stop
    return found


def at_end(inputs: list[tuple[str, PyTree]]) -> list[int]:
    """The numbers of u that a node at the end of the step reads, in place of those at its beginning."""
    found: list[int] = []
    for one in columns(inputs):
        end = list(range(one.end.start, one.end.stop))
        found += end if one.begin == one.end else end + end
    return found


def line(t: Scalar, over_step: PyTree) -> PyTree:
    """u(t) of a step: from `begin` at `t` on with `slope`."""
    return over_step["begin"] + (t - over_step["t"]) * over_step["slope"]


def source(given: Any) -> PyTree:
    """The input of the program's system in place of a chosen one; other inputs unchanged."""
    if isinstance(given, Profile):
        return Between(function=given.function)
    if not hasattr(given, "course"):
        return given
    return Between(given.shape, function=line) if given.course == "linear" else Command(given.shape)


class Symbolic(NamedTuple):
    """The value of an input held over a step, with symbols: those of the step, and those of all steps."""

    held: PyTree
    of_step: list[Expr]
    of_all: list[Expr]


def symbolic(tracer: Tracer, name: str, source: object, example: PyTree, t: Scalar, h: Expr) -> Symbolic:
    """The symbols of one input over a step of h that begins at t; example: its held value in numbers."""
    if not isinstance(source, Between):
        held = tracer.symbols(f"inputs {name} ", example)
        return Symbolic(held, flat(held), [])
    if source.function is not line:
        held = tracer.symbols(f"theta {name} ", example)
        return Symbolic(held, [], flat(held))
    begin, end = (tracer.symbols(f"inputs {name} at the {side} ", example["begin"]) for side in ("begin", "end"))
    slope = np.empty(np.shape(begin), object)
    graph = tracer.graph
    slope.ravel()[:] = [graph.div(graph.sub(b, a), h) for a, b in zip(flat(begin), flat(end), strict=True)]
    return Symbolic({"begin": begin, "t": t, "slope": slope}, [*flat(begin), *flat(end)], [])


def first(given: Any, t: float) -> PyTree:
    """Its value held over the first step, with its guess."""
    if isinstance(given, Profile) or given.course == "held":
        return given.guess
    return {"begin": given.guess, "t": np.float64(t), "slope": np.zeros(given.shape)}


def guesses(inputs: Mapping[str, object]) -> dict[str, PyTree] | None:
    """Inputs as `co.simulate` takes them, with their guesses; None if there are none."""
    found = {}
    for name, given in inputs.items():
        found[name] = given.signal(given.guess) if isinstance(given, Profile) else getattr(given, "guess", given)
    return found or None


def flown_inputs(inputs: Mapping[str, PyTree], chosen: Mapping[str, np.ndarray], begin: float, h: float) -> PyTree:
    """Inputs as `co.simulate` takes them, with the optimal numbers; None if there are none."""
    found = {}
    for name, given in inputs.items():
        if isinstance(given, Profile):
            found[name] = given.signal(chosen[name])
        elif name not in chosen:
            found[name] = given
        elif given.course == "linear":
            found[name] = Linear(begin + h * np.arange(len(chosen[name])), chosen[name])
        else:
            found[name] = _held(chosen[name], begin, h)
    return found or None


@dataclass(frozen=True, eq=False)
class _Command:
    """A signal as a function of the motion, which a run takes once a step at its node: the value halfway."""

    signal: Held
    h: float

    def __call__(self, motion: NodeMotion) -> PyTree:
        return self.signal(motion.t + 0.5 * self.h)


def _held(values: np.ndarray, begin: float, h: float) -> PyTree:
    """values[k] over the step k."""
    return _Command(Held(begin + h * np.arange(len(values)), values), h)
