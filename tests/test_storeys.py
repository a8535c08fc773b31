"""A package imports only from those below it, and nothing below the vehicles knows one."""

from __future__ import annotations

import ast
from functools import cache

import pytest

from imports import circles, loaded, named, parsed

STOREYS = (
    "arrays", "errors", "deprecation", "log", "collector", "interrupts", "disk", "c_sources", "memory", "manifest",
    "lazy", "postponed", "trees", "before_jax", "paths", "portable", "extensions", "earlier_names", "units", "texts",
    "overview", "sealed", "archives", "labelled",
    "csv_tables", "roots", "kernels", "real_numbers", "known_names", "checks", "losses", "clocks", "sections",
    "groups", "spaces", "difference_maps", "mechanics", "methods", "models", "theory", "plotting", "simulation",
    "stability", "identification", "control", "estimation", "report", "audit", "runs", "sweeps", "cli", "extending",
    "vehicles", "__main__",
)  # fmt: skip
"""From the ground up."""
PACKAGES_OF_VEHICLES = (
    *("axes", "parts", "water", "hydrodynamics", "sensors", "model", "trim", "controllers", "files", "remus"),
    *("importing", "logs", "trials", "figures", "readings"),
    *("serving", "missions", "environments", "commands", "extension"),
)
"""From the ground up, too."""
PACKAGES_OF_KERNELS = (
    "untraceable", "store", "float64", "program", "chunk", "packing", "lanes", "expressions", "trace", "newton", "emit",
    "run",
)  # fmt: skip

FACES = {"coadjoint", "coadjoint.vehicles"}
"""What lists the public names of all that is behind it."""


@cache
def names() -> dict[str, set[str]]:
    """The modules that each module names."""
    return {module: named(parsed(), module) - FACES for module in parsed() if module not in FACES}


@pytest.fixture(scope="module", autouse=True)
def read():
    """All files are read once for all tests here."""
    names()


def package_of(module: str) -> str:
    """The package of a module in its layer: `groups`; of vehicles and kernels `vehicles.parts`."""
    parts = module.split(".")[1:]
    return ".".join(parts[:2]) if parts[0] in ("kernels", "vehicles") else parts[0]


def upwards(order: tuple[str, ...], prefix: str = "") -> list[str]:
    """Who names what stands above it, or what is in no place of the order."""
    level = {f"{prefix}{name}": place for place, name in enumerate(order)}

    def of(module: str) -> str:
        return package_of(module) if prefix else package_of(module).partition(".")[0]

    pairs = [(a, b) for a, found in names().items() for b in found if of(a).startswith(prefix) and of(a) != of(b)]
    pairs = [(a, b) for a, b in pairs if of(b).startswith(prefix)]
    return [f"{a} names {b}" for a, b in pairs if level.get(of(b), len(level)) >= level.get(of(a), -1)]


def test_nothing_below_the_vehicles_names_them():
    below = [module for module in names() if not module.startswith("coadjoint.vehicles")]
    found = {a: [b for b in names()[a] if b.startswith("coadjoint.vehicles")] for a in below}
    assert not {a: others for a, others in found.items() if others}


def test_a_package_imports_only_from_those_below_it():
    assert upwards(STOREYS) == []


def test_a_package_of_the_vehicles_imports_only_from_those_below_it():
    assert upwards(PACKAGES_OF_VEHICLES, "vehicles.") == []


def test_a_package_of_the_kernels_imports_only_from_those_below_it():
    assert upwards(PACKAGES_OF_KERNELS, "kernels.") == []


def test_no_packages_and_no_files_name_one_another():
    packages: dict[str, set[str]] = {}
    for module, others in names().items():
        packages.setdefault(package_of(module), set()).update(
            {package_of(name) for name in others} - {package_of(module)}
        )
    assert circles(packages) == []
    assert not circles(names()), "Files name one another: put what both need into a third, or pass it as an argument."


def test_no_two_classes_of_a_storey_have_one_name():
    found: dict[tuple[str, str], list[str]] = {}
    for module, tree in parsed().items():
        storey = next((name for name in ("vehicles", "cli") if module.startswith(f"coadjoint.{name}")), "core")
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault((storey, node.name), []).append(module)
    assert not {name: homes for name, homes in found.items() if len(homes) > 1}


@pytest.mark.parametrize(
    ("module", "late"),
    [
        ("simulation.simulate", ("xarray", "pandas", "scipy", "matplotlib", "zarr", "h5py", "dask")),
        ("vehicles.missions.file", ("xarray", "pandas", "scipy", "zarr", "h5py", "dask")),
        ("simulation.resume", ("pandas", "scipy", "matplotlib", "zarr", "dask")),
        ("vehicles.sensors.imu", ("xarray", "pandas", "scipy", "zarr", "h5py", "dask")),
        ("cli.commands", ("jax", "numpy", "xarray", "pandas", "scipy", "matplotlib", "zarr", "h5py", "dask")),
    ],
)
def test_libraries_that_are_slow_to_load_are_imported_where_they_are_used(module, late):
    found = loaded(parsed(), f"coadjoint.{module}")
    assert {name: found[name] for name in late if name in found} == {}
