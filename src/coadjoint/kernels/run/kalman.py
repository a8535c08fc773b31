"""Extended Kalman filters by machine code: a list of orders per call, one filter after the other."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.emit import kalman
from coadjoint.kernels.emit.filter_memory import FIELDS
from coadjoint.kernels.run.machine import Machine, machine


class FilterFunction(Protocol):
    """A function of machine code, code(x, y, value, J, rows), as `kernels.run.function.NativeFunction`."""

    @property
    def code(self) -> Callable[..., object]:
        """The function of ctypes."""
        ...

    def assembly(self) -> str:
        """Its LLVM assembly."""
        ...


class Model(NamedTuple):
    """The model of a filter: sizes, and functions of rows as machine code.

    size: of a row. state: how many of its first numbers the step takes; the others drift. parts: of h, the substeps.
    unknowns: how many a part has. course: the place in `scratch` of those of the parts, each with the state after it.
    parameters: of the step, and the places of those that drift. step: a kernel of one lane, or where there are no
    unknowns a function of (row, h). scratch: the size of its record with the course. between: the count of errors
    between parts, the first of them e. tangent: (unknowns, errors, w), (row, row after, length, h, first, last) of a
    part ↦ (residual, e after, drifting, their variances). densities: of the noises w. retract: of (row, e). carry:
    (e, (row, row moved by e)) ↦ the error about the second. step_assembly: returns the LLVM assembly of `step`.
    projector: (e, row) ↦ the error that is left of e on constraints; None without them. shake: (w, row) ↦ the error by
    an impulse w at the start of a step; None where w acts in the step. still: the last errors, which no step reads.
    """

    size: int
    state: int
    parts: np.ndarray
    unknowns: int
    course: int
    parameters: np.ndarray
    places: np.ndarray
    step: Callable[..., object]
    scratch: int
    between: int
    tangent: FilterFunction
    densities: np.ndarray
    retract: FilterFunction
    carry: FilterFunction
    inputs: np.ndarray
    errors: int
    step_assembly: Callable[[], str]
    projector: FilterFunction | None = None
    shake: FilterFunction | None = None
    still: int = 0


class MeasurementCode(NamedTuple):
    """A measurement: its function of (e, (row, y)), whose value is −ν, R (m, m), the largest NIS that is accepted, how
    many numbers y has, and (a, b, c) of its loss, with the weight min(1, a/d), or a/(b + d²) where c is 1.
    recovery: the number of values in a row beyond the gate after which something is done, and what, 0 for nothing.
    trips: how many times the function is linearised. effective: the covariance that the gain has, None for R."""

    function: FilterFunction
    covariance: np.ndarray
    gate: float
    numbers: int
    loss: tuple[float, float, float] | None
    recovery: tuple[int, int]
    trips: int = 1
    effective: np.ndarray | None = None

    @property
    def matrices(self) -> list[np.ndarray]:
        """R and the covariance that the gain has, the same array where they are equal."""
        R = np.ascontiguousarray(self.covariance, float)
        return [R, R if self.effective is None else np.ascontiguousarray(self.effective, float)]


class FilterTable(NamedTuple):
    """The memory of a filter apart from its row, P, counts, status, functions and covariances, by names of `FIELDS`.

    scratch: how many numbers of working memory. constants: arrays, of which a step writes `parameters`. sizes:
    integers.
    """

    scratch: dict[str, int]
    constants: dict[str, np.ndarray]
    sizes: dict[str, int]


def table(M: Model, seen: Sequence[MeasurementCode]) -> FilterTable:
    """The memory of filters of a model with measurements."""
    n, size, u, w, k, among = M.errors, M.size, M.unknowns, len(M.densities), M.size - M.state, M.between
    most = max([one.covariance.shape[0] for one in seen], default=1)
    scratch = {
        "after": size + 1, "x": u + among + w, "y": 2 * size + 4,
        "value": u + among + 2 * k, "J": (u + among + 2 * k) * (u + among + w),
        "Phi": among**2, "chain": among**2, "turned": n * max(n, most, 2 * w),
        "W": max(n * max(n, most, 2 * w), among**2), "started": n * w, "shaken": 2 * n * w,
        "step_scratch": max(M.scratch, 1),
        "moved": 2 * size + n, "nu": most, "H": most * n, "HP": most * n, "S": most * most, "K": most * n,
        "KR": max(most * n, n, u * (u + among + w)), "e": max(n, most), "zeros": u + n + w + 1,
        "seen": size + max([one.numbers for one in seen], default=0), "A": most * most,
    }  # fmt: skip
    losses = [(0.0, 0.0, -1.0) if one.loss is None else one.loss for one in seen]
    numbers = {"parameters": M.parameters, "densities": M.densities**2, "fractions": M.parts,
               "gates": [one.gate for one in seen]}  # fmt: skip
    integers = {
        "places": M.places, "input_places": M.inputs, "sizes": [len(one.covariance) for one in seen],
        "counts": [one.numbers for one in seen], "limits": [one.recovery[0] for one in seen],
        "actions": [one.recovery[1] for one in seen], "trips": [one.trips for one in seen],
    }  # fmt: skip
    constants = {name: np.append(np.asarray(value, float), 0.0) for name, value in numbers.items()}
    constants |= {name: np.append(np.asarray(value, np.int64), 0) for name, value in integers.items()}
    sizes = {"errors": n, "size": size, "state": M.state, "unknowns": u, "noises": w, "drifting": k}
    sizes |= {"parts": len(M.parts), "between": among, "course": M.course, "implicit": int(u > 0)}
    sizes["acting"] = n - M.still
    found = {name: max(count, 1) for name, count in scratch.items()}
    return FilterTable(found, constants | {"losses": np.array([*losses, (0.0,) * 3])}, sizes)


@cache
def _code() -> tuple[Machine, PyTree]:
    made = machine(kalman.assemble())
    return made, orders_of(made, kalman.NAME)


def orders_of(code: Machine, name: str) -> Callable[..., int]:
    """The function of machine code that executes orders."""
    given = [*[ctypes.c_void_p] * 2, ctypes.c_int64, *[ctypes.c_void_p] * 2]
    return code.function(name, *given, result=ctypes.c_int64)


def parts_of(M: Model, seen: Sequence[MeasurementCode]) -> dict[str, tuple[str, str]]:
    """Name → (LLVM assembly, the function in it) of all functions of a filter, for `kernels.run.portable_code`."""
    step = (M.step_assembly(), "step" if M.unknowns else "function")
    functions = {"tangent": M.tangent, "retract": M.retract, "carry": M.carry, "projector": M.projector}
    functions["shake"] = M.shake
    functions |= {f"measure_{i}": one.function for i, one in enumerate(seen)}
    made = {name: (one.assembly(), "function") for name, one in functions.items() if one is not None}
    return {"filter": (kalman.assemble(), kalman.NAME), "step": step, **made}


def address(function: PyTree) -> int:
    """The address of a function of machine code."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0


