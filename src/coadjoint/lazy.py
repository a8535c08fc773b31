"""Packages whose names are loaded when first used: the imports under `if TYPE_CHECKING:` are the list of them."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any, NamedTuple

from coadjoint.collector import collector_off
from coadjoint.deprecation import announce
from coadjoint.errors import nearest


class Lazy(NamedTuple):
    """The `__getattr__`, `__dir__` and `__all__` of a package."""

    getattr: Callable[[str], Any]
    dir: Callable[[], list[str]]
    all: list[str]


def lazy(
    package: str, moved: Mapping[str, str] | None = None, added: Callable[[str], ModuleType | None] | None = None
) -> Lazy:
    """The names that `package` imports under `if TYPE_CHECKING:`, each loaded at its first use.

    Editors and type checkers follow the imports; at run time nothing is loaded before it is used. A package calls this
    under `if not TYPE_CHECKING:`, because type checkers take any name for one of a module that has a `__getattr__`.

    moved: names that are listed elsewhere, separated by spaces, by the package below this one that lists them. They are
    loaded with a DeprecationWarning, and `dir` and `__all__` leave them out. added: gives packages that other
    distributions add under a name, None for other names.
    """
    places = homes(package)
    names = sorted(places)
    now = {name: home for home, words in (moved or {}).items() for name in words.split()}

    def load(name: str) -> Any:
        if name in now:
            there = f"{package}.{now[name]}"
            announce(f"{package}.{name}", f"{there}.{name}", "0.3", 2)
            return getattr(import_module(there), name)
        if name not in places:
            if added is not None and not name.startswith("_") and (found := added(name)) is not None:
                return found
            if name.startswith("_"):  # as tools ask for, which look at all objects of a module
                raise AttributeError(f"{package} has no `{name}`.")
            raise AttributeError(_absent(package, name, [*names, *now]))
        module, there = places[name]
        with collector_off():
            if module == package:
                return import_module(f"{package}.{there}")
            home = import_module(module)
            value = getattr(home, there) if hasattr(home, there) else import_module(f"{module}.{there}")
        setattr(import_module(package), name, value)
        return value

    return Lazy(load, lambda: names, names)


def _absent(package: str, name: str, names: list[str]) -> str:
    near = nearest(name, names)
    return f"{package} has no `{name}`; " + (f"did you mean `{near}`?" if near else f"it has: {', '.join(names)}.")


def homes(package: str) -> dict[str, tuple[str, str]]:
    """Module and name of every import under `if TYPE_CHECKING:`, by the name that it is given.

    Of a package without such a block, of every import at the top of its file.
    """
    spec = find_spec(package)
    source = spec.loader.get_source(package) if spec is not None and spec.loader is not None else None  # pyright: ignore[reportAttributeAccessIssue]
    if source is None:
        raise ImportError(f"The source of {package} is needed, because its names are listed there.")
    body = ast.parse(source).body
    blocks = [node.body for node in body if isinstance(node, ast.If)] or [body]
    imports = [line for block in blocks for line in block if isinstance(line, ast.ImportFrom)]
    return {alias.asname or alias.name: (str(line.module), alias.name) for line in imports for alias in line.names}
