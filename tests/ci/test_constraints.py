"""constraints.txt: versions that the bounds of the dependencies admit, for each Python."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / ".ci"))
import constraints  # noqa: E402

LINE = re.compile(r"(?P<name>[\w-]+)==(?P<version>[\w.]+)(; python_version (==|>=) \"3\.\d+\")?")
PROJECTS = [
    tomllib.loads((ROOT / name).read_text("utf-8"))["project"] for name in ("pyproject.toml", "vehicles/pyproject.toml")
]
EXTRAS = ("control", "cluster", "fmu", "learn", "logs", "maps")
BOUNDED = [
    line
    for project in PROJECTS
    for line in (
        *project["dependencies"],
        *(one for extra, lines in project["optional-dependencies"].items() if extra in EXTRAS for one in lines),
    )
    if not line.startswith("coadjoint")
]


def numbers(version: str) -> list[int]:
    return [int(number) for number in re.findall(r"\d+", version)][:3]


@pytest.fixture(scope="module")
def fixed() -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for line in constraints.FILE.read_text("utf-8").splitlines():
        if not line.startswith("#"):
            one = LINE.fullmatch(line)
            assert one, f"`{line}` must fix a version, as in numpy==2.5.5"
            found.setdefault(one["name"], []).append(one["version"])
    return found


def test_every_dependency_is_fixed_within_its_bounds(fixed: dict[str, list[str]]) -> None:
    assert len(BOUNDED) > 15
    for line in BOUNDED:
        name, lower, upper = re.fullmatch(r"([\w-]+)>=([\d.]+),<([\d.]+)", line).groups()
        for version in fixed[name]:
            assert numbers(lower) <= numbers(version) < numbers(upper), f"{name} {version} is outside of {line}"


def test_versions_are_by_python_where_they_differ() -> None:
    found = {"3.11": ["a==1", "B.c==2", "pip==9"], "3.12": ["a==1", "b_c==3"], "3.13": ["a==1", "b-c==3"]}
    lines = constraints.merged(found).removeprefix(constraints.HEAD).splitlines()
    assert lines == ["a==1", 'b-c==2; python_version == "3.11"', 'b-c==3; python_version >= "3.12"']
