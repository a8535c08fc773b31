"""The extension API: vehicles take from the core what is public, what `extending` names, and nothing else."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from pathlib import Path

import pytest

import coadjoint as co
from coadjoint import extending
from coadjoint.cli.keys import FILES
from coadjoint.cli.main import COMMANDS
from coadjoint.plotting.registries import ADDED, SCENES
from coadjoint.report.numbers import NUMBERS
from coadjoint.runs.methods import METHODS
from coadjoint.runs.run_file import KINDS
from coadjoint.simulation.result import FORMATS
from coadjoint_vehicles.files.kinds import ADDED as OF_VEHICLES
from coadjoint_vehicles.logs.measured import LOG_FORMATS
from imports import VEHICLES, parsed

PAGE = Path(__file__).parents[1] / "docs" / "extending.md"
PLUGIN = Path(__file__).parent / "plugin"
NAMES = 46
"""Names of the core that packages above may need and users do not."""


def outside(tree: ast.Module, own: str) -> list[str]:
    """What a module of the package `own` imports from the core that is neither public nor in the extension API."""
    nodes = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom | ast.Import)]
    plain = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    found = [name for name in plain if name.startswith("coadjoint.") and not name.startswith(own)]
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and f"{node.module}.".startswith("coadjoint."):
            taken = [(str(node.module), alias.name) for alias in node.names]
            found += [f"{module}.{name}" for module, name in taken if not _allowed(module, name, own)]
    return found


def _allowed(module: str, name: str, own: str) -> bool:
    if f"{module}.{name}.".startswith(f"{own}.") or f"{module}.{name}" in extending.MODULES:
        return True
    if module in extending.MODULES:
        return not name.startswith("_")
    return module in PUBLIC and name in PUBLIC[module]


PUBLIC: dict[str, list[str]] = {"coadjoint": co.__all__, "coadjoint.extending": extending.__all__} | {
    f"coadjoint.{name}": import_module(f"coadjoint.{name}").__all__
    for name in co.__all__
    if name != "vehicles" and hasattr(getattr(co, name), "__path__")
}
PUBLIC |= {f"coadjoint.models.{name}": vars(getattr(co.models, name)) for name in ("paper_form", "general_form")}


def test_vehicles_import_the_public_names_and_the_extension_api_and_nothing_else() -> None:
    found = {
        module: taken for module, tree in parsed(VEHICLES).items() if (taken := outside(tree, "coadjoint_vehicles"))
    }
    assert not found, "Take what is public, or what `coadjoint.extending` gives; which stays small."


@pytest.mark.parametrize("page", sorted(PAGE.parent.glob("*.md")), ids=lambda page: page.stem)
def test_pages_take_mechanics_methods_and_runs_from_public_names(page: Path) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    found = [name for block in blocks for name in outside(ast.parse(block), "my_package")]
    inner = ("coadjoint.mechanics.", "coadjoint.methods.", "coadjoint.simulation.", "coadjoint.runs.")
    assert not [name for name in found if name.startswith(inner)]


def test_the_extension_api_is_small_and_used() -> None:
    plugin = [ast.parse(path.read_text(encoding="utf-8")) for path in PLUGIN.rglob("*.py")]
    used = {
        alias.name
        for tree in (*parsed(VEHICLES).values(), *plugin)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == "coadjoint.extending"
        for alias in node.names
    }
    assert used == set(extending.__all__) and len(used) <= NAMES
    for name in extending.__all__:
        assert getattr(extending, name) is not None
    for name in extending.MODULES:
        assert import_module(name).__doc__


def test_the_page_on_the_extension_api_has_every_name_and_module() -> None:
    rows = re.findall(r"^\| (`.*?) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    words = {word for row in rows for word in re.findall(r"`([\w.]+)`", row)}
    assert words >= {*extending.__all__, *(name.removeprefix("coadjoint.") for name in extending.MODULES)}
    registries = (ADDED, SCENES, NUMBERS, FORMATS, KINDS, COMMANDS, FILES, co.models.catalogue, METHODS, LOG_FORMATS)
    tables = {node.kind for node in (*registries, *OF_VEHICLES.values())}
    assert words >= tables and len(words) == len(extending.__all__) + len(extending.MODULES) + len(tables)


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("from coadjoint.simulation.plan import Plan", ["coadjoint.simulation.plan.Plan"]),
        ("from coadjoint.mechanics import Force\nfrom coadjoint import units as u", []),
        ("from coadjoint.checks import number, _whole", ["coadjoint.checks._whole"]),
        ("from coadjoint.extending import traced, Plan", ["coadjoint.extending.Plan"]),
        ("import coadjoint.kernels.emit", ["coadjoint.kernels.emit"]),
        ("import coadjoint as co\nfrom coadjoint_vehicles.parts.part import Part", []),
    ],
)
def test_an_import_past_the_extension_api_is_found(line: str, found: list[str]) -> None:
    assert outside(ast.parse(line), "coadjoint_vehicles") == found
