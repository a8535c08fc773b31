"""Events of runs, and where the zeros of their functions are between nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, LagrangianError, shown
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import State
from coadjoint.mechanics.trace_checks import in_words, require_float64
from coadjoint.roots import brent
from coadjoint.simulation.arguments import read_of

Direction = Literal["rising", "falling", "both"]
OF_THE_STATE = "a function of the state"


@dataclass(frozen=True)
class Event:
    """The zeros of a function of the state, f(state) = 0, or only those where it rises or falls, by `direction`.

        co.Event(lambda state: state.mu[2], direction="rising")

    function: a state to one number, in terms of jax.numpy. direction: "rising", from negative to positive in the order
    of the run; "falling"; or "both". name: what certificates call it, by default the name of the function. Raises
    ArgumentError for another direction or name, LagrangianError for no function.
    """

    function: Callable[[State], PyTree]
    direction: Direction = "both"
    name: str = ""

    def __post_init__(self) -> None:
        checks.function(self.function, "An event", OF_THE_STATE, LagrangianError)
        fits = isinstance(self.direction, str) and self.direction in get_args(Direction)
        checks.expect(fits, self.direction, "direction", '"rising", "falling" or "both"')
        if self.name != "":
            checks.text(self.name, "name")

    @property
    def title(self) -> str:
        """What certificates call it; empty for a function without a name."""
        found = self.name or getattr(self.function, "__name__", "")
        return "" if found == "<lambda>" else found.replace("_", " ")

    def counts(self, rises: bool) -> bool:
        """Whether a crossing that rises, or one that falls, is this event."""
        return self.direction == "both" or (self.direction == "rising") == rises


def as_event(given: Event | Callable[[State], PyTree] | None, what: str = "Argument `until`") -> Event | None:
    """The event for the value of `until`, or of a name in `events`."""
    if given is None or isinstance(given, Event):
        return given
    return Event(checks.function(given, what, OF_THE_STATE, LagrangianError))


def named_events(given: Mapping[str, Any] | None) -> dict[str, Event]:
    """Events by their names; raises ArgumentError if `given` is not a dictionary of events."""
    if given is None:
        return {}
    fits = isinstance(given, Mapping) and all(isinstance(name, str) for name in given)
    checks.expect(
        fits,
        given,
        "events",
        "a dictionary of names and functions of the state, as in events={'section': lambda state: state.mu[2]}",
    )
    if "until" in given:
        raise ArgumentError("The name `until` in `events` is that of the argument which ends a run: take another.")
    found: dict[str, Event] = {}
    for name, function in given.items():
        event = as_event(function, f"The event `{name}`")
        if event is None:
            raise LagrangianError(f"The event `{name}` must be a function of the state, but is None: leave it out.")
        found[name] = event
    return found


def require_event(event: Event, what: str, state: State) -> None:
    """Raise LagrangianError unless an event is a function of a state whose value is one finite number, and
    ArgumentError if it needs a g that the method does not compute.
    """

    def value(state: State) -> Any:
        require_float64(event.function, f"The function `{what}`", (state,))
        with in_words(f"The function `{what}`"):
            return evaluate(event.function, state)

    found = read_of(value, f"The function `{what}`", state)
    number = np.shape(found) == () and not isinstance(found, dict) and np.asarray(found).dtype == float
    if not number:
        raise LagrangianError(
            f"The function `{what}` must return one number, which crosses zero at the event, such as "
            f"lambda state: state.q[2] - 10.0, but returned {shown(found)}."
        )
    if not np.isfinite(np.asarray(found)):
        raise LagrangianError(f"The function `{what}` must be finite at the start, but is {found}.")


AT_START = 1e-9
"""A run that starts so near to a zero, as a part of its change over the first step, starts from that zero."""


LOCATED = 1e-13
"""The accuracy of the location of a crossing, as a part of a step."""


AHEAD = 3
"""The number of nodes examined after an interval: the cubic through four nodes shows where it may turn."""


Function = Callable[[float], float]


class Crossing(NamedTuple):
    """A crossing after the part θ of a step, and whether the function rises there."""

    theta: float
    rises: bool


def candidates(values: np.ndarray, count: int) -> np.ndarray:
    """Those of the first `count` intervals between nodes in which a function with these values may cross zero.

    Its sign differs between both nodes, or the cubic through four nodes turns back in between so near to zero that it
    may have crossed twice; `crossings` decides. values: (nodes,).
    """
    v = np.asarray(values)
    signs = np.sign(v)
    changed = (signs[:count] != 0) & (signs[:count] != signs[1 : count + 1])
    if len(v) < 4:
        return np.flatnonzero(changed)
    cubic, first = _cubics(v, count)
    turns = _turns(cubic, np.arange(count) - first)
    here = np.where(np.isnan(turns), 0.0, turns)
    lowest = _value(cubic, here) * np.where(signs[:count] != 0, signs[:count], signs[1 : count + 1])
    near = ~np.isnan(turns) & (lowest <= _doubt(cubic))
    return np.flatnonzero(changed | np.any(near, axis=0))


def crossings(values: np.ndarray, interval: int, f: Function) -> list[Crossing]:
    """The crossings in (0, 1] of an interval between two nodes, in order. f: the function after a part of the step.

    A zero at the node where the interval begins belongs to the one before. values: (nodes,).
    """
    v = np.asarray(values)
    ends: list[tuple[float, float]] = [(0.0, float(v[interval])), (1.0, float(v[interval + 1]))]
    guess = None
    if len(v) >= 4:
        cubics, first = _cubics(v, interval + 1)
        cubic, shift = cubics[:, interval], interval - int(first[interval])
        turns = [t - shift for t in np.ravel(_turns(cubic[:, None], np.array([shift]))) if np.isfinite(t)]
        ends = [ends[0], *(_turning_point(f, t, ends) for t in sorted(turns)), ends[1]]
        guess = partial(_at, cubic, shift)
    found = []
    for (a, left), (b, right) in pairwise(ends):
        if left != 0 and np.sign(left) != np.sign(right):
            found.append(Crossing(_root(f, (a, left), (b, right), guess), right > left))
    return found


def from_zero(values: np.ndarray) -> np.ndarray:
    """The values (nodes,) of a run from its start; the first is 0 if it is round-off, as after a stop at an event."""
    if len(values) > 1 and abs(values[0]) <= AT_START * abs(values[1] - values[0]):
        return np.concatenate([[0.0], values[1:]])
    return values


def _cubics(v: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The coefficients (4, count) of the cubic through four nodes for each interval, and the first of these nodes."""
    first = np.minimum(np.arange(count), len(v) - 4)
    a, b, c, d = (v[first + k] for k in range(4))
    d1, d2, d3 = b - a, c - 2 * b + a, d - 3 * c + 3 * b - a
    return np.stack([a, d1 - d2 / 2 + d3 / 3, (d2 - d3) / 2, d3 / 6]), first


