"""Saved steppers: LLVM assembly, machine code, names, layouts and numbers in one file that needs no JAX.

A ZIP archive without compression of the code: `stepper.json` (format, version, names and shapes, the processor that
`code` is for), `step.ll` (LLVM assembly), `step.o` (machine code), and an array in NumPy's format for each part of the
memory. Where LLVM or the processor is another one, `step.ll` is compiled by llvmlite alone. Nothing in it is pickled,
but it holds machine code that is run: trust such a file like a program.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import secrets
import zipfile
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from coadjoint.archives import stored_array
from coadjoint.disk import require_home
from coadjoint.errors import ArgumentError, FileError, rephrased
from coadjoint.kernels.run.machine import is_for_this_machine, processor
from coadjoint.simulation.accuracy.local_error import InternalPlaces, from_plain, to_plain
from coadjoint.simulation.steppers.base import StepperBase
from coadjoint.simulation.steppers.fields import Fields, named_file
from coadjoint.simulation.steppers.interface import Buffers, NativeEngine, StepperInterface, unlimited
from coadjoint.texts import Table

S = TypeVar("S", bound=StepperBase)

FORMAT, VERSION = "coadjoint stepper", 2
"""Files of version 1 have no limits of commands."""
LARGEST, SMALL = 1 << 28, 1 << 24
"""Bytes that the assembly in a file may have, which alone is compressed, a large system having some 10⁷; and bytes that
all else may have if the file itself is smaller."""
_FIELDS = ("parameters", "state", "commands", "observations")


def save(path: str | os.PathLike[str], overwrite: bool, content_of: Callable[[Path], bytes]) -> Path:
    """Write a stepper in some form, completely or not at all; raises FileError rather than replace a file."""
    target = named_file(path)
    if target.exists() and not overwrite:
        raise FileError(f"The file {target} exists already: choose another name or pass overwrite=True.")
    require_home(target)
    content = content_of(target)
    temporary = target.parent / f".{target.name}.{secrets.token_hex(4)}"
    try:
        with rephrased(f"The stepper could not be written to {target}"):
            temporary.write_bytes(content)
            os.replace(temporary, target)
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()
    return target


def to_bytes(stepper: Any) -> bytes:
    """A stepper as the content of a file."""
    with stepper._turn.reading():
        return _content(stepper, stepper._engine)


def _content(stepper: Any, engine: Any) -> bytes:
    if not isinstance(engine, NativeEngine):
        raise ArgumentError("A stepper that runs by XLA cannot be saved: only native code can leave the process.")
    face = {**asdict(stepper.face), **{name: getattr(stepper.face, name).shapes for name in _FIELDS}}
    header = {"format": FORMAT, "version": VERSION, "lanes": engine.lanes, "threads": stepper.threads,
              "event": stepper.event, "kin": stepper._kin, "processor": processor(), "face": face}  # fmt: skip
    if (ruler := stepper._plain_ruler()) is not None:
        header["accuracy"] = to_plain(stepper._parts, ruler)
    kept = io.BytesIO()
    with zipfile.ZipFile(kept, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("stepper.json", json.dumps(header, indent=1))
        archive.writestr("step.ll", engine.assembly, zipfile.ZIP_DEFLATED)
        archive.writestr("step.o", engine.code)
        for name, array in {**stepper._buffers._asdict(), "origin": stepper._origin}.items():
            with archive.open(f"{name}.npy", "w") as file:
                np.lib.format.write_array(file, array, allow_pickle=False)
    return kept.getvalue()


def from_bytes(content: bytes, kind: type[S]) -> S:
    """The stepper of a file's content; raises FileError with the part of its message after the file's name."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            _require_small(archive, len(content))
            header = json.loads(archive.read("stepper.json"))
            if header["format"] != FORMAT:
                raise FileError("holds no stepper: give one that stepper.save(path) wrote.")
            if header["version"] > VERSION:
                raise FileError(f"is of version {header['version']}, but this library reads {VERSION}: update it.")
            return _opened(archive, header, kind)
    except FileError:
        raise
    except Exception as error:  # zipfile, zlib, json and NumPy have many words for a file that is damaged
        raise FileError("holds no stepper, or is damaged: give one that stepper.save(path) wrote.") from error


def _require_small(archive: zipfile.ZipFile, size: int) -> None:
    """Raise FileError for an archive that would grow to more than a stepper has: all but its assembly is stored."""
    for part in archive.infolist():
        limit = LARGEST if part.filename == "step.ll" else max(size, SMALL)
        if part.file_size > limit:
            raise FileError(
                f"holds no stepper, or is damaged: its {part.filename} would take {part.file_size:,} bytes, but "
                f"{limit:,} are the most; give one that stepper.save(path) wrote."
            )


def _opened(archive: zipfile.ZipFile, header: Table, kind: type[S]) -> S:
    face = dict(header["face"])
    for name in _FIELDS:
        face[name] = Fields.of({key: tuple(shape) for key, shape in face[name]})
    for name in ("commanded", "remedies"):
        face[name] = tuple(face[name])
    face["compiled_in"] = tuple((place, value) for place, value in face["compiled_in"])
    arrays = {}
    for name in (*Buffers._fields, "origin"):
        if name != "limits" or header["version"] > 1:
            arrays[name] = stored_array(archive, name)
    arrays.setdefault("limits", unlimited(StepperInterface(**face).commands.size, header["lanes"]))
    _require_shapes(StepperInterface(**face), header["lanes"], arrays)
    code = archive.read("step.o") if tuple(header["processor"]) == processor() else None
    if code is not None and not is_for_this_machine(code):
        raise FileError("holds machine code of another kind of processor than it names: save the stepper again.")
    try:
        engine = NativeEngine(archive.read("step.ll").decode(), header["lanes"], code)
    except RuntimeError as error:
        raise FileError(f"cannot be compiled here by LLVM ({str(error).splitlines()[0]}).") from None
    made = object.__new__(kind)
    origin = arrays.pop("origin")
    made._stand(StepperInterface(**face), engine, Buffers(**arrays), origin, header["threads"], header["kin"])
    made.event = header["event"]
    if "accuracy" in header:
        made._begin_sample(from_plain(header["accuracy"], made._steps(InternalPlaces())), depth=6)
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
