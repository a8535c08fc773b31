"""Exported C libraries, compiled and loaded by ctypes."""

from __future__ import annotations

import ctypes
import shutil
import subprocess

import pytest

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler is installed")


def built(folder, name, sources=None, strict=True):
    """The shared library of an exported folder; strict: warnings are errors."""
    library, files = folder / f"lib{name}.so", sources or (f"{name}.c", f"{name}_code.o")
    flags = ["-std=c99", *(["-Wall", "-Wextra", "-Werror", "-O1"] if strict else ["-O0"]), "-shared", "-fPIC"]
    call = ["cc", *flags, *files, "-o", str(library), "-lm"]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(str(library))


def structure(**fields):
    """A structure of arrays, name → (type, count)."""
    return type(
        "Structure", (ctypes.Structure,), {"_fields_": [(name, kind * n) for name, (kind, n) in fields.items()]}
    )


def written_while_it_runs(folder, *files):
    """The symbols of an exported folder's objects in memory that can be written: none of functions that are re-entrant.

    files: C sources, by default all.
    """
    sources = [folder / one for one in files] or sorted(folder.glob("*.c"))
    objects = sorted(folder.glob("*_code.o"))
    for source in sources:
        objects.append(source.with_suffix(".seen.o"))
        subprocess.run(["cc", "-std=c99", "-fPIC", "-c", str(source), "-o", str(objects[-1])], check=True)
    found = subprocess.run(["nm", *map(str, objects)], capture_output=True, text=True, check=True).stdout
    rows = [line.split()[-2:] for line in found.splitlines() if line]
    return [name for kind, name in (row for row in rows if len(row) == 2) if kind in "bBdDC"]
