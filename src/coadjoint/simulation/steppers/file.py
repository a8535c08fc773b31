"""Saved steppers: LLVM assembly, machine code, names, layouts and numbers in one file that needs no JAX.

An archive of `code_archive`: `stepper.json` (format, version, names and shapes, the processor that `step.o` is for),
`step.ll` (LLVM assembly), `step.o` (machine code), and an array in NumPy's format for each part of the memory.
"""

from __future__ import annotations

import zipfile
from dataclasses import asdict
from typing import TypeVar

import numpy as np

from coadjoint.archives import stored_array
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.simulation.accuracy.local_error import InternalPlaces, from_plain, to_plain
from coadjoint.simulation.steppers.base import StepperBase
from coadjoint.simulation.steppers.code_archive import FileKind, code_of, packed, unpacked
from coadjoint.simulation.steppers.fields import Fields
from coadjoint.simulation.steppers.interface import Buffers, NativeEngine, StepperInterface, unlimited
from coadjoint.texts import Table

S = TypeVar("S", bound=StepperBase)

KIND = FileKind("stepper", "step", 2)
"""Files of version 1 have no limits of commands."""
_FIELDS = ("parameters", "state", "commands", "observations")


def to_bytes(stepper: PyTree) -> bytes:
    """A stepper as the content of a file."""
    with stepper._turn.reading():
        return _content(stepper, stepper._engine)


def _content(stepper: PyTree, engine: object) -> bytes:
    if not isinstance(engine, NativeEngine):
        raise ArgumentError(
            "A stepper that runs by XLA, or loops over links, cannot be saved: only native code of a complete step can "
            "leave the process."
        )
    face = {**asdict(stepper.face), **{name: getattr(stepper.face, name).shapes for name in _FIELDS}}
    header = {
        "lanes": engine.lanes,
        "threads": stepper.threads,
        "event": stepper.event,
        "kin": stepper._kin,
        "face": face,
    }
    if (ruler := stepper._plain_ruler()) is not None:
        header["accuracy"] = to_plain(stepper._parts, ruler)
    return packed(KIND, header, engine.assembly, engine.code, {**stepper._buffers._asdict(), "origin": stepper._origin})


def from_bytes(content: bytes, kind: type[S]) -> S:
    """The stepper of a file's content; raises FileError with the part of its message after the file's name."""
    return unpacked(content, KIND, lambda archive, header: _opened(archive, header, kind))


def _opened(archive: zipfile.ZipFile, header: Table, kind: type[S]) -> S:
    face = dict(header["face"])
    for name in _FIELDS:
        face[name] = Fields.of({key: tuple(shape) for key, shape in face[name]})
    for name in ("commanded", "remedies", "of_momenta"):
        face[name] = tuple(face.get(name, ()))
    face["compiled_in"] = tuple((place, value) for place, value in face["compiled_in"])
    arrays = {}
    for name in (*Buffers._fields, "origin"):
        if name != "limits" or header["version"] > 1:
            arrays[name] = stored_array(archive, name)
    arrays.setdefault("limits", unlimited(StepperInterface(**face).commands.size, header["lanes"]))
    _require_shapes(StepperInterface(**face), header["lanes"], arrays)
    assembly, code = code_of(archive, header, KIND)
    engine = NativeEngine(assembly, header["lanes"], code)
    made = object.__new__(kind)
    origin = arrays.pop("origin")
    made._stand(StepperInterface(**face), engine, Buffers(**arrays), origin, header["threads"], header["kin"])
    made.event = header["event"]
    if "accuracy" in header:
        made._begin_sample(from_plain(header["accuracy"], made._steps(InternalPlaces())), depth=8)
    return made


def _require_shapes(face: StepperInterface, lanes: int, arrays: dict[str, np.ndarray]) -> None:
    """Raise ValueError unless the arrays are those that the machine code reads and writes."""
    groups = -(-face.count // lanes)
    one = len(arrays["parameters"]) == 1
    expected = {
        "parameters": (1 if one else groups, face.parameters.size, lanes),
        "h": (lanes,),
        "state": (groups, face.state.size, lanes),
        "origin": (groups, face.state.size, lanes),
        "status": (groups, 4, lanes),
        "commands": (groups * lanes, face.commands.size),
        "observations": (groups * lanes, face.observations.size),
        "limits": (2, face.commands.size, lanes),
    }
    for name, shape in expected.items():
        array, kind = arrays[name], np.int64 if name == "status" else np.float64
        if array.shape != shape or array.dtype != kind or not array.flags.c_contiguous:
            raise ValueError(name)
