"""Which versions a command runs with: what a report of an error must name."""

from __future__ import annotations

import platform
from importlib import metadata

import coadjoint

NAMED = {"jax": "JAX", "llvmlite": "llvmlite", "numpy": "NumPy"}


def versions() -> str:
    """`coadjoint 0.1.0 with Python 3.11.7, JAX 0.10.2, llvmlite 0.50.0, NumPy 2.4.6`."""
    packages = ", ".join(f"{name} {metadata.version(package)}" for package, name in NAMED.items())
    return f"coadjoint {coadjoint.__version__} with Python {platform.python_version()}, {packages}"


def unexpected(error: Exception) -> str:
    """What is said of an error that nobody foresaw: what it is, with which versions, and what to report."""
    first = (str(error).strip().split("\n") or [""])[0]
    what = f"{type(error).__name__}: {first}" if first else type(error).__name__
    return (
        f"coadjoint met an error that it did not expect, {what}\n"
        f"This is {versions()}.\n"
        "Please report it: these lines, the command, the file that it was given, and what it prints with "
        "COADJOINT_TRACEBACK=1 set, which tells where."
    )