def _value(cubic: np.ndarray, x: np.ndarray | float) -> np.ndarray:
    return cubic[0] + x * (cubic[1] + x * (cubic[2] + x * cubic[3]))


def _at(cubic: np.ndarray, shift: int, theta: float) -> float:
    return float(_value(cubic, theta + shift))


def _turns(cubic: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Both zeros (2, count) of the cubic's slope that lie in (shift, shift + 1), NaN elsewhere."""
    _, b, c, d = cubic
    with np.errstate(all="ignore"):
        q = -(c + np.where(c >= 0, 1, -1) * np.sqrt(c * c - 3 * b * d))
        x = np.stack([q / (3 * d), b / q])
        return np.where((x > shift) & (x < shift + 1), x, np.nan)


def _doubt(cubic: np.ndarray) -> np.ndarray:
    """By how much the function may differ from its cubic between nodes: as much as the cubic from the parabola."""
    return 2.3 * np.abs(cubic[3])


def _turning_point(f: Function, theta: float, ends: list[tuple[float, float]]) -> tuple[float, float]:
    """Where f turns near θ, and its value there; searched for by parabolas where it may have crossed zero twice."""
    (_, left), (_, right) = ends
    a, b, c = (0.0, left), (theta, f(theta)), (1.0, right)
    if left * right < 0:
        return b
    toward = -np.sign(left or right)
    for _ in range(8):
        if toward * b[1] > 0:
            break
        x = _vertex(a, b, c)
        if not a[0] < x < c[0] or abs(x - b[0]) < 1e-6:
            break
        new = (x, f(x))
        better = toward * new[1] > toward * b[1]
        lower, upper = sorted([b, new])
        if better == (new == lower):
            b, c = lower, upper
        else:
            a, b = lower, upper
    return b


def _vertex(*points: tuple[float, float]) -> float:
    """Where the parabola through three points turns; NaN if it is a line."""
    (a, fa), (b, fb), (c, fc) = points
    p, q = (b - a) * (fb - fc), (b - c) * (fb - fa)
    return b - 0.5 * ((b - a) * p - (b - c) * q) / (p - q) if p != q else float("nan")


def _root(f: Function, left: tuple[float, float], right: tuple[float, float], guess: Function | None) -> float:
    """The zero of f between two points of different sign: by the slope of the cubic where it is good, else Brent's."""
    (a, fa), (b, fb) = left, right
    if fb == 0:
        return b
    theta = a - fa * (b - a) / (fb - fa)
    if guess is not None and guess(a) * guess(b) < 0:
        theta = brent(guess, a, b)
        slope = (guess(min(theta + 1e-4, b)) - guess(max(theta - 1e-4, a))) / (
            min(theta + 1e-4, b) - max(theta - 1e-4, a)
        )
        last = np.inf
        for _ in range(6):
            change = -f(theta) / slope if slope else np.inf
            if abs(change) <= LOCATED or (abs(change) < 1e-9 and abs(change) >= 0.5 * last):
                return float(np.clip(theta + change, a, b)) if abs(change) <= LOCATED else theta
            if not abs(change) < 0.5 * last or not a < theta + change < b:
                break
            theta, last = theta + change, abs(change)
    if np.sign(f(b)) == np.sign(fa):  # f jumps across zero at the node, where values held over a step change
        return b
    return brent(f, a, b, rtol=1e-14)
