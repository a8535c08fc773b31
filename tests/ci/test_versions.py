"""Every dependency has two bounds, and every package of the library is tested with other versions as well."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
BOUNDS = re.compile(r"([\w-]+)>=([\d.]+),<([\d.]+)")
SELECTION = [
    line for line in (ROOT / ".ci/selection.txt").read_text("utf-8").splitlines() if line and not line.startswith("#")
]


def numbers(version: str) -> list[int]:
    """The numbers of a version, with zeros behind them."""
    found = [int(number) for number in re.findall(r"\d+", version)]
    return found + [0] * (6 - len(found))


@pytest.mark.parametrize("requirement", PROJECT["dependencies"])
def test_a_dependency_has_two_bounds_and_what_is_installed_lies_between_them(requirement):
    bounds = BOUNDS.fullmatch(requirement)
    assert bounds, f"`{requirement}` must have a lower and an upper bound, as numpy>=2.0,<2.6"
    name, lower, upper = bounds.groups()
    assert numbers(lower) <= numbers(metadata.version(name)) < numbers(upper)


def test_the_oldest_dependencies_are_the_lower_bounds():
    script = [sys.executable, str(ROOT / ".ci/oldest.py")]
    pins = subprocess.run(script, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    assert set(pins) >= {"{}=={}".format(*BOUNDS.fullmatch(line).groups()) for line in PROJECT["dependencies"]}


def folders(folder: Path) -> set[str]:
    """The folders with Python files of their own, below a folder."""
    files = [path.relative_to(folder) for path in folder.rglob("*.py")]
    own = [path for path in files if path.name not in ("__init__.py", "conftest.py") and len(path.parts) > 1]
    return {str(path.parent) for path in own}


def test_the_selection_for_other_versions_touches_every_package_of_the_library_and_of_the_tests():
    chosen = {str(Path(line.partition("::")[0]).parent.relative_to("tests")) for line in SELECTION}
    tests = {one for one in folders(ROOT / "tests") if any((ROOT / "tests" / one).glob("test_*.py"))}
    library = {one for one in folders(ROOT / "src/coadjoint") if one in tests}
    left_out = {"benchmarks", "ci", "docs", "mutation"}
    assert sorted(library - chosen) == []
    assert sorted(tests - chosen - left_out) == []


@pytest.mark.cases(6)
@pytest.mark.parametrize("line", SELECTION)
def test_what_is_selected_is_there_and_runs_by_default(line):
    file, _, name = line.partition("[")[0].partition("::")
    path = ROOT / file
    assert path.is_file(), f"{file} has moved: .ci/selection.txt must follow"
    functions = {one.name: one for one in ast.parse(path.read_text("utf-8")).body if isinstance(one, ast.FunctionDef)}
    assert name in functions, f"{line} has another name: .ci/selection.txt must follow"
    marks = [ast.unparse(one) for one in functions[name].decorator_list]
    assert "pytest.mark.long" not in marks, f"{line} is marked long: choose another"
