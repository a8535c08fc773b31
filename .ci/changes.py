"""Which packages of the library a change touches, and which tests are theirs.

A package is a folder of `src/coadjoint` (`kernels.emit`), or a module at its top (`units`).
"""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))
from imports import modules, named  # noqa: E402

RECENT = 6 * 3600.0
"""A commit that is older, s, is a base where no other is known."""
FACES = {"coadjoint", "coadjoint.vehicles"}
"""What only lists names of other packages."""
COMMON = {"pyproject.toml", "vehicles/pyproject.toml", "tests/conftest.py"}
"""Files that all tests depend on."""
PAGES = ("docs", "examples", "README.md", "CONTRIBUTING.md")
"""Files and folders that `tests/docs` reads."""


@dataclass(frozen=True)
class Base:
    """The commit with which a change is compared (none: all has changed), and the sentence that says why this one."""

    commit: str | None
    why: str


def base(root: Path = ROOT, now: float | None = None) -> Base:
    """`$BASE`, else the merge base with origin/main, else the newest commit that is older than six hours, else none.

    Raises ValueError where `$BASE` is no commit.
    """
    if given := os.environ.get("BASE"):
        commit = _git(root, "rev-parse", "--verify", "--quiet", f"{given}^{{commit}}")
        if not commit:
            raise ValueError(f"BASE must be a commit of this repository, but is {given}.")
        return Base(commit, f"compared with {commit[:9]}, which BASE gives")
    head = _git(root, "rev-parse", "--verify", "--quiet", "HEAD")
    merged = _git(root, "merge-base", "HEAD", "origin/main")
    if merged and merged != head:
        return Base(merged, f"compared with {merged[:9]}, where the branch leaves origin/main")
    useless = "origin/main contains HEAD and is of no use as a base; " if merged else ""
    for line in _git(root, "log", "--first-parent", "--format=%H %ct").splitlines():
        commit, seconds = line.split()
        if float(seconds) < (time.time() if now is None else now) - RECENT:
            return Base(commit, f"{useless}compared with {commit[:9]}, the newest commit older than six hours")
    return Base(None, f"{useless}no commit is older than six hours: everything counts as changed")


def changed(commit: str, root: Path = ROOT) -> set[str]:
    """The files that differ from a commit, those that are not committed included."""
    found = _git(root, "diff", "--name-only", "--no-renames", commit)
    return set(found.splitlines()) | set(_git(root, "ls-files", "--others", "--exclude-standard").splitlines())


def tree(root: Path = ROOT) -> str:
    """The hash of the files of the newest commit."""
    return _git(root, "rev-parse", "HEAD^{tree}")


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""


@dataclass(frozen=True)
class Choice:
    """Files of tests: of what changed, and of the packages that import a changed package directly."""

    packages: list[str]
    own: list[str]
    importing: list[str]


def chosen(files: Iterable[str], root: Path = ROOT) -> Choice:
    """The tests of changed files, as paths from the root."""
    trees = modules(root / "src/coadjoint", *sorted(root.glob("*/src/coadjoint_*")))
    own: set[str] = set()
    packages: set[str] = set()
    for file in files:
        if _in_library(file):
            packages.add(package(trees, _module(trees, file)))
        else:
            own |= _of_tests(file, root)
    for name in packages:
        own |= tests_of(name, root)
    importers = {name for other in packages for name in imported_by(trees).get(other, ())}
    importing = {file for name in importers for file in tests_of(name, root)}
    importing |= {file for file in _without_package(trees, root) if _packages_in(trees, root / file) & packages}
    return Choice(sorted(packages), sorted(own), sorted(importing - own))


def _in_library(file: str) -> bool:
    return file.startswith("src/coadjoint/") or "/src/coadjoint_" in file


def _module(trees: Mapping[str, ast.Module], file: str) -> str:
    """The module of a source file; of data, and of a module that was deleted, the package that it lies in."""
    above, _, inside = file.rpartition("src/coadjoint")
    name = ".".join(Path(f"coadjoint{inside.replace('_', '/', 1) if above else inside}").with_suffix("").parts)
    name = name.removesuffix(".__init__")
    while name not in trees:
        name = name.rpartition(".")[0]
    return name


