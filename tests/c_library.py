"""Exported C libraries, compiled and loaded by ctypes."""

from __future__ import annotations

import ctypes
import shutil
import subprocess

import pytest

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler is installed")


def built(folder, name):
    """The shared library of an exported folder; warnings are errors."""
    library = folder / f"lib{name}.so"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O1", "-shared", "-fPIC"]
    done = subprocess.run(
        ["cc", *flags, f"{name}.c", f"{name}_code.o", "-o", str(library), "-lm"],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(str(library))


def structure(**fields):
    """A structure of arrays, name → (type, count)."""
    return type(
        "Structure", (ctypes.Structure,), {"_fields_": [(name, kind * n) for name, (kind, n) in fields.items()]}
    )
