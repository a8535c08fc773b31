"""Which file of the library names which: imports, those inside functions too, and names of modules in strings."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "coadjoint"
VEHICLES = ROOT / "vehicles" / "src" / "coadjoint_vehicles"
_LIBRARY = ("coadjoint", "co")
"""What the library is called where it is imported as a whole."""
_IN_TEXT = re.compile(r"\bcoadjoint(?:_vehicles)?(?:\.\w+)+")
ABOVE = {"coadjoint_vehicles": "coadjoint.vehicles"}
"""What packages above the core are called here."""


def modules(*sources: Path) -> dict[str, ast.Module]:
    """Every module by its name, `coadjoint.groups` for a package; by default of the core and of all above it."""
    found = {}
    for source in sources or (SOURCE, *sorted(ROOT.glob("*/src/coadjoint_*"))):
        for path in sorted(source.rglob("*.py")):
            parts = (source.name, *path.relative_to(source).with_suffix("").parts)
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            found[_called(name)] = ast.parse(path.read_text(encoding="utf-8"))
    return found


parsed = cache(modules)
"""`modules`, read once: for tests of files that no test changes."""


def files() -> dict[str, Path]:
    """Every Python file of the library and of the packages above it, by its path: `vehicles/axes.py`."""
    return {
        str(Path(*_called(source.name).split(".")[1:], path.relative_to(source)).as_posix()): path
        for source in (SOURCE, *sorted(ROOT.glob("*/src/coadjoint_*")))
        for path in sorted(source.rglob("*.py"))
    }


def _called(name: str) -> str:
    first, dot, rest = name.partition(".")
    return f"{ABOVE.get(first, first)}{dot}{rest}"


def named(trees: Mapping[str, ast.Module], module: str) -> set[str]:
    """The modules that a module names, those included that it imports for annotations alone.

    Texts for readers, which are docstrings, do not count.
    """
    api = _extension_api(trees.get("coadjoint.extending"))
    called = map(_called, _names(trees[module]))
    written = (_of_library(trees, api.get(name, name)) for name in called)
    return {name for name in written if name not in ("", module)}


@cache
def _extension_api(tree: ast.Module | None) -> dict[str, str]:
    """Where the names are defined that `coadjoint.extending` gives to packages above."""
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)] if tree else []
    pairs = [(node, alias) for node in imports for alias in node.names]
    return {f"coadjoint.extending.{a.asname}": f"{node.module}.{a.name}" for node, a in pairs if a.asname}


_NAMING = {ast.ImportFrom, ast.Import, ast.Constant, ast.Attribute, ast.Expr}
_ENDS = {ast.ImportFrom, ast.Import, ast.Constant, ast.Name, ast.Load, ast.Store, str, int, type(None)}
"""Nodes, and fields that are no nodes, below which nothing names a module."""


@cache
def _nodes(tree: ast.Module) -> list[ast.AST]:
    """The imports, texts and attributes of a module, by which it can name another one."""
    found: list[ast.AST] = []
    left: list[ast.AST] = [tree]
    while left:
        node = left.pop()
        kind = type(node)
        if kind in _NAMING:
            found.append(node)
        if kind in _ENDS:
            continue
        for field in kind._fields:
            value = getattr(node, field)
            if isinstance(value, list):
                left.extend(value)
            elif value is not None:
                left.append(value)
    return found


def _names(tree: ast.Module) -> Iterator[str]:
    nodes = _nodes(tree)
    readers = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in readers:
            yield from _IN_TEXT.findall(node.value)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in _LIBRARY:
            yield f"coadjoint.{node.attr}"


def loaded(trees: Mapping[str, ast.Module], module: str) -> dict[str, str]:
    """What is imported with a module: every name outside the library, and the module that imports it.

    Imports inside functions and under TYPE_CHECKING do not count.
    """
    found: dict[str, str] = {}
    seen, left = set(), [module]
    while left:
        name = left.pop()
        if name in seen:
            continue
        seen.add(name)
        nodes: list[ast.stmt] = [one for one in trees[name].body if isinstance(one, (ast.Import, ast.ImportFrom))]
        for given in _names(ast.Module(body=nodes, type_ignores=[])):
            inside = _of_library(trees, _called(given))
            if not inside:
                found.setdefault(given.partition(".")[0], name)
            parts = inside.split(".")
            left += [".".join(parts[:k]) for k in range(1, len(parts) + 1) if inside]
    return found


def _of_library(trees: Mapping[str, ast.Module], name: str) -> str:
    """The module that a dotted name is of, or is in; empty where it is none of the library."""
    while name and name not in trees:
        name = name.rpartition(".")[0]
    return name


def circles(graph: Mapping[str, Iterable[str]]) -> list[set[str]]:
    """The sets of nodes that reach one another, by Tarjan's algorithm."""
    number: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []
    found: list[set[str]] = []

    def visit(node: str) -> None:
        number[node] = lowest[node] = len(number)
        stack.append(node)
        for other in graph.get(node, ()):
            if other not in number:
                visit(other)
            if other in stack:
                lowest[node] = min(lowest[node], lowest[other])
        if lowest[node] == number[node]:
            place = stack.index(node)
            found.append(set(stack[place:]))
            del stack[place:]

    for node in graph:
        if node not in number:
            visit(node)
    return [circle for circle in found if len(circle) > 1]
