"""Additions of packages above to one below: models of the catalogue, figures, formats of files, kinds of run files.

A package declares a `Registry` of one kind. A module that is named in `coadjoint.EXTENSIONS`, or by an installed
package as an entry point of the group `coadjoint`, adds to it by a table of that kind, such as
`MODELS = {"remus_100": CatalogueEntry(…)}`; the package does not know the modules that add to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache, cached_property
from importlib import import_module
from types import ModuleType
from typing import Any, TypeVar

from coadjoint.collector import collector_off
from coadjoint.errors import ArgumentError, error_line, nearest, printable, shown

T = TypeVar("T")

GROUP = "coadjoint"
"""The group of entry points of packages that add to the library."""


class UnknownEntryError(ArgumentError, KeyError):
    """A name that is not in a table."""

    def __str__(self) -> str:
        return printable(str(self.args[0]))  # KeyError would put it in quotes


class Registry(Mapping[str, T]):
    """Entries by name: the package's own, then those of extensions, which are loaded when it is first read.

    kind: the name of the tables in extensions. Raises ArgumentError where a name is given twice, and for
    one that is not there.
    """

    def __init__(self, kind: str, own: Mapping[str, T] | None = None):
        self.kind, self._own = kind, dict(own or {})

    @cached_property
    def _entries(self) -> dict[str, T]:
        found = dict(self._own)
        for module in extensions():
            for name, entry in getattr(_loaded(module), self.kind, {}).items():
                if name in found:
                    raise ArgumentError(f"{module} adds `{name}` to {self.kind}, which exists already.")
                found[name] = entry
        return found

    def __getitem__(self, name: str) -> T:
        if name not in self._entries:
            near = nearest(name, self._entries)
            hint = f"did you mean `{near}`?" if near else f"it has {', '.join(sorted(self._entries))}."
            raise UnknownEntryError(f"The table {self.kind} has no entry {shown(name)}: {hint}")
        return self._entries[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)


def extensions() -> list[str]:
    """The modules in `coadjoint.EXTENSIONS`, and those that installed packages name, each once."""
    import coadjoint

    return list(dict.fromkeys([*coadjoint.EXTENSIONS, *sorted(module for _, module in _installed())]))


def added(name: str) -> ModuleType | None:
    """The package that an entry point of this name adds to `coadjoint`; None where there is none.

    Raises AttributeError for the vehicles where they are not installed.
    """
    for named, module in _installed():
        if named == name:
            return import_module(module.partition(".")[0])
    if name == "vehicles":
        raise AttributeError(absent("`coadjoint.vehicles`"))
    return None


def absent(what: str) -> str:
    """The sentence on something that is of the vehicles, which are not installed."""
    return f"{what} is of the distribution coadjoint-vehicles, which is not installed: pip install coadjoint-vehicles."


@cache
def _installed() -> tuple[tuple[str, str], ...]:
    """The entry points of installed packages, name and module: a search of all packages, made once."""
    from importlib.metadata import entry_points

    return tuple((point.name, point.value) for point in entry_points(group=GROUP))


def _loaded(module: str) -> ModuleType:
    try:
        with collector_off():
            return import_module(module)
    except Exception as error:
        raise ArgumentError(
            f"The extension {module} cannot be imported ({error_line(error)}): install its package again, or remove it."
        ) from error


def import_string(place: str) -> Any:
    """The object at "module:name", imported now."""
    module, _, name = place.partition(":")
    with collector_off():
        return getattr(import_module(module), name)