class Filters:
    """The memory of filters with one model; each has its row and its P."""

    def __init__(
        self, model: Model, measurements: Sequence[MeasurementCode], function: Callable[..., int] | None = None
    ):
        """function: that of `kernels.emit.kalman`, by default compiled here."""
        self._model, self._measurements = model, list(measurements)
        self._memory = np.zeros(len(FIELDS), np.int64)
        self._held: dict[str, np.ndarray] = {}
        self._function = _code()[1] if function is None else function
        self._fill()

    def _fill(self) -> None:
        M, seen, given = self._model, self._measurements, table(self._model, self._measurements)
        for name, count in given.scratch.items():
            self._hold(name, np.zeros(count))
        self._hold("status", np.zeros(4, np.int64))
        for name, array in given.constants.items():
            self._hold(name, array)
        self._covariances = [one.matrices for one in seen]
        self._hold("measurements", np.array([address(one.function.code) for one in seen] + [0], np.int64))
        for i, name in enumerate(("covariances", "effective")):
            self._hold(name, np.array([pair[i].ctypes.data for pair in self._covariances] + [0], np.int64))
        functions = {"step": address(M.step), "tangent": address(M.tangent.code), "retract": address(M.retract.code)}
        functions["carry"] = address(M.carry.code)
        optional = {"projector": M.projector, "shake": M.shake}
        functions |= {name: address(one.code) for name, one in optional.items() if one is not None}
        for name, value in {**given.sizes, **functions}.items():
            self._memory[FIELDS.index(name)] = value

    def _hold(self, name: str, array: np.ndarray) -> None:
        self._held[name] = array
        self._memory[FIELDS.index(name)] = array.ctypes.data

    @property
    def input_places(self) -> np.ndarray:
        """The places of the inputs in a row."""
        return self._model.inputs

    def alone(self) -> OneFilter:
        """One of the filters with memory of its own, for one order per call."""
        n, seen = self._model.errors, self._measurements
        return OneFilter(
            self._function, self._memory, np.zeros((1, self._model.size)), np.zeros((1, n, n)),
            np.zeros((1, max(len(seen), 1)), np.int64), np.zeros(max([1, *(one.numbers for one in seen)])),
        )  # fmt: skip

    def follow(
        self, row: np.ndarray, P: np.ndarray, rejected: np.ndarray, orders: np.ndarray, data: np.ndarray,
        output: np.ndarray,
    ) -> int:  # fmt: skip
        """Execute orders (count, 4) with one filter, whose row, P and counts `rejected` by measurements change: −1, or
        which order failed."""
        self._memory[FIELDS.index("rejected")] = rejected.ctypes.data
        self._memory[FIELDS.index("row")] = row.ctypes.data
        self._memory[FIELDS.index("P")] = P.ctypes.data
        pointers = [a.ctypes.data for a in (self._memory, orders)]
        return self._function(*pointers, len(orders), data.ctypes.data, output.ctypes.data)


class OneFilter:
    """A filter that executes one order per call, in memory that stays where it is.

    row (1, size), P (1, n, n) and rejected (1, count): the arrays to fill before a call and to read after it. data: h,
    or the numbers of a value. output: NIS, and how it was used, (1, 2). flat: the row (size,).
    """

    def __init__(
        self, function: Any, memory: np.ndarray, row: np.ndarray, P: np.ndarray, rejected: np.ndarray, data: np.ndarray
    ):
        self.row, self.P, self.rejected, self.data, self.output = row, P, rejected, data, np.zeros((1, 2))
        self.flat = row[0]
        self._orders, self._memory, self._function = np.zeros((1, 4), np.int64), memory.copy(), function
        for name, array in (("row", row), ("P", P), ("rejected", rejected)):
            self._memory[FIELDS.index(name)] = array.ctypes.data
        places = [array.ctypes.data for array in (self._memory, self._orders, data, self.output)]
        self._given = places[0], places[1], 1, places[2], places[3]

    def __call__(self, order: int, number: int) -> bool:
        """Execute an order, PREDICT by the first number of `data`, or CORRECT with a measurement; whether it failed."""
        self._orders[0, 0], self._orders[0, 1] = order, 0 if order == kalman.PREDICT else number
        return self._function(*self._given) >= 0
