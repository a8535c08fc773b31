"""Saved filters: the functions of a filter as one module of LLVM assembly and as machine code, without JAX.

An archive of `simulation.steppers.code_archive`: `filter.json` (format, version, names and sizes, the processor that
`filter.o` is for), `filter.ll`, `filter.o`, the numbers of the model and of the measurements, and the estimate.
"""

from __future__ import annotations

import ctypes
import os
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.archives import stored_array
from coadjoint.arrays import PyTree
from coadjoint.disk import reading
from coadjoint.errors import ArgumentError, FileError
from coadjoint.estimation.innovation import FilterMemory, Innovation, failed_order, require_finite
from coadjoint.estimation.timetable import series
from coadjoint.kernels.emit.kalman import CORRECT, PREDICT
from coadjoint.kernels.run.kalman import Filters, MeasurementCode, Model, orders_of, parts_of
from coadjoint.kernels.run.machine import Machine, compiled
from coadjoint.kernels.run.portable_code import linked
from coadjoint.simulation.steppers.code_archive import FileKind, code_of, packed, unpacked
from coadjoint.simulation.steppers.fields import Fields, named_file
from coadjoint.texts import Table

KIND = FileKind("filter", "filter", 1)
_FIELDS, _NUMBERS = ("row", "inputs", "measurements"), ("parts", "parameters", "places", "densities", "inputs")
_SIZES = ("size", "state", "unknowns", "course", "scratch", "between", "errors", "still")
_KERNEL = [*[ctypes.c_void_p] * 3, *[ctypes.c_int64] * 2, *[ctypes.c_void_p] * 4]
_FUNCTION = [*[ctypes.c_void_p] * 4, ctypes.c_int64]


@dataclass(frozen=True)
class FilterInterface:
    """The public face of a filter: what it is called; the names and shapes of a row, of inputs, of measured values; the
    names of the errors; and the inputs without which there is no step."""

    title: str
    row: Fields
    inputs: Fields
    measurements: Fields
    errors: tuple[str, ...]
    awaited: tuple[str, ...]


class _Loaded(NamedTuple):
    """A function of a filter, by its address."""

    code: Callable[..., object]

    def assembly(self) -> str:
        raise ArgumentError("A saved filter is exported by the filter that it was saved from.")


def to_bytes(face: FilterInterface, model: Model, seen: list[MeasurementCode], held: FilterMemory) -> bytes:
    """A filter as the content of a file."""
    assembly = linked(parts_of(model, seen))
    kept = ("gate", "numbers", "loss", "recovery", "trips")
    measured = [{name: getattr(one, name) for name in kept} for one in seen]
    header = {
        "face": {**asdict(face), **{name: getattr(face, name).shapes for name in _FIELDS}},
        "sizes": {name: int(getattr(model, name)) for name in _SIZES},
        "constrained": model.projector is not None,
        "shaken": model.shake is not None,
        "measured": measured,
    }  # fmt: skip
    arrays = {f"model_{name}": np.asarray(getattr(model, name)) for name in _NUMBERS}
    arrays |= {f"covariance_{i}": np.ascontiguousarray(one.covariance, float) for i, one in enumerate(seen)}
    arrays |= {f"effective_{i}": one.matrices[1] for i, one in enumerate(seen)}
    return packed(KIND, header, assembly, compiled(assembly), arrays | held._asdict())


