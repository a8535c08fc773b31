"""Packages whose names are loaded when first used: the imports under `if TYPE_CHECKING:` are the list of them."""

from __future__ import annotations

import ast
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import Any, NamedTuple


class Lazy(NamedTuple):
    """The `__getattr__`, `__dir__` and `__all__` of a package."""

    getattr: Callable[[str], Any]
    dir: Callable[[], list[str]]
    all: list[str]


def lazy(package: str) -> Lazy:
    """The names that `package` imports under `if TYPE_CHECKING:`, each loaded at its first use.

    Editors and type checkers follow the imports; at run time nothing is loaded before it is used.
    """
    places = homes(package)
    names = sorted(places)

    def load(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"{package} has no `{name}`; it has: {', '.join(names)}.")
        module, there = places[name]
        if module == package:
            return import_module(f"{package}.{there}")
        home = import_module(module)
        value = getattr(home, there) if hasattr(home, there) else import_module(f"{module}.{there}")
        setattr(import_module(package), name, value)
        return value

    return Lazy(load, lambda: names, names)


def homes(package: str) -> dict[str, tuple[str, str]]:
    """Module and name of every import under `if TYPE_CHECKING:`, by the name that it is given."""
    spec = find_spec(package)
    source = spec.loader.get_source(package) if spec is not None and spec.loader is not None else None  # pyright: ignore[reportAttributeAccessIssue]
    if source is None:
        raise ImportError(f"The source of {package} is needed, because its names are listed there.")
    blocks = [node.body for node in ast.parse(source).body if isinstance(node, ast.If)]
    imports = [line for block in blocks for line in block if isinstance(line, ast.ImportFrom)]
    return {alias.asname or alias.name: (str(line.module), alias.name) for line in imports for alias in line.names}
