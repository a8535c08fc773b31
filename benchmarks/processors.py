"""How far results differ between processors: the same runs by code for others than this one.

    python benchmarks/processors.py

Code for a processor without fused multiply-adds (x86-64), for one with them (x86-64-v3), code that is not optimised,
and XLA, each in a separate process without a cache. Prints the numbers of docs/platforms.md.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from coadjoint.kernels.run.backend import Backend
    from coadjoint.simulation import Run

ROOT = Path(__file__).parents[1]
GENERAL = platform.machine() in ("x86_64", "AMD64")
VARIANTS = ("host", *(("x86-64", "x86-64-v3") if GENERAL else ()), "not optimised", "xla")
CASES = (("heavy_top", 0.01, 100), ("underwater_vehicle", 0.01, 500), ("kirchhoff_ellipsoid", 0.02, 100))
"""Name in the catalogue, step and time, s."""
MEASURED = ("R", "q", "energy")
"""Attitude, position in m, and energy, relative to its largest value."""


def runs(backend: Backend) -> dict[str, Run]:
    """Entries of the catalogue by their defaults, the paper's vehicle for 500 s, and REMUS 100 on its square."""
    import coadjoint as co

    found = {}
    for name, dt, duration in CASES:
        entry = co.models.catalogue[name]
        system = entry.make()
        found[name] = co.simulate(system, entry.start(system), dt=dt, duration=duration, backend=backend)
    if backend == "native":
        found["square.toml"] = co.vehicles.load_mission(ROOT / "examples/square.toml").run()
    return found


def child(variant: str, path: str) -> None:
    """Run all by one variant, and write what they are at every saved time."""
    import llvmlite.binding as llvm

    if variant.startswith("x86"):
        llvm.get_host_cpu_name = lambda: variant
        llvm.get_host_cpu_features = _Features
    kept = {}
    for name, run in runs("xla" if variant == "xla" else "native").items():
        kept |= {f"{name}:{one}": np.asarray(run.dataset[one]) for one in MEASURED if one in run.dataset}
    np.savez(path, **kept)


class _Features:
    def flatten(self) -> str:
        return ""


def main() -> None:
    """Print by run and variant the largest difference from this processor's code, over all saved times."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for variant in VARIANTS:
            path = Path(folder) / f"{variant}.npz"
            more = {"COADJOINT_CACHE": "", "COADJOINT_OPTIMIZE": "0" if variant == "not optimised" else "1"}
            subprocess.run([sys.executable, __file__, variant, path], check=True, env={**os.environ, **more})
            found[variant] = dict(np.load(path))
    for key, here in found["host"].items():
        size = 1.0 if key.endswith(("R", "q")) else np.max(np.abs(here))
        for variant in VARIANTS[1:]:
            if (there := found[variant].get(key)) is not None:
                print(f"{key:30} {variant:14} {np.max(np.abs(here - there)) / size:.1e}")


if __name__ == "__main__":
    child(*sys.argv[1:]) if len(sys.argv) > 1 else main()
