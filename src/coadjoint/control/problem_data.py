"""The data of an optimal motion: costs, bounds and its end, over the steps of a variational integrator."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.checks import truth
from coadjoint.control.inputs_between import Profile
from coadjoint.control.measured import Measured
from coadjoint.control.numbers import known_parameter, number, require_between, shortest_and_longest
from coadjoint.control.problem_parts import Bounds, End, Input, Terminal
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