class SavedFilter:
    """A filter from a file, in the state in which it was saved; `load_filter` returns it.

    Predictions and updates are those of the `Filter`, bitwise on the same processor. It judges no steps, takes no late
    measurements, and does not check that values are on their group.
    """

    def __init__(self, face: FilterInterface, machine: Machine, filters: Filters, seen: list[MeasurementCode],
                 held: FilterMemory):  # fmt: skip
        self.face, self._seen, self._alive = face, seen, (machine, filters)
        self._one, self._begun, self._awaited = filters.alone(), held, set(face.awaited)
        self._numbers = {name: i for i, name in enumerate(face.measurements.names)}
        self._sizes = {name: place.stop - place.start for name, _, place in face.measurements.places()}
        self._time, self._places = face.row.place("t").start, filters.input_places
        self._held = held
        self._content = b""

    def __reduce__(self) -> tuple[Callable[..., SavedFilter], tuple[object, ...]]:
        return _again, (self._content, self._held, frozenset(self._awaited))

    @property
    def rows(self) -> np.ndarray:
        """A copy of the estimate, (1, size)."""
        return self._held.rows.copy()

    @property
    def covariance(self) -> np.ndarray:
        """A copy of P, (n, n), of the errors by `face.errors`."""
        return self._held.P[0].copy()

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations by the names of the coordinates of the error."""
        roots = np.sqrt(np.maximum(np.diagonal(self._held.P[0]), 0.0)).tolist()
        return dict(zip(self.face.errors, roots, strict=True))

    @property
    def state(self) -> dict[str, np.ndarray]:
        """A copy of the numbers of the estimate by their names."""
        return self.face.row.views(self._held.rows[0].copy())

    @property
    def t(self) -> float:
        """The time of the estimate, s."""
        return float(self._held.rows[0, self._time])

    def reset(self) -> None:
        """Return to the estimate that was saved."""
        self._held, self._awaited = self._begun, set(self.face.awaited)

    def predict(self, dt: float, inputs: Mapping[str, PyTree] | None = None) -> None:
        """Advance by one step of dt, s; inputs: name → value, held over it; the others stay.

        Raises StepError where the model has no step from the estimate, ArgumentError for other names and shapes.
        """
        checks.positive(dt, "dt")
        given = dict(checks.instance(inputs, "inputs", Mapping, "name → value") if inputs else {})
        for name in given:
            checks.known(name, self.face.inputs.names, "input", "The filter")
        for name in self._awaited - set(given):
            raise ArgumentError(f"There is no step without a reading of `{name}`: give inputs={{{name!r}: …}}.")
        held = self._held
        if given:
            held = held._replace(rows=held.rows.copy())
            sizes = {name: place.stop - place.start for name, _, place in self.face.inputs.places()}
            for name, value in given.items():
                one = series(name, ([0.0], [value]), "inputs", sizes, None)
                held.rows[0, self._places[self.face.inputs.place(name)]] = one.values[0]
        self._held, _ = self._once(held, PREDICT, 0, np.array([float(dt)]))
        self._awaited -= set(given)

    def update(self, measured: Mapping[str, PyTree]) -> dict[str, Innovation]:
        """Process measurements, name → value, at the time of the estimate; values with a NaN are left out.

        Returns an `Innovation` for each. If it raises, the filter is unchanged. Raises ArgumentError for other names
        and shapes, StepError where the covariance does not stay finite.
        """
        checks.instance(measured, "measured", Mapping, "name → value")
        values = {}
        for name, value in measured.items():
            checks.known(name, self._sizes, "measurement", "The filter")
            values[name] = series(name, ([0.0], [value]), "measured", self._sizes, None).values[0]
        held, found = self._held, {}
        for name, value in values.items():
            held, (nis, used) = self._once(held, CORRECT, self._numbers[name], value)
            found[name] = Innovation(nis, used > 0, used > 1)
        self._held = held
        return found

    def _once(self, held: FilterMemory, order: int, number: int, data: np.ndarray) -> tuple[FilterMemory, list[float]]:
        """What is held after an order, and (NIS, used)."""
        one = self._one
        one.row[:], one.P[:], one.rejected[:] = held
        one.data[: len(data)] = data
        if one(order, number):
            name = "" if order == PREDICT else self.face.measurements.names[number]
            recovery = (0, 0) if order == PREDICT else self._seen[number].recovery
            raise failed_order(float(one.flat[self._time]), order, name, recovery, int(one.rejected[0, number]))
        require_finite(one.row, lambda rows: rows[:, self._time])
        return FilterMemory(one.row.copy(), one.P.copy(), one.rejected.copy()), one.output[0].tolist()


def _opened(archive: zipfile.ZipFile, header: Table) -> SavedFilter:
    known: Table = dict(header["face"])
    for name in _FIELDS:
        known[name] = Fields.of({key: tuple(shape) for key, shape in known[name]})
    face = FilterInterface(**{**known, "errors": tuple(known["errors"]), "awaited": tuple(known["awaited"])})
    numbers, sizes = {name: stored_array(archive, f"model_{name}") for name in _NUMBERS}, header["sizes"]
    held = FilterMemory(*(stored_array(archive, name) for name in FilterMemory._fields))
    covariances, effective = (
        [stored_array(archive, f"{name}_{i}") for i in range(len(header["measured"]))]
        for name in ("covariance", "effective" if "shaken" in header else "covariance")  # of older files
    )
    _require_shapes(face, sizes, numbers, [*covariances, *effective], held)
    machine = Machine(code_of(archive, header, KIND)[1])

    def function(name: str) -> _Loaded:
        return _Loaded(machine.function(name, *_FUNCTION))

    step = machine.function("step", *(_KERNEL if sizes["unknowns"] else _FUNCTION))
    functions: Table = {name: function(name) for name in ("tangent", "retract", "carry")}
    functions |= {"step": step, "step_assembly": _Loaded(step).assembly}
    optional = {"projector": header["constrained"], "shake": header.get("shaken", False)}
    functions |= {name: function(name) if there else None for name, there in optional.items()}
    model = Model(**numbers, **sizes, **functions)
    seen = [
        MeasurementCode(
            function(f"measure_{i}"), R, one["gate"], one["numbers"], one["loss"], tuple(one["recovery"]), one["trips"],
            None if np.array_equal(R, used) else used,
        )
        for i, (one, R, used) in enumerate(zip(header["measured"], covariances, effective, strict=True))
    ]  # fmt: skip
    return SavedFilter(face, machine, Filters(model, seen, orders_of(machine, "filter")), seen, held)


def _require_shapes(
    face: FilterInterface, sizes: Table, numbers: Table, covariances: list[np.ndarray], held: FilterMemory
) -> None:
    """Raise ValueError unless the arrays are those that the machine code reads and writes."""
    n, count, drifting = sizes["errors"], len(face.measurements.shapes), sizes["size"] - sizes["state"]
    shapes = (1, sizes["size"]), (1, n, n), (1, max(count, 1))
    well = (
        all(array.shape == shape for array, shape in zip(held, shapes, strict=True)) and len(covariances) == 2 * count
    )
    well &= face.row.size == sizes["size"] and len(face.errors) == n and len(numbers["inputs"]) == face.inputs.size
    well &= numbers["places"].shape == (drifting,) or sizes["unknowns"] == 0
    if not well or held.rejected.dtype != np.int64 or any(one.dtype != float for one in (*held[:2], *covariances)):
        raise ValueError("shapes")


def load_filter(path: str | os.PathLike[str]) -> SavedFilter:
    """The filter that `filter.save(path)` wrote, with the same estimate. JAX is not imported.

        filter = co.estimation.load_filter("remus.filter")

    path: the file. On the same processor predictions and updates are bitwise those of the saved filter. The file holds
    machine code that is run: load only files that you would run as programs. Raises FileError for another kind of file,
    and for one of a newer version.
    """
    path = named_file(path)
    with reading(path):
        content = path.read_bytes()
    try:
        return _again(content)
    except FileError as error:
        raise FileError(f"The file {path} {error}") from None


def _again(content: bytes, held: FilterMemory | None = None, awaited: frozenset[str] | None = None) -> SavedFilter:
    """The filter of a file's content, with another estimate and the inputs that it awaits where they are given."""
    made = unpacked(content, KIND, _opened)
    made._content = content
    if held is not None and awaited is not None:
        made._held, made._awaited = held, set(awaited)
    return made
