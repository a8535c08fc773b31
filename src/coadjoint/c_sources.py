"""C sources around machine code: layouts and numbers as text, and folders that CMake builds."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from coadjoint.disk import require_home, require_new
from coadjoint.errors import ArgumentError, rephrased, shown

Shapes = Iterable[tuple[str, tuple[int, ...]]]

_CMAKE = """cmake_minimum_required(VERSION 3.16)
project({name} C)
add_library({name} STATIC {sources})
set_target_properties({name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
target_include_directories({name} PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}})
target_link_libraries({name} PUBLIC m)
"""


def identifier(given: object, name: str) -> str:
    """A name that C allows, from a folder's or from the user's; raises ArgumentError for others."""
    found = re.sub(r"\W", "_", given, flags=re.ASCII).lower() if isinstance(given, str) else ""
    if not re.fullmatch("[a-z][a-z0-9_]*", found):
        raise ArgumentError(f"Argument `{name}` must begin with a letter, as remus does, but is {shown(given)}.")
    return found


def macro(*parts: str) -> str:
    """The name of a constant."""
    return "_".join(re.sub(r"\W+", "_", part, flags=re.ASCII).strip("_").upper() for part in parts)


def number(value: float) -> str:
    """A double, exactly."""
    value = float(value)
    return repr(value) if math.isfinite(value) else {math.inf: "INFINITY", -math.inf: "-INFINITY"}.get(value, "NAN")


def array(name: str, values: np.ndarray) -> str:
    """A constant array of doubles or of int64, with a zero in place of none."""
    flat = np.ravel(values) if np.size(values) else np.zeros(1, np.asarray(values).dtype)
    kind, texts = ("double", map(number, flat)) if flat.dtype == float else ("int64_t", map(str, flat.tolist()))
    return f"static const {kind} {name}[{len(flat)}] = {{{', '.join(texts)}}};"


def layout(title: str, shapes: Shapes, prefix: str, units: Mapping[str, str]) -> tuple[str, str]:
    """The comment and the enumeration of named numbers in a row: place, name, shape and unit of each."""
    rows, places, start = [], [], 0
    for name, shape in shapes:
        if not (size := math.prod(shape)):
            continue
        where = f"{start}" if size == 1 else f"{start}..{start + size - 1}"
        unit = units.get(name.partition(".")[2] or name, units.get(name, ""))
        rows.append(f"     {where:<10} {name:<36} {'x'.join(map(str, shape)) or '1':<8} {unit}".rstrip())
        places.append(f"    {macro(prefix, name)} = {start}")
        start += size
    comment = "\n".join([f"   {title}, {start} numbers: place, name, shape, unit", *(rows or ["     none"])])
    return comment, "enum {\n" + ",\n".join(places) + "\n};" if places else ""


def header(name: str, comment: str, body: str) -> str:
    """A header for C and C++."""
    guard = f"{name.upper()}_H"
    return (
        f"/* {comment}\n*/\n#ifndef {guard}\n#define {guard}\n\n#include <stdint.h>\n\n#ifdef __cplusplus\n"
        f'extern "C" {{\n#endif\n\n{body}\n\n#ifdef __cplusplus\n}}\n#endif\n\n#endif\n'
    )


def write_library(
    folder: str | os.PathLike[str], name: str, texts: Mapping[str, str], overwrite: bool, code: bytes | None = None
) -> Path:
    """Write the texts by their files, the machine code as NAME_code.o, and CMakeLists.txt; raises FileError rather than
    replace one."""
    target = Path(folder)
    contents = {file: text.encode() for file, text in texts.items()}
    contents |= {} if code is None else {f"{name}_code.o": code}
    compiled = " ".join(file for file in contents if not file.endswith(".h"))
    contents["CMakeLists.txt"] = _CMAKE.format(name=name, sources=compiled).encode()
    for one in contents:
        require_new(target / one, overwrite, "folder")
    require_home(target)
    with rephrased(f"The library could not be written to {target}"):
        target.mkdir(exist_ok=True)
        for one, content in contents.items():
            (target / one).write_bytes(content)
    return target
