"""The process of a filter between two measurements: a step, and the propagation of small errors."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.estimation.drifts import not_negative
from coadjoint.estimation.numbers import float64, input_of_members
from coadjoint.kernels.run.function import RowFunction
from coadjoint.kernels.run.kalman import Model
from coadjoint.methods.step_model import implicit_slopes
from coadjoint.portable import Remade
from coadjoint.simulation.accuracy.local_error import PartsOfSteps


def arguments_of(function: Callable[..., object]) -> int | None:
    """The number of positional arguments without defaults; None for any number."""
    try:
        known = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return 1
    if any(one.kind is one.VAR_POSITIONAL for one in known):
        return None
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return sum(one.kind in kinds and one.default is one.empty for one in known)


def spread(deviations: Mapping[str, object], sizes: Mapping[str, int]) -> np.ndarray:
    """Standard deviations by names as numbers (n,), 0 for the others; raises ArgumentError."""
    found = []
    checks.instance(deviations, "`deviations`", Mapping, "name → number")
    for name in deviations:
        checks.known(name, sizes, "error", "`deviations` is of a process that")
    for name, size in sizes.items():
        value = not_negative(deviations.get(name, 0.0), name, "`deviations`")
        checks.shape(value, f"`{name}` of `deviations`", (), (size,))
        found.append(np.broadcast_to(value, (size,)))
    return np.concatenate(found)


class Process(Remade, ABC):
    """States as rows of numbers, errors e about them in coordinates (n,), and a step x⁺ = Φ(x, w) with noise w.

    A row x with an error e is the state `retract(x, e)`; `differ(x, y)` is e with y = retract(x, e), to first order.
    Both are pure functions that JAX traces.
    """

    error_sizes: Mapping[str, int]
    """Name → its count of coordinates of e, in their order."""
    input_sizes: Mapping[str, int]
    """Name → the size of an input."""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of the coordinates of e: `g[0]`, …"""
        sizes = self.error_sizes.items()
        return tuple(f"{name}[{i}]" if size > 1 else name for name, size in sizes for i in range(size))

    @cached_property
    def width(self) -> int:
        """n, the number of coordinates of an error."""
        return sum(self.error_sizes.values())

    @cached_property
    def places(self) -> dict[str, slice]:
        """Name → the slice of its coordinates in e."""
        found, start = {}, 0
        for name, size in self.error_sizes.items():
            found[name] = slice(start, start + size)
            start += size
        return found

    @property
    @abstractmethod
    def example(self) -> np.ndarray:
        """A row, (size,)."""

    @property
    def row_shapes(self) -> dict[str, tuple[int, ...]]:
        """Name → shape of the numbers of a row, in their order; `t` is the time, s."""
        return {"row": self.example.shape}

    @abstractmethod
    def retract(self, row: Array, e: Array) -> Array:
        """The row (size,) of the state that differs from another by e (n,)."""

    @abstractmethod
    def differ(self, row: Array, other: Array) -> Array:
        """e (n,) with other = retract(row, e), to first order, or exactly."""

    truths: str = ""
    """The other arguments of `rows_of`, as words of a list, with a final comma."""

    def rows_of(self, states: PyTree, times: np.ndarray, known: Mapping[str, object] | None = None) -> np.ndarray:
        """Rows unchanged; a process may also take states with an axis of nodes. Raises ArgumentError.

        times: of the nodes, (K,) s, for objects with their own times. known: the numbers that rows hold in addition to
        states.
        """
        if known:
            raise ArgumentError("Argument `known` goes with a run or states of a system: rows are complete.")
        try:
            return float64(states)
        except (TypeError, ValueError):
            raise ArgumentError(
                f"Argument `truth` must be {self.truths}rows of numbers, such as a copy of the `rows` that the filter "
                f"found with the true numbers in it, but is {shown(states)}."
            ) from None

    def doubt(self, row: np.ndarray, inputs: Mapping[str, object]) -> str:
        """A sentence on inputs, name → `Series`, that are implausible for a filter at a row, or ""."""
        return ""

    @abstractmethod
    def row(self, state: PyTree) -> np.ndarray:
        """The row (size,) of a state; raises ArgumentError unless it is one of this process."""

    @abstractmethod
    def state(self, row: np.ndarray) -> PyTree:
        """The state of a row (size,)."""

    @abstractmethod
    def motion(self, row: Array) -> tuple[PyTree, ...]:
        """The arguments of functions of measurements at a row, traced: the motion, the parameters, the biases."""

    def observed(self, row: Array) -> tuple[PyTree, ...]:
        """The arguments of functions of the state at a row, traced: the state, the parameters, the biases.

        Raises ArgumentError where the process has no state of a system.
        """
        raise ArgumentError(
            f"A {type(self).__name__} has no state of a system: its measurements are functions of the motion."
        )

    @abstractmethod
    def time(self, rows: np.ndarray) -> np.ndarray:
        """t of rows (…, size), s."""

    awaited: tuple[str, ...] = ()
    """The inputs that a step requires: the readings of an instrument."""
    unknowns: int = 0
    """m, the number of unknowns z in a substep."""
    substeps: tuple[float, ...] = (1.0,)
    """The substeps of a step as parts of h."""
    densities: np.ndarray
    """Roots of the spectral densities of the noises w, (count of w,)."""
    drifting: int = 0
    """The number of drifting entries at the end of a row, and of coordinates at the end of e."""
    commanded: np.ndarray
    """The places of the inputs in a row."""

    def with_inputs(self, rows: np.ndarray, inputs: Mapping[str, object]) -> np.ndarray:
        """A copy of the rows (members, size) with these inputs, name → value, held over the next step.

        Raises ArgumentError for values of other shapes, and for values that are not finite.
        """
        rows, start = rows.copy(), 0
        for name, size in self.input_sizes.items():
            if name in inputs:
                rows[:, self.commanded[start : start + size]] = input_of_members(inputs[name], name, (len(rows), size))
            start += size
        return rows

    def unread(self, names: Sequence[str]) -> list[str]:
        """Those of `names` whose inputs no step reads."""
        return []

    @abstractmethod
    def stepped(self, rows: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        """The rows (members, size) after a step of h, and its course, as `StepsTaken`: (members, substeps, …).

        Raises StepError where there is no step.
        """

    def advanced(self, rows: np.ndarray, h: float) -> np.ndarray:
        """The rows (members, size) after a step of h without noise; raises StepError."""
        return self.stepped(rows, h)[0]

    @property
    @abstractmethod
    def tangent(self) -> RowFunction:
        """(z, e, w), (x, x after, h) ↦ (R, e after, θ after, q) of the step from retract(x, e) with the noise w.

        R: the residual. e after: the error after it. θ, q: the numbers that drift, and the variances that they gain.
        Of several substeps the function is that of one of them, (x, x after, its length, h, first, last), with 1 for
        the first and the last and 0 for others, and e has `between` numbers, those of an error and further ones.
        """

    shaking: RowFunction | None = None
    """(w, x) ↦ differ(x, x after an impulse w at the start of a step); None where `tangent` spreads w over the step."""

    @property
    def parts(self) -> PartsOfSteps | None:
        """The judge of the steps from rows (k, size), None if they are not those of a model."""
        return None

    @property
    def between(self) -> int:
        """The count of errors between substeps."""
        return self.width

    @abstractmethod
    def native(self) -> Model | None:
        """The process as machine code, or None."""

    def linearised(
        self, rows: np.ndarray, after: np.ndarray, h: float, course: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """(Φ, Q) about a step that was taken: e⁺ = Φ e + noise of the covariance Q, each (members, n, n).

        course: that of the step, from `stepped`; by default the step is taken again for it.
        """
        course = self.stepped(rows, h)[1] if course is None else course
        Phi, U = self._slopes(rows, after, h, course)
        return Phi, U @ U.transpose(0, 2, 1)

    def _slopes(
        self, rows: np.ndarray, after: np.ndarray, h: float, course: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """(Φ, U): e⁺ = Φ e + U u with u standard normal numbers.

        White noise at s of a step acts at its end by Φ(h, s)G. With the linear interpolant of that between ΦG₀ = A at
        the start and G = B at the end, ∫ Φ G S²GᵀΦᵀ ds = h/3 (A S²Aᵀ + ½ (A S²Bᵀ + B S²Aᵀ) + B S²Bᵀ) = UUᵀ, with
        U = √h ((A + B)/2, (A − B)/√12) S: of second order in h, and exact where velocities are constant. Numbers that
        drift, θ⁺ = φθ + noise of the variance q, gain q/(1 + φ²) before the step and as much after it.
        """
        m, n, k = self.unknowns, self.width, self.unknowns + self.between
        still, count = np.zeros((len(rows), self.between + len(self.densities))), len(self.substeps)
        begin, Phi, value, J = rows, np.eye(self.between), rows, still
        for number, part in enumerate(self.substeps):
            there = course[:, number]
            end = after if number + 1 == count else np.concatenate([there[:, m:], self._drifting(rows)], axis=1)
            flags = [part * h, h, number == 0, number + 1 == count] if count > 1 else [h]
            lengths = np.repeat(np.array([flags], float), len(rows), axis=0)
            x, y = np.concatenate([there[:, :m], still], axis=1), np.concatenate([begin, end, lengths], axis=1)
            value, J = self.tangent(x, y)
            own = implicit_slopes(J[:, :k, :k], m)
            Phi, begin = own @ Phi if number else own, end
        Phi, end = Phi[:, :n, :n], J[:, m : m + n, k:]
        if self.shaking is not None:
            begun = Phi @ self.shaking(np.zeros((len(rows), len(self.densities))), rows)[1]
            end = np.concatenate([0.5 * (begun + end), (begun - end) / np.sqrt(12.0)], axis=2)
        U, last = end * np.resize(self.densities * np.sqrt(h), end.shape[2]), np.arange(n - self.drifting, n)
        half = np.sqrt(value[:, None, k + self.drifting :] / (1.0 + Phi[:, None, last, last] ** 2))
        return Phi, np.concatenate([U, Phi[:, :, last] * half, np.eye(n)[:, last] * half], axis=2)

    def _drifting(self, rows: np.ndarray) -> np.ndarray:
        return rows[:, rows.shape[1] - self.drifting :]

    def drawn(self, rows: np.ndarray, h: float, random: np.random.Generator) -> np.ndarray:
        """The rows (members, size) after a step of h with noise from `random`: a truth that the process describes.

        Raises ArgumentError for rows of another shape, and unless `random` is an np.random.Generator.
        """
        if np.ndim(rows) != 2 or np.shape(rows)[1] != len(self.example) or not isinstance(random, np.random.Generator):
            raise ArgumentError(
                f"A step is drawn from rows (members, {len(self.example)}) and np.random.default_rng(seed), but got "
                f"rows {np.shape(rows)} and {shown(random)}."
            )
        after, course = self.stepped(rows, h)
        _, U = self._slopes(rows, after, h, course)
        return self.moved(after, (U @ random.normal(size=(len(rows), U.shape[2], 1)))[:, :, 0])

    @abstractmethod
    def first_covariance(self, row: np.ndarray, deviations: Mapping[str, PyTree]) -> np.ndarray:
        """P (n, n) of independent errors with these standard deviations, by their names."""

    projector: RowFunction | None = None
    """(e, x) ↦ differ(x, retract(x, e)), whose slopes at e = 0 project errors onto the tangent space of constraints."""

    def admitted(self, rows: np.ndarray, P: np.ndarray) -> np.ndarray:
        """The covariances P (members, n, n) at rows (members, size) without what constraints exclude."""
        if self.projector is None:
            return P
        slopes = self.projector(np.zeros((len(rows), self.width)), rows)[1]
        return slopes @ P @ slopes.transpose(0, 2, 1)

    def moved(self, rows: np.ndarray, e: np.ndarray) -> np.ndarray:
        """`retract` of rows (members, size) by errors (members, n)."""
        none = np.zeros((len(rows), 0))
        return self.moving(none, np.concatenate([rows, e], axis=1))[0]

    @cached_property
    def moving(self) -> RowFunction:
        """(), (x, e) ↦ retract(x, e)."""
        size = len(self.example)
        given = np.concatenate([self.example, np.zeros(self.width)])
        return RowFunction(lambda x, y: self.retract(y[:size], y[size:]), np.zeros(0), given)

    @cached_property
    def carrying(self) -> RowFunction:
        """(e, (x, x⁺)) ↦ differ(x⁺, retract(x, e)): of x⁺ = retract(x, ê) its slope T at ê carries errors about x to
        those about x⁺, T = 1 on flat spaces and the differential of exp at ê on groups.

        Source: M. W. Mueller, M. Hehn, R. D'Andrea, *Covariance correction step for Kalman filtering with an attitude*,
        J. Guidance, Control and Dynamics 40 (2017).
        """
        size = len(self.example)
        given = np.concatenate([self.example, self.example])
        return RowFunction(lambda x, y: self.differ(y[size:], self.retract(y[:size], x)), np.zeros(self.width), given)

    def carried(self, P: np.ndarray, e: np.ndarray, rows: np.ndarray, after: np.ndarray) -> np.ndarray:
        """P (members, n, n) of errors about rows as that about `after` = retract(rows, e)."""
        T = self.carrying(e, np.concatenate([rows, after], axis=1))[1]
        return T @ P @ T.transpose(0, 2, 1)

    def errors(self, rows: np.ndarray, others: np.ndarray) -> np.ndarray:
        """e with others = retract(rows, e), rows and others (…, size): (…, n), also where e is not small."""
        both = np.concatenate([rows, others], axis=-1).reshape(-1, 2 * rows.shape[-1])
        return self.differing(np.zeros((len(both), 0)), both)[0].reshape(*rows.shape[:-1], self.width)

    @cached_property
    def differing(self) -> RowFunction:
        """(), (x, y) ↦ differ(x, y)."""
        size = len(self.example)
        given = np.concatenate([self.example, self.example])
        return RowFunction(lambda x, y: self.differ(y[:size], y[size:]), np.zeros(0), given)

    def reading(self, function: Callable[..., PyTree], of_state: bool = False) -> Callable[[Array], PyTree]:
        """row ↦ function of the motion, or of the state, traced.

        Raises ArgumentError for a function that needs more than the motion or the state, the parameters and the biases.
        """
        taken, see = arguments_of(function), self.observed if of_state else self.motion
        if taken is not None and not 1 <= taken <= 3:
            raise ArgumentError(
                "A measurement is a function of the motion, of (motion, p) or of (motion, p, biases), but this one "
                f"needs {taken} arguments."
            )
        return lambda row: function(*see(row)[:taken])
