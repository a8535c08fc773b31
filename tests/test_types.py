"""Types in annotations: `Any` is rare, and the aliases mean what type checkers read."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
MOST = 1500
"""How often `Any` may stand in both distributions, imports of it included."""


def test_any_stands_only_where_no_alias_names_the_type():
    texts = [
        path.read_text(encoding="utf-8") for folder in ("src", "vehicles/src") for path in (ROOT / folder).rglob("*.py")
    ]
    assert sum(len(re.findall(r"\bAny\b", text)) for text in texts) <= MOST


def test_arrays_are_no_alias_of_any():
    text = (ROOT / "src" / "coadjoint" / "arrays.py").read_text(encoding="utf-8")
    aliases = dict(re.findall(r"^ *(\w+): TypeAlias = (.*)$", text, re.MULTILINE))
    assert {name for name, of in aliases.items() if of == "Any"} == {"PyTree"}
    assert {*aliases} == {"Array", "Scalar", "Coordinates", "PyTree"}


def test_pyright_is_strict_in_the_packages_of_the_mathematics():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    pyright = project["tool"]["pyright"]
    strict = [one["root"] for one in pyright["executionEnvironments"] if {*one} == {"root", "extraPaths"}]
    assert pyright["typeCheckingMode"] == "strict"
    names = ("groups", "spaces", "difference_maps", "mechanics", "methods")
    assert strict == [f"src/coadjoint/{name}" for name in names]
