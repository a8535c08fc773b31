"""The state of the installation: versions, extras, programs, cache and devices, and what to do about them."""

from __future__ import annotations

import os
import platform
import shutil
from dataclasses import dataclass
from importlib import metadata
from typing import ClassVar

import coadjoint
from coadjoint.cli import terminal
from coadjoint.kernels.trace.library import digest_of_files
from coadjoint.texts import Table

EXTRAS = {
    "control": "optimal motion and estimation on a moving horizon",
    "cluster": "sweeps on many machines",
    "fmu": "functional mock-up units",
    "docs": "the site",
}
"""The extras of coadjoint, and what each serves."""
OF_VEHICLES = {"learn": "environments of Gymnasium", "logs": "logs of ROS, Foxglove and ArduPilot", "maps": "GeoTIFF"}
"""Those of coadjoint-vehicles."""
PROGRAMS = {"ffmpeg": "animations as MP4", "nvidia-smi": "NVIDIA GPUs"}
"""Programs that are used where they are installed."""


@dataclass(frozen=True)
class Doctor:
    """Report versions, installed packages, the cache and the GPU, with remedies."""

    BEGINS: ClassVar[str] = "Looking at the installation; JAX takes a second."

    json: bool = False
    """Print the report as JSON, and nothing else."""

    def __call__(self) -> int:
        found = report()
        if self.json:
            terminal.json(found)
            return 0
        rows = [(name, text) for name, text in found.items() if isinstance(text, str)]
        terminal.fields([*rows, *(("to do", sentence) for sentence in found["to do"] or ["Nothing."])])
        return 0


NAMED = {"jax": "JAX", "llvmlite": "llvmlite", "numpy": "NumPy"}


def versions() -> str:
    """`coadjoint 0.2.0 with Python 3.11.7, JAX 0.10.2, llvmlite 0.50.0, NumPy 2.4.6`."""
    packages = ", ".join(f"{name} {metadata.version(package)}" for package, name in NAMED.items())
    return f"coadjoint {coadjoint.__version__} with Python {platform.python_version()}, {packages}"


def report() -> Table:
    """The lines of `coadjoint doctor` by their names, and what to do."""
    todo: list[str] = []
    found: Table = {"versions": versions(), "files": f"SHA-256 {digest_of_files()[:16]} of the library's own"}
    for package, extras in (("coadjoint", EXTRAS), ("coadjoint-vehicles", OF_VEHICLES)):
        number = _version(package)
        found[package] = number or "not installed"
        if not number:
            todo.append("`pip install coadjoint-vehicles` adds underwater vehicles, their missions and logs.")
            continue
        for extra, purpose in extras.items():
            lacking = [name for name in requirements(package, extra) if not _version(name)]
            found[f"[{extra}]"] = f"{'lacks ' + ', '.join(lacking) if lacking else 'installed'}: {purpose}"
            if lacking:
                todo.append(f'`pip install "{package}[{extra}]"` adds {purpose}.')
    for program, purpose in PROGRAMS.items():
        found[program] = f"{shutil.which(program) or 'not on the PATH'}: {purpose}"
    found["cache"], of_cache = _cache()
    found["devices"], of_devices = _devices()
    return {**found, "to do": [*todo, *of_cache, *of_devices]}


def requirements(package: str, extra: str) -> list[str]:
    """The names of the packages that an extra of a package asks for."""
    given = metadata.requires(package) or []
    mine = [one for one in given if f"extra == '{extra}'" in one or f'extra == "{extra}"' in one]
    return [_name(one) for one in mine]


def _name(requirement: str) -> str:
    """The name of a package in a requirement such as "casadi>=3.6.7,<3.9 ; extra == 'control'"."""
    name = requirement.strip()
    for sign in (";", "[", "<", ">", "=", "!", "~", " ", "("):
        name = name.partition(sign)[0]
    return name


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def _cache() -> tuple[str, list[str]]:
    """The folder of machine code, its size, and what to do where it cannot be used."""
    from coadjoint.kernels.store import folder

    place = folder()
    if place is None:
        return "off", ["Unset COADJOINT_CACHE, or name a folder by it: second runs start faster."]
    files = [file for file in place.rglob("*") if file.is_file()] if place.is_dir() else []
    size = sum(file.stat().st_size for file in files) / 1e6
    home = next(one for one in (place, *place.parents) if one.exists())
    if not os.access(home, os.W_OK):
        return f"{place}: cannot be written", [f"Make {home} writable, or set COADJOINT_CACHE to another folder."]
    return f"{place}: {len(files):,} files, {size:.1f} MB", []


def _devices() -> tuple[str, list[str]]:
    """The devices that JAX sees, and what to do where there is a GPU that it does not see."""
    import jax

    seen = ", ".join(f"{device.platform} ({device.device_kind})" for device in jax.devices())
    if shutil.which("nvidia-smi") and all(device.platform == "cpu" for device in jax.devices()):
        return seen, ['`pip install "jax[cuda12]"` lets large systems run on the NVIDIA GPU of this machine.']
    return seen, []
