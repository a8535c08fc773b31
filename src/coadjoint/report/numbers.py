"""The sources of the numbers of a run: its run file, the catalogue, and packages above, such as vehicles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from coadjoint.extensions import Registry, import_string
from coadjoint.models import catalogue
from coadjoint.report.folder import RUN_FILE
from coadjoint.texts import read_table, text_of


class Sourced(NamedTuple):
    """A number: its name, value, unit, source, and a note."""

    name: str
    value: str
    unit: str
    source: str
    note: str = ""


NUMBERS: Registry[str] = Registry("NUMBERS")
"""By the section of a run file that has them: "module:function", (the run file, its table) → Sourced numbers."""


def numbers(folder: Path) -> dict[str, list[Sourced]]:
    """The numbers of the run in a folder, by source; raises FileError, ArgumentError."""
    file = folder / RUN_FILE
    table = read_table(text_of(file), file)
    found = {f"of the run file, {RUN_FILE}": list(_given(table))}
    model = str(table.get("system", {}).get("model", ""))
    if model in catalogue:
        found[f"of the catalogue's model {model}"] = list(_defaults(model, table))
    for section, place in NUMBERS.items():
        if section in table:
            found |= import_string(place)(file, table)
    return {title: rows for title, rows in found.items() if rows}


def _given(table: Mapping[str, object], prefix: str = "") -> Iterator[Sourced]:
    """The numbers in a run file, under its keys; units are at the ends of keys."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _given(value, f"{prefix}{key}.")
        else:
            yield Sourced(prefix + key, shown(value), "", RUN_FILE)


def _defaults(model: str, table: Mapping[str, Any]) -> Iterator[Sourced]:
    """The numbers of the catalogue that the run file does not set."""
    entry = catalogue[model]
    for section, held in (("parameters", entry.parameters), ("initial", entry.initial)):
        given = [str(key) for key in table.get(section, {})]
        for name, value in held.items():
            if not any(key == name or key.startswith(f"{name}_") for key in given):
                yield Sourced(f"{section}.{name}", shown(value), "", f'coadjoint.models.catalogue["{model}"]')


def shown(value: Any) -> str:
    """A value as text: numbers with up to ten digits."""
    if isinstance(value, bool) or value is None:
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(shown, value)) + "]"
    if hasattr(value, "tolist"):
        return shown(value.tolist())
    return f"{value:.10g}" if isinstance(value, float) else str(value)
