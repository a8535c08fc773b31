"""Files of machine code that need no JAX: a header, LLVM assembly, an object file for one processor, and arrays.

A ZIP archive without compression but of the assembly, where LLVM or the processor is another one, is compiled by
llvmlite alone. Nothing in it is pickled, but it holds machine code that is run: trust such a file like a program.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import secrets
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from coadjoint.disk import require_home, require_new
from coadjoint.errors import FileError, rephrased
from coadjoint.kernels.run.machine import compiled, is_for_this_machine, processor
from coadjoint.simulation.steppers.fields import named_file
from coadjoint.texts import Table

T = TypeVar("T")

LARGEST, SMALL = 1 << 28, 1 << 24
"""Bytes that the assembly in a file may have, which alone is compressed, a large system having some 10⁷; and bytes that
all else may have if the file itself is smaller."""


class FileKind(NamedTuple):
    """A kind of file: what it holds, as "stepper", the stem of its code's names, and the newest version."""

    what: str
    stem: str
    version: int

    @property
    def none(self) -> str:
        """The part of a message after the name of a file that is of another kind."""
        return f"holds no {self.what}, or is damaged: give one that {self.what}.save(path) wrote."


def save(
    path: str | os.PathLike[str], overwrite: bool, content_of: Callable[[Path], bytes], what: str = "stepper"
) -> Path:
    """Write a file, completely or not at all; raises FileError rather than replace one."""
    target = named_file(path)
    require_new(target, overwrite)
    require_home(target)
    content = content_of(target)
    temporary = target.parent / f".{target.name}.{secrets.token_hex(4)}"
    try:
        with rephrased(f"The {what} could not be written to {target}"):
            temporary.write_bytes(content)
            os.replace(temporary, target)
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()
    return target


def packed(kind: FileKind, header: Table, assembly: str, code: bytes, arrays: Mapping[str, np.ndarray]) -> bytes:
    """The content of a file."""
    known = {"format": f"coadjoint {kind.what}", "version": kind.version, "processor": processor()}
    kept = io.BytesIO()
    with zipfile.ZipFile(kept, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(f"{kind.what}.json", json.dumps(known | header, indent=1))
        archive.writestr(f"{kind.stem}.ll", assembly, zipfile.ZIP_DEFLATED)
        archive.writestr(f"{kind.stem}.o", code)
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w") as file:
                np.lib.format.write_array(file, array, allow_pickle=False)
    return kept.getvalue()


def unpacked(content: bytes, kind: FileKind, made: Callable[[zipfile.ZipFile, Table], T]) -> T:
    """The result of `made` from an archive and its header; raises FileError with the part of its message after the
    file's name."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            _require_small(archive, len(content), kind)
            header = json.loads(archive.read(f"{kind.what}.json"))
            if header["format"] != f"coadjoint {kind.what}":
                raise FileError(f"holds no {kind.what}: give one that {kind.what}.save(path) wrote.")
            if header["version"] > kind.version:
                raise FileError(f"is of version {header['version']}, but this library reads {kind.version}: update it.")
            return made(archive, header)
    except FileError:
        raise
    except Exception as error:  # zipfile, zlib, json and NumPy have many words for a file that is damaged
        raise FileError(kind.none) from error


def code_of(archive: zipfile.ZipFile, header: Table, kind: FileKind) -> tuple[str, bytes]:
    """The assembly, and the machine code for this processor, which is compiled where the file has that of another."""
    assembly = archive.read(f"{kind.stem}.ll").decode()
    if tuple(header["processor"]) != processor():
        try:
            return assembly, compiled(assembly)
        except RuntimeError as error:
            raise FileError(f"cannot be compiled here by LLVM ({str(error).splitlines()[0]}).") from None
    code = archive.read(f"{kind.stem}.o")
    if not is_for_this_machine(code):
        raise FileError(f"holds machine code of another kind of processor than it names: save the {kind.what} again.")
    return assembly, code


def _require_small(archive: zipfile.ZipFile, size: int, kind: FileKind) -> None:
    """Raise FileError for an archive that would grow to more than it may: all but its assembly is stored."""
    for part in archive.infolist():
        limit = LARGEST if part.filename == f"{kind.stem}.ll" else max(size, SMALL)
        if part.file_size > limit:
            raise FileError(
                f"holds no {kind.what}, or is damaged: its {part.filename} would take {part.file_size:,} bytes, but "
                f"{limit:,} are the most; give one that {kind.what}.save(path) wrote."
            )
