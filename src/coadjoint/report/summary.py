"""Numbers of a run as JSON."""

from __future__ import annotations

import json
import math
import platform
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

import numpy as np

from coadjoint.arrays import PyTree

if TYPE_CHECKING:
    from coadjoint.simulation.run import Run


def run_summary(run: Run) -> dict[str, object]:
    """The certificate of a run, and its final state."""
    found = dict(run.summary())
    if run.count:
        found["time_final"] = float(run.final.t)
        if np.size(run.final.n):
            found["position_final"] = np.asarray(run.final.q)
        found["xi_final"] = np.asarray(run.final.xi)
    complete = run.good_steps == run.steps or run.event is not None
    return {
        **found,
        "saved": run.count,
        "complete": complete,
        "warnings": list(run.warnings),
        **run.certificate.asdict(),
    }


def versions() -> dict[str, str]:
    """The versions of Python and of the packages that numbers may depend on."""
    found = {"python": platform.python_version()}
    for package in ("coadjoint", "jax", "numpy", "llvmlite"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def to_json(value: object) -> str:
    """JSON text of plain and NumPy values; numbers that are not finite, which JSON lacks, become null."""
    return json.dumps(_plain(value), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _plain(value: object) -> PyTree:
    if isinstance(value, dict):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, (bool, int, float, str, type(None))) else str(value)
