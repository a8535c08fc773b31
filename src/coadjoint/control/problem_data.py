"""The data of an optimal motion: costs, bounds and its end, over the steps of a variational integrator."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.checks import truth
from coadjoint.control.inputs_between import COURSES, Profile
from coadjoint.control.measured import Measured
from coadjoint.control.numbers import known_parameter, number, require_between, shortest_and_longest, spread
from coadjoint.control.penalty import Penalty, require_soft
from coadjoint.errors import ArgumentError, shown
from coadjoint.mechanics.constrained_start import parameters_read
from coadjoint.mechanics.signatures import require_signature
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.midpoint import Midpoint
from coadjoint.simulation.arguments import grid, require_kinds

MOST_POINTS = 100
"""The most points inside a step at which constraints of the path are imposed."""


@dataclass(frozen=True)
class Input:
    """A command u_k of each step, which the optimum chooses.

    shape: () for a number, (m,) for a vector; by default (). lower, upper: bounds, numbers or of this shape, by default
    none. rate: the largest |u_{k+1} − u_k|/h, by default none. guess: the start of the solver, by default 0.
    change_cost: c, which adds Σ c |u_{k+1} − u_k|²/h to the cost, by default 0. previous: the command in force before
    the start, from which `rate` and `change_cost` count the first change, and a linear course begins; by default the
    first command is free, and a controller takes the guess.
    course: "held", u_k from node k to the next (the default), or "linear", from u_k at node k to u_{k+1} at the next.

    Raises ArgumentError for bounds other than numbers, or that no value satisfies.
    """

    shape: tuple[int, ...] = ()
    lower: Any = -math.inf
    upper: Any = math.inf
    rate: Any = math.inf
    guess: PyTree = 0.0
    course: str = "held"
    change_cost: Any = field(default=0.0, kw_only=True)
    previous: Any = field(default=None, kw_only=True)

    def __post_init__(self):
        checks.choice(self.course, "Argument `course` of an input", COURSES)
        shape = (self.shape,) if isinstance(self.shape, int) else self.shape
        fits = isinstance(shape, tuple) and all(type(n) is int and n > 0 for n in shape) and (len(shape) <= 1)
        checks.expect(fits, self.shape, "Argument `shape` of an input", "() or (m,)")
        object.__setattr__(self, "shape", shape)
        known = () if self.previous is None else ("previous",)
        for name in ("lower", "upper", "rate", "guess", "change_cost", *known):
            object.__setattr__(self, name, spread(getattr(self, name), shape, name))
        for name in ("change_cost", *known):
            checks.expect(np.all(np.isfinite(getattr(self, name))), getattr(self, name), name, "finite numbers")
        checks.expect(np.all(self.change_cost >= 0), self.change_cost, "change_cost", "numbers from 0 on")
        require_between(self.lower, self.upper, "an input")
        if np.any(self.rate <= 0):
            raise ArgumentError("Argument `rate` of an input must be positive: the largest change in a second.")


@dataclass(frozen=True)
class Bounds:
    """lower ≤ function(motion [, p]) ≤ upper at every node, and at `path_points` of a problem, of a number or a vector.

    function: of the `co.mechanics.NodeMotion` at the node, where ξ and ν are those of the momenta and `motion.inputs`
    the inputs at the start of the step that begins there (at the last node, at the end of the step before).
    lower, upper: numbers or vectors; by default none. soft: a `co.control.Penalty`, the cost of a violation a second;
    by default the bounds are hard.
    """

    function: Callable[..., PyTree]
    lower: Any = -math.inf
    upper: Any = math.inf
    soft: Penalty | None = field(default=None, kw_only=True)

    def __post_init__(self):
        checks.function(self.function, "Argument `function` of co.control.Bounds", "a function of the motion")
        for name in ("lower", "upper"):
            object.__setattr__(self, name, number(getattr(self, name), name))
        require_between(self.lower, self.upper, "a constraint")
        if np.all(np.isinf(self.lower)) and np.all(np.isinf(self.upper)):
            raise ArgumentError("co.control.Bounds needs `lower` or `upper`.")
        require_soft(self.soft, "co.control.Bounds")


@dataclass(frozen=True)
class End:
    """The end of the motion: given values are reached, the others are free.

    g: an element of G: (g⁻¹ g_N)'s part in 𝔤, dim G equations of full rank near g. q, qdot: in the space frame, (dim
    Q,). xi: ξ of the momenta, (dim G,). mu, pi: momenta in the body frame. function: instead of these, (motion [, p])
    that is zero at the end. soft: a `co.control.Penalty`, the cost of a distance from them; by default none is left.
    """

    g: PyTree = None
    q: PyTree = None
    xi: Any = None
    qdot: PyTree = None
    mu: PyTree = None
    pi: PyTree = None
    function: Callable[..., PyTree] | None = field(default=None, kw_only=True)
    soft: Penalty | None = field(default=None, kw_only=True)

    def __post_init__(self):
        require_soft(self.soft, "co.control.End")
        if self.function is not None:
            checks.function(self.function, "Argument `function` of co.control.End", "a function of the motion")
            if self.given:
                raise ArgumentError("co.control.End has values or a `function`, but not both.")

    @property
    def given(self) -> tuple[str, ...]:
        """The names of the given values."""
        return tuple(name for name in ("g", "q", "xi", "qdot", "mu", "pi") if getattr(self, name) is not None)


class Terminal(Protocol):
    """The cost ½ eᵀVe of the last node, e = directions(system, state), V = `cost`, and a set where it is at most
    `within`."""

    @property
    def directions(self) -> Callable[[System, State], Array]: ...
    @property
    def cost(self) -> np.ndarray: ...
    @property
    def within(self) -> float: ...


@dataclass(frozen=True, eq=False)
class ProblemData:
    """The checked data of `co.control.Problem`: see there."""

    system: System
    start: State
    dt: float
    duration: float | None = None
    steps: int | None = None
    method: Method = field(default_factory=Midpoint)
    inputs: Mapping[str, PyTree] = field(default_factory=dict)
    cost: Callable[..., PyTree] | None = None
    final_cost: Callable[..., object] | None = None
    path: Mapping[str, Bounds] = field(default_factory=dict)
    end: End | Callable[..., PyTree] | None = None
    free_duration: tuple[float, float] | None = None
    parameters: Mapping[str, tuple[PyTree, PyTree]] = field(default_factory=dict)
    free_start: Mapping[str, PyTree] = field(default_factory=dict)
    measured: Mapping[str, Measured] = field(default_factory=dict)
    path_points: int = 0
    accuracy: bool = True
    changing: Sequence[str] = ()
    terminal: Terminal | None = None

    def __post_init__(self):
        require_kinds(self.system, self.start, self.method)
        if np.ndim(self.start.t):
            raise ArgumentError("An optimal motion has one start, but `start` has many: solve a problem for each.")
        if self.duration is not None and self.steps is not None:
            raise ArgumentError(
                f"Give either `duration` or `steps`, but they are {shown(self.duration)} s and {shown(self.steps)} "
                f"with dt = {shown(self.dt)} s. A problem has both: in dataclasses.replace give steps=None too, which "
                "keeps the duration, or duration=None, which keeps the steps."
            )
        h, count = grid(self.dt, self.duration, self.steps)
        object.__setattr__(self, "dt", h)
        object.__setattr__(self, "steps", count)
        object.__setattr__(self, "duration", h * count)
        truth(self.accuracy, "accuracy")
        if self.terminal is not None:
            fits = hasattr(self.terminal, "directions") and hasattr(self.terminal, "within")
            checks.expect(fits, self.terminal, "terminal", "a regulator, as `problem.regulator()` returns it")
        self._require_functions()
        self._require_path_points()
        self._require_inputs()
        self._require_free()
        object.__setattr__(self, "changing", self._changing())
        self._require_estimated()
        if self.system.constraints:
            self._require_start_on_constraints()

    @property
    def end_function(self) -> Callable[..., PyTree] | None:
        """The function that is zero at the end, None if the end is given by values."""
        return self.end.function if isinstance(self.end, End) else self.end

    @property
    def count(self) -> int:
        """N, the number of steps."""
        assert self.steps is not None
        return self.steps

    @property
    def length(self) -> float:
        """N h, s, with h = `dt`."""
        return self.dt * self.count

    def _require_functions(self) -> None:
        arguments = ["motion"] if self.system.parameters is None else ["motion", "p"]
        for name in ("cost", "final_cost"):
            if getattr(self, name) is not None:
                require_signature(getattr(self, name), f"Argument `{name}`", arguments)
        checks.mapping(self.path, "path", "a dictionary of name → co.control.Bounds(function, …)", of=Bounds)
        for name, bounds in self.path.items():
            require_signature(bounds.function, f"Argument `path` under `{name}`", arguments)
        if isinstance(self.end, End) and self.end.function is not None:
            require_signature(self.end.function, "Argument `function` of co.control.End", arguments)
        elif self.end is not None and not isinstance(self.end, End):
            checks.function(
                self.end, "end", "co.control.End(g=…, xi=…) or a function of the motion that is zero at the end"
            )
            require_signature(self.end, "Argument `end`", arguments)

    def _require_path_points(self) -> None:
        given = self.path_points
        checks.whole(given, "path_points", 0, MOST_POINTS)
        if given and not self.path:
            raise ArgumentError("Argument `path_points` is where `path` holds inside steps: give `path`.")

    def _require_inputs(self) -> None:
        checks.mapping(self.inputs, "inputs", "a dictionary of name → co.control.Input(…)")
        chosen = any(isinstance(value, (Input, Profile)) for value in self.inputs.values()) or self.parameters
        if not chosen and not self.free_start:
            raise ArgumentError(
                "There is nothing to choose: give `inputs` with at least one co.control.Input(…) or "
                "co.control.Profile(…), `parameters` or `free_start`."
            )

    def _require_estimated(self) -> None:
        parts = ("g", "q", "xi", "qdot", "mu", "pi")
        if not isinstance(self.free_start, Mapping) or not all(name in parts for name in self.free_start):
            raise ArgumentError(
                f"Argument `free_start` must be a dictionary of {', '.join(parts)} → standard deviation, math.inf if "
                f"unknown, but is {shown(self.free_start)}."
            )
        for name, value in self.free_start.items():
            if not np.all(number(value, "free_start") > 0):
                raise ArgumentError(f"The standard deviation of `{name}` in `free_start` must be positive.")
        if self.free_start and self.method.start == "velocity":
            raise ArgumentError('With `free_start` a method begins with momenta: use start="momentum".')
        words = "a dictionary of name → co.control.Measured(function, …)"
        checks.mapping(self.measured, "measured", words, of=Measured)
        arguments = ["motion"] if self.system.parameters is None else ["motion", "p"]
        for name, one in self.measured.items():
            require_signature(one.function, f"Argument `measured` under `{name}`", arguments)
            one.nodes(name, float(self.start.t), self.dt, self.count)
        if self.measured and self.free_duration is not None:
            raise ArgumentError("Measurements at times fix the duration: leave `free_duration` out.")

    def _require_start_on_constraints(self) -> None:
        """Raise ArgumentError where the optimum could move the start off the constraints of the system."""
        if self.free_start:
            raise ArgumentError(
                "With constraints the start of an optimal motion is fixed, since a free one would leave them: leave "
                "`free_start` out, or describe the system in minimal coordinates."
            )
        moving = [*self.parameters, *self.changing]
        for name in sorted(parameters_read(self.system, self.start).intersection(moving)) if moving else ():
            raise ArgumentError(
                f"Constraints read the parameter `{name}`, so that the start would leave them as it changes: solve a "
                "problem for each value, with system.project(start)."
            )

    def _changing(self) -> tuple[str, ...]:
        """The names of parameters that may change from one solution to the next, checked."""
        names = (self.changing,) if isinstance(self.changing, str) else self.changing
        checks.texts(names, "changing", 'names of parameters, such as ("mass",)')
        for name in names:
            known_parameter(self.system, name)
            if name in self.parameters:
                raise ArgumentError(f"Parameter `{name}` is chosen by the optimum: leave it out of `changing`.")
        return tuple(dict.fromkeys(names))

    def _require_free(self) -> None:
        if self.free_duration is not None:
            shortest_and_longest(self.free_duration, "free_duration")
            if self.method.start == "velocity" and self.start.from_velocities:
                raise ArgumentError(
                    'A method with start="velocity" begins with momenta that depend on h: with `free_duration` use '
                    'start="momentum".'
                )
        if self.parameters and self.method.start == "velocity" and self.start.from_velocities:
            raise ArgumentError(
                'A method with start="velocity" begins with momenta that depend on the parameters: with `parameters`, '
                'or for derivatives by them, use start="momentum".'
            )
        for name, limits in self.parameters.items():
            known_parameter(self.system, name)
            if not isinstance(limits, tuple) or len(limits) != 2:
                raise ArgumentError(f"Argument `parameters` must be name → (lower, upper), but `{name}` is {limits!r}.")
            require_between(number(limits[0], name), number(limits[1], name), f"parameter `{name}`")
            self._require_symmetric(name, limits)

    def _require_symmetric(self, name: str, limits: tuple[PyTree, PyTree]) -> None:
        """Raise ArgumentError for a symmetric matrix of which entries off the diagonal are chosen: the optimum would
        choose each of a pair, and the Lagrangian has no antisymmetric part."""
        value = np.asarray(getattr(self.system.parameters, name), dtype=object)
        if value.ndim != 2 or value.shape[0] != value.shape[1] or len(value) < 2 or np.any(value != value.T):
            return
        low, high = (np.broadcast_to(number(one, name), value.shape) for one in limits)
        free = (low < high) & ~np.eye(len(value), dtype=bool)
        if free.any():
            i, j = np.argwhere(free)[0]
            raise ArgumentError(
                f"Parameter `{name}` is a symmetric matrix, but its bounds leave the entries [{i}, {j}] and [{j}, {i}] "
                "to be chosen apart: give matrices of bounds that are equal off the diagonal, or make the numbers to "
                "choose parameters of their own, from which the Lagrangian builds the matrix."
            )
