"""Logs of floats: a line with "drift 1", then time in s and depth in m, separated by a space."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from coadjoint.errors import FileError
from coadjoint.identification import Log


def read_drift(path: Path, *, density: float = 1025.0) -> Log:
    """The log; density: of the water, kg/m³, by which the depth was found, to one of 1025 kg/m³."""
    head, _, text = path.read_text(encoding="utf-8").partition("\n")
    if head != "drift 1":
        raise FileError(f"The file {path} must begin with `drift 1`, but begins with {head[:20]!r}.")
    try:
        rows = np.array([[float(word) for word in line.split()] for line in text.splitlines()])
        time, depth = rows.T
    except ValueError as error:
        raise FileError(f"Each line of {path} must hold a time and a depth.") from error
    return Log(time, {"depth": depth * 1025.0 / density})
