"""The catalogue of models as text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint import checks
from coadjoint.runs.toml_text import to_toml
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
    """A run file for a model, with its defaults written out; values without a default are comments."""
    entry = _entry(name)
    table = {
        "system": {"model": name},
        "parameters": {key: value for key, value in entry.parameters.items() if value is not None},
        "initial": {key: value for key, value in entry.initial.items() if value is not None},
        "method": {"name": entry.method, "map": "Cayley"},
        "run": {"dt": entry.dt, "duration": entry.duration, "save_every": 10},
    }
    open_keys = {part: [k for k, v in getattr(entry, part).items() if v is None] for part in ("parameters", "initial")}
    notes = [f"# [{part}] also takes {', '.join(keys)}." for part, keys in open_keys.items() if keys]
    return "\n".join([f"# {entry.description}", *notes]) + "\n\n" + to_toml(table)


def _entry(name: str) -> CatalogueEntry:
    from coadjoint.models import catalogue

    checks.known(name, catalogue, "model", "The catalogue")
    return catalogue[name]
