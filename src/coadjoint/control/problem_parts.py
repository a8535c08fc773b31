"""What a problem of optimal motion is made of: inputs to choose, bounds along the path, the end."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.control.inputs_between import COURSES
from coadjoint.control.numbers import number, require_between, spread
from coadjoint.control.penalty import Penalty, require_soft
from coadjoint.errors import ArgumentError
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System


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