def package(trees: Mapping[str, ast.Module], module: str) -> str:
    """The package of a module: `kernels.emit` of `coadjoint.kernels.emit.emitter`, `units` of `coadjoint.units`."""
    parts = module.split(".")[1:]
    is_package = any(name.startswith(f"{module}.") for name in trees)
    return ".".join(parts if is_package or len(parts) == 1 else parts[:-1])


def imported_by(trees: Mapping[str, ast.Module]) -> dict[str, set[str]]:
    """The packages that import each package."""
    found: dict[str, set[str]] = {}
    for module in set(trees) - FACES:
        importer = package(trees, module)
        for other in {package(trees, name) for name in named(trees, module) - FACES} - {importer}:
            found.setdefault(other, set()).add(importer)
    return found


def tests_of(name: str, root: Path = ROOT) -> set[str]:
    """The files of the tests of a package; where it has none, those of the package that it lies in."""
    if "." not in name and not ((root / "src/coadjoint" / name).is_dir() or (root / name / "src").is_dir()):
        file = root / f"tests/test_{name}.py"
        return {_path(file, root)} if name and file.is_file() else set()
    folder = root / "tests" / name.replace(".", "/")
    if folder.is_dir():
        found = sorted(folder.glob("test_*.py")) or folder.rglob("test_*.py")
        return {_path(file, root) for file in found}
    return tests_of(name.rpartition(".")[0], root) if "." in name else set()


def _path(file: Path, root: Path) -> str:
    return file.relative_to(root).as_posix()


def every_test(root: Path = ROOT) -> list[str]:
    """All files of tests."""
    return sorted(_path(file, root) for file in (root / "tests").rglob("test_*.py"))


def _of_tests(file: str, root: Path) -> set[str]:
    """The files of tests that read a changed file which is not of the library."""
    path = Path(file)
    if file in COMMON:
        return set(every_test(root))
    if path.parts[0] != "tests":
        folder = "docs" if file in PAGES or path.parts[0] in PAGES else path.parts[0].lstrip(".")
        return {_path(test, root) for test in (root / "tests" / folder).glob("test_*.py")}
    if path.name.startswith("test_"):
        return {file} if (root / file).is_file() else set()
    if path.suffix == ".py" and path.name != "conftest.py":
        return _using(path.stem, root)
    return {_path(test, root) for test in (root / path.parent).rglob("test_*.py")}


def _using(helper: str, root: Path) -> set[str]:
    """The files of tests that import a module of `tests/`, directly or by others."""
    imports = {file: _imports(root / file) for file in (_path(one, root) for one in (root / "tests").rglob("*.py"))}
    found, new = set(), {helper}
    while new:
        files = {file for file, names in imports.items() if names & new} - found
        found |= files
        new = {Path(file).stem for file in files}
    return {file for file in found if Path(file).name.startswith("test_")}


@cache
def _imports(file: Path) -> frozenset[str]:
    nodes = list(ast.walk(ast.parse(file.read_text("utf-8"))))
    plain = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    return frozenset(plain | {node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module})


def _without_package(trees: Mapping[str, ast.Module], root: Path) -> list[str]:
    """The files of tests in folders that belong to no package, as `tests/truth`; `docs` and `ci` read no module."""
    folders = {name.split(".")[1] for name in trees if "." in name} | {"tests", "docs", "ci"}
    return [file for file in every_test(root) if Path(file).parts[1] not in folders and len(Path(file).parts) > 2]


def _packages_in(trees: Mapping[str, ast.Module], test: Path) -> set[str]:
    """The packages of what a test names, as `methods` of `co.Midpoint`."""
    face = (node for node in ast.walk(trees["coadjoint"]) if isinstance(node, ast.ImportFrom))
    homes = {f"coadjoint.{alias.asname or alias.name}": node.module or "" for node in face for alias in node.names}
    homes |= {name: name for name in homes if name in trees}  # packages, as in co.groups.SLn
    tree = ast.parse(test.read_text("utf-8"))
    found = {ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    names = {homes.get(name.replace("co.", "coadjoint.", 1), "") for name in found if name.startswith("co.")}
    names |= {name for name in _imports(test) if name.startswith("coadjoint.")}
    return {package(trees, name) for name in names if name in trees}
