"""Additions of packages above to one below: models of the catalogue, figures, formats of files, kinds of run files.

A package declares a `Registry` of one kind. A module named in `coadjoint.EXTENSIONS` adds to it by a table of that
kind, such as `MODELS = {"remus_100": CatalogueEntry(…)}`; the package does not know the modules that add to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib import import_module
from typing import Any, TypeVar

from coadjoint.errors import ArgumentError

T = TypeVar("T")


class Registry(Mapping[str, T]):
    """Entries by name: the package's own, then those of extensions, which are loaded when it is first read.

    kind: the name of the tables in extensions. Raises ArgumentError where a name is given twice.
    """

    def __init__(self, kind: str, own: Mapping[str, T] | None = None):
        self.kind, self._own = kind, dict(own or {})

    @cached_property
    def _entries(self) -> dict[str, T]:
        import coadjoint

        found = dict(self._own)
        for module in coadjoint.EXTENSIONS:
            for name, entry in getattr(import_module(module), self.kind, {}).items():
                if name in found:
                    raise ArgumentError(f"{module} adds `{name}` to {self.kind}, which exists already.")
                found[name] = entry
        return found

    def __getitem__(self, name: str) -> T:
        return self._entries[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)


def import_string(place: str) -> Any:
    """The object at "module:name", imported now."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)
