"""The manifest of a folder: each of its files with size and SHA-256, in one JSON file that checks itself.

    {
    "facts": {"format": 2, "kind": "records", …},
    "files": {
    "configuration.npz": [2120, "9f86…"],
    "records.zarr/xi/c.0.0": [196612, "60303…"]
    },
    "sha256": "of all bytes before this one's opening quotation mark"
    }

A file to which rows are still added has two more numbers, [size, SHA-256, blocks, used]: without its last four bytes,
which are its CRC-32C, it consists of that many blocks, and the SHA-256 is that of the first `used` bytes of each.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from coadjoint import disk
from coadjoint.disk import reading
from coadjoint.errors import FileError, rephrased, shown

MANIFEST = "manifest.json"
FORMAT = 2
"""The number of the format of stored runs and folders of results; 1 had no manifest."""
DAMAGED = "put back a copy of it; nothing has been changed"

BEGINNING = b'{\n"facts"'
"""The beginning of every manifest; files of other programs may have its name."""

_LARGEST = 1 << 26
_CHECKSUM = 4
_END = '"\n}\n'


@dataclass
class Manifest:
    """`facts` describe the contents of the folder; `files`: name → entry of each file, its name relative to the
    folder."""

    folder: Path
    facts: dict[str, Any] = field(default_factory=dict)
    files: dict[str, list[Any]] = field(default_factory=dict)

    def write(self) -> None:
        """Put it into its folder in one move."""
        facts = json.dumps({"format": FORMAT, **self.facts}, ensure_ascii=False)
        files = ",\n".join(f"{json.dumps(name)}: {json.dumps(self.files[name])}" for name in sorted(self.files))
        body = f'{BEGINNING.decode()}: {facts},\n"files": {{\n{files}\n}},\n"sha256": "'.encode()
        disk.write(self.folder / MANIFEST, [body, hashlib.sha256(body).hexdigest().encode(), _END.encode()])

    @classmethod
    def read(cls, folder: Path) -> Manifest:
        """The manifest of a folder; raises FileNotFoundError where it has none, FileError where it is damaged or too
        new."""
        path = folder / MANIFEST
        try:
            if path.stat().st_size > _LARGEST:
                raise FileError(f"The file {path} is too large to be a manifest: {DAMAGED}.")
            data = path.read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            raise FileNotFoundError(path) from None
        except OSError as error:
            raise FileError(f"The file {path} cannot be read: {error.strerror or error}.") from error
        end = len(data) - 64 - len(_END)
        if data[end:] != f"{hashlib.sha256(data[: max(end, 0)]).hexdigest()}{_END}".encode():
            raise FileError(f"The file {path} is damaged: {DAMAGED}.")
        try:
            found = json.loads(data)
            written = found["facts"]["format"]
            plain = all(map(_is_entry, found["files"].values())) and isinstance(found["facts"]["kind"], str)
        except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
            written, plain, found = FORMAT, False, {}
        if written != FORMAT:
            raise FileError(
                f"The folder {folder} was written in format {shown(written)} of stored runs, but this version of "
                f"coadjoint reads format {FORMAT}: use the version that wrote it."
            )
        if not plain:
            raise FileError(f"The file {path} is not a manifest that coadjoint wrote: {DAMAGED}.")
        return cls(folder, found["facts"], found["files"])

    def enter(self, name: str) -> None:
        """Add a file of the folder with its present content."""
        path = self.folder / name
        with path.open("rb") as file:
            self.files[name] = [path.stat().st_size, hashlib.file_digest(file, "sha256").hexdigest()]

    def path(self, name: str) -> Path:
        """The path of a file; raises FileError for a name that leads out of the folder."""
        if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
            raise FileError(f"The manifest of {self.folder} names {name}, which is outside of the folder: {DAMAGED}.")
        return self.folder / name

    def require(self, name: str, data: bytes | None = None) -> None:
        """Raise FileError unless a file, or the data read from it, is unchanged."""
        entry = self._listed(name)
        self.require_size(name, None if data is None else len(data))
        if data is None and len(entry) == 2:
            with reading(self.folder / name), self.path(name).open("rb") as file:
                found = hashlib.file_digest(file, "sha256").hexdigest()
        else:
            data = self.path(name).read_bytes() if data is None else data
            found = digest(data, *entry[2:]) if len(entry) == 2 or sums_up(data) else None
        if found != entry[1]:
            raise FileError(f"The file {self.folder / name} of the run is damaged: {DAMAGED}.")

    def _listed(self, name: str) -> list[Any]:
        """The entry of a file; raises FileError where there is none."""
        if name not in self.files:
            raise FileError(f"The file {self.folder}/{name} is not among those of the manifest: {DAMAGED}.")
        return self.files[name]

    def require_size(self, name: str, found: int | None = None) -> None:
        """Raise FileError unless a file exists in full length."""
        size, path = self._listed(name)[0], self.path(name)
        if found is None:
            found = path.stat().st_size if path.is_file() else None
        if found != size:
            state = "missing" if found is None else f"truncated: it has {found} bytes of {size}"
            if found is not None and found > size:
                state = f"damaged: it has {found} bytes instead of {size}"
            raise FileError(f"The file {path} of the run is {state}; {DAMAGED}.")

    def problems(self) -> Iterator[str]:
        """The problems of the files of the folder, a sentence each."""
        for name in self.files:
            try:
                self.require(name)
            except FileError as error:
                yield str(error)


def as_written(folder: Path) -> AbstractContextManager[None]:
    """Raise FileError for what a folder holds in place of what the library writes; no function of a user runs here."""
    caught = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)
    return rephrased(f"The folder {folder} holds what coadjoint does not write", *caught, then=DAMAGED)


def _is_entry(found: object) -> bool:
    """Whether this is an entry as `entry` makes it."""
    return (
        isinstance(found, list)
        and len(found) in (2, 4)
        and isinstance(found[1], str)
        and all(type(n) is int and n >= 0 for n in (found[0], *found[2:]))
        and (len(found) == 2 or found[2] * max(found[3], 1) <= found[0])
    )


def digest(data: bytes | memoryview, blocks: int = 0, used: int = 0) -> str:
    """The SHA-256 of a file, or of the first `used` bytes of each of its blocks."""
    if not blocks:
        return hashlib.sha256(data).hexdigest()
    found, stride = hashlib.sha256(), (len(data) - _CHECKSUM) // blocks
    for block in range(blocks):
        found.update(memoryview(data)[block * stride : block * stride + used])
    return found.hexdigest()


def checksum(data: bytes | memoryview) -> bytes:
    """The CRC-32C with which a chunk of zarr ends."""
    import google_crc32c

    return google_crc32c.value(data).to_bytes(_CHECKSUM, "little")


def sums_up(data: bytes) -> bool:
    """Whether a chunk ends with its CRC-32C."""
    return checksum(data[:-_CHECKSUM]) == data[-_CHECKSUM:]


def entry(data: bytes, blocks: int = 0, used: int = 0) -> list[Any]:
    """The entry of a manifest for a file with these bytes."""
    return [len(data), digest(data, blocks, used), *([blocks, used] if blocks else [])]
