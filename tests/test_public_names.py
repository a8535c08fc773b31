"""The names of `co`: those of daily use; others stand in packages, and warn until they leave `co`."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import coadjoint as co
from coadjoint.lazy import homes
from imports import files

ROOT = Path(__file__).parents[1]
MOVED = [(package, name) for package, names in co.MOVED.items() for name in names.split()]


def test_co_lists_names_of_daily_use_and_packages() -> None:
    assert len(co.__all__) <= 64
    assert dir(co) == co.__all__ and "vehicles" not in dir(co), "which another distribution adds"
    assert not {name for _, name in MOVED} & set(co.__all__)
    assert {*co.MOVED} < set(co.__all__), "A package that has names must itself be found from `co`."


@pytest.mark.parametrize(("package", "name"), MOVED)
def test_a_name_of_a_package_warns_in_co_and_says_where_it_is(package: str, name: str) -> None:
    home = getattr(co, package)
    assert name in home.__all__
    with pytest.warns(
        DeprecationWarning, match=rf"^`coadjoint.{name}` .* 0.3; write `coadjoint.{package}.{name}`.$"
    ) as told:
        assert getattr(co, name) is getattr(home, name)
    assert told[0].filename == __file__


def test_an_import_of_a_name_of_a_package_warns() -> None:
    with pytest.warns(DeprecationWarning, match=r"write `coadjoint.groups.Heisenberg`"):
        from coadjoint import Heisenberg
    assert Heisenberg is co.groups.Heisenberg


@pytest.mark.parametrize(
    ("written", "meant"), [("Midpiont", "Midpoint"), ("simulte", "simulate"), ("Heisenburg", "Heisenberg")]
)
def test_a_misspelt_name_gives_the_nearest_one(written: str, meant: str) -> None:
    with pytest.raises(AttributeError, match=rf"^coadjoint has no `{written}`; did you mean `{meant}`\?$"):
        getattr(co, written)
    with pytest.raises(AttributeError, match=r"^coadjoint_vehicles has no `laod`; did you mean `load`\?$"):
        co.vehicles.laod  # noqa: B018 # pyright: ignore[reportAttributeAccessIssue]


def test_a_name_that_is_near_no_other_gives_all() -> None:
    with pytest.raises(AttributeError, match=r"^coadjoint has no `qqq`; it has: Cayley, Coadjoint, .*trajectory"):
        getattr(co, "qqq")  # noqa: B009


def lazy_packages() -> list[Path]:
    faces = [path for path in files().values() if path.name == "__init__.py"]
    return [path for path in faces if "= lazy(" in path.read_text(encoding="utf-8")]


def test_type_checkers_see_imports_and_no_getattr_of_a_module() -> None:
    """With a `__getattr__` every name of a module is right; an import as another name is private to the module."""
    assert len(lazy_packages()) > 15
    for path in lazy_packages():
        text = path.read_text(encoding="utf-8")
        assert "if not TYPE_CHECKING:\n    __getattr__, __dir__, __all__ = lazy(" in text, path
        package = ".".join(path.parent.parts[path.parts.index("src", len(ROOT.parts)) + 1 :])
        listed = text.partition("__all__ = ")[2].partition("]")[0]
        hidden = [n for n, (_, there) in homes(package).items() if n != there and f'"{n}"' not in listed]
        assert not hidden, (
            f"Type checkers see no {hidden} of {package}: list them in `__all__` under `if TYPE_CHECKING:`."
        )


@pytest.mark.long
def test_pyright_knows_the_names_of_an_installed_library(tmp_path: Path) -> None:
    pytest.importorskip("pyright")
    packages = tmp_path / "environment" / "lib" / f"python3.{sys.version_info[1]}" / "site-packages"
    for source in (ROOT / "src" / "coadjoint", ROOT / "vehicles" / "src" / "coadjoint_vehicles"):
        shutil.copytree(source, packages / source.name, ignore=shutil.ignore_patterns("__pycache__"))
    lines = ["import coadjoint as co", "reveal_type(co.vehicles.load)", "co.Sytem", "co.vehicles.laod", "co.SLn"]
    lines += [f"co.{name}" for name in co.__all__]
    lines += [
        f"co.{package}.{name}"
        for package in ("models", "vehicles", "mechanics")
        for name in getattr(co, package).__all__
    ]
    written = tmp_path / "uses.py"
    written.write_text("\n".join(lines) + "\n", encoding="utf-8")
    settings = {"venvPath": str(tmp_path), "venv": "environment", "reportMissingImports": False, "include": ["uses.py"]}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "pyright", "--outputjson", "-p", str(tmp_path)], capture_output=True, text=True
    )
    found = json.loads(done.stdout)["generalDiagnostics"]
    said = {lines[one["range"]["start"]["line"]]: one["message"] for one in found if one["severity"] == "error"}
    assert {*said} == {"co.Sytem", "co.vehicles.laod", "co.SLn"}
    assert any("-> Vehicle" in one["message"] for one in found)
