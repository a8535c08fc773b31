"""Which public name is described where: the blocks ```{api} PACKAGE``` of the pages in docs/api.

A block stands for the names in it, or, if it is empty, for all public names of the package that no other block has.
`documented` is that list; a test compares it with what is public.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

BLOCK = re.compile(r"^```\{api\} ([\w.]+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def package_of(name: str) -> Any:
    """The package of this name, be it a folder or one that `coadjoint` calls so, as `coadjoint.attitude`."""
    first, *others = name.split(".")
    found: Any = import_module(first)
    for i, other in enumerate(others, 2):
        found = getattr(found, other, None) or import_module(".".join(name.split(".")[:i]))
    return found


def public_names(package: str) -> list[str]:
    """What a package lists as public; of a module without a list, what is defined in it."""
    module = package_of(package)
    listed = getattr(module, "__all__", None)
    if listed is not None:
        return sorted(name for name in listed if not isinstance(getattr(module, name), ModuleType))
    own = [
        n for n, v in vars(module).items() if not n.startswith("_") and getattr(v, "__module__", "") == module.__name__
    ]
    return sorted(own)


def blocks(folder: Path) -> Iterator[tuple[str, list[str], str]]:
    """(package, names, page) of every block in a folder of pages."""
    for page in sorted(folder.glob("*.md")):
        for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
            yield block[1], block[2].split(), page.stem


def documented(folder: Path) -> dict[str, Any]:
    """Every name of the reference, as `coadjoint.control.Problem`, with what it is."""
    found: dict[str, Any] = {}
    for package, names, _ in blocks(folder):
        found.update({f"{package}.{name}": getattr(package_of(package), name) for name in names})
    for package, names, _ in blocks(folder):
        if not names:
            found.update(rest(package, found))
    return found


def rest(package: str, found: dict[str, Any]) -> dict[str, Any]:
    """The public names of a package that are not there yet."""
    known = {id(value) for value in found.values()}
    module = package_of(package)
    return {f"{package}.{n}": getattr(module, n) for n in public_names(package) if id(getattr(module, n)) not in known}
