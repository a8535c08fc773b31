"""The catalogue of models as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from coadjoint import checks
from coadjoint.runs.toml_text import to_toml
from coadjoint.sections import rows
from coadjoint.texts import Table

if TYPE_CHECKING:
    from coadjoint.models import CatalogueEntry


def descriptions() -> dict[str, str]:
    """Every model with its description."""
    from coadjoint.models import catalogue

    return {name: entry.description for name, entry in catalogue.items()}


def defaults(name: str) -> Table:
    """Description, parameters and initial values of a model; raises ArgumentError for an unknown name."""
    entry = _entry(name)
    return {"description": entry.description, "parameters": dict(entry.parameters), "initial": dict(entry.initial)}


def example(name: str) -> str:
    """A commented run file for a model, with its defaults written out; values without a default are comments."""
    entry = _entry(name)
    values = {"parameters": entry.parameters, "initial": entry.initial}
    table = {
        "system": {"model": name},
        **{part: {key: value for key, value in given.items() if value is not None} for part, given in values.items()},
        "method": {"name": entry.method, "map": "Cayley"},
        "run": {"dt": entry.dt, "duration": entry.duration, "save_every": 10},
    }
    lines, section = (
        [f"# {entry.description}", "# Run it by `coadjoint run FILE.toml`; `coadjoint keys` lists all keys.", ""],
        "",
    )
    for line in to_toml(table).splitlines():
        if line.startswith("["):
            section = line.strip("[]")
            line = f"{line}  # {SECTIONS[section]}"
        elif " = " in line:
            line = _commented(section, line)
        elif section in values:
            lines += _open(values[section])
        lines.append(line)
    return "\n".join([*lines, "", *_output()]) + "\n"


SECTIONS = {
    "system": 'what moves: a model of `coadjoint models`, or a factory, "file.py:function"',
    "parameters": "SI units, unless a key ends in its unit, as mass_g = 500",
    "initial": "the state at the start, SI units, unless a key ends in its unit, as euler_zyx_deg = [0, 0, 20]",
    "method": "the rule and its difference map",
    "run": "the grid in time",
}
"""The comments on sections."""


def _commented(section: str, line: str) -> str:
    """A line with the meaning and the unit of its key."""
    from coadjoint.runs.initial import KINDS
    from coadjoint.runs.sections import MethodSection, RunSection, SystemSection

    kinds = {"system": SystemSection, "method": MethodSection, "run": RunSection}
    key = line.partition(" = ")[0]
    if section in kinds:
        row = next(row for row in rows(kinds[section]) if row.key == key)
        return f"{line}  # {row.meaning}{f', {row.unit}' if row.unit else ''}"
    unit = KINDS[key].si if section == "initial" and key in KINDS else ""
    return f"{line}  # {unit}" if unit else line


def _open(given: Mapping[str, object]) -> list[str]:
    """Lines for the keys of a section that have no default."""
    names = [key for key, value in given.items() if value is None]
    return [f"# also: {', '.join(names)}"] if names else []


def _output() -> list[str]:
    """The section [output], which may be left out."""
    from coadjoint.runs.sections import OutputSection

    found = [row for row in rows(OutputSection) if row.key != "NAME"]
    return ["# [output]", *(f"# {row.key} = {row.default or '…'}  # {row.meaning}" for row in found)]


def _entry(name: str) -> CatalogueEntry:
    from coadjoint.models import catalogue

    checks.known(name, catalogue, "model", "The catalogue")
    return catalogue[name]
