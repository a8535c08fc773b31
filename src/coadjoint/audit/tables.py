"""An audit as a table, as a page and as JSON."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coadjoint.audit.findings import Audit, Cell, Finding
from coadjoint.texts import Table

COLUMNS = (
    "method",
    "map",
    "order",
    "measured",
    "symplectic",
    "reversible",
    "momentum",
    "energy band",
    "drift",
    "gap",
    "shown",
)
OVER_MAPS = tuple("maps" if head == "map" else head for head in COLUMNS)
"""Heads of a table that has a row for all maps of a method."""


def rows(audit: Audit, *, by_map: bool = True) -> list[tuple[str, ...]]:
    """A row for each method, and map that it takes: the worst measurement over all systems.

    by_map: whether each map has its row; otherwise all maps of a method share one, with their number.
    """
    found: dict[tuple[str, str], list[Cell]] = {}
    for cell in audit.cells:
        if not cell.refusal:
            found.setdefault((cell.method, cell.map if by_map else ""), []).append(cell)
    return [_row(method, cells) for (method, _), cells in found.items()]


def _row(method: str, cells: Sequence[Cell]) -> tuple[str, ...]:
    def of(claim: str) -> list[Finding]:
        return [finding for cell in cells for finding in cell.findings if finding.claim == claim]

    orders = [finding.measured for finding in of("order") if finding.claimed == cells[0].order]
    asked = [cell for cell in cells if any(finding.claim == "energy" for finding in cell.findings)]
    long_runs = [cell.long_run for cell in asked if cell.long_run is not None]
    exact = any(finding.claimed == "exact" for finding in of("energy"))
    maps = list(dict.fromkeys(cell.map for cell in cells))
    return (
        method,
        maps[0] if len(maps) == 1 else str(len(maps)),
        str(cells[0].order),
        _span(orders),
        *(_worst([found.measured for found in of(claim)]) for claim in ("symplectic", "symmetric", "momentum")),
        _worst([run.band for run in long_runs]),
        "exact" if exact else _worst([found.measured for found in of("energy")], "{:.2f}"),
        _worst([found.measured for found in of("constraints")]),
        "yes" if all(cell.shown for cell in cells) else "NO",
    )


def _span(values: Sequence[float]) -> str:
    values = [value for value in values if np.isfinite(value)]
    if not values:
        return "–"
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low}–{high}"


def _worst(values: Sequence[float], form: str = "{:.0e}") -> str:
    return form.format(max(values)) if values else "–"


def markdown(heads: Sequence[str], table: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in table)])


def summary(audit: Audit) -> Table:
    """Everything that was measured, as plain values."""
    return {
        "passed": audit.passed,
        "failures": audit.failures,
        "seconds": audit.seconds,
        "cells": [_cell(cell) for cell in audit.cells],
    }


def _cell(cell: Cell) -> dict[str, object]:
    found: Table = {
        "method": cell.method,
        "map": cell.map,
        "system": cell.system,
        "refusal": cell.refusal,
        "shown": cell.shown,
        "findings": [
            {
                "claim": finding.claim,
                "claimed": finding.claimed,
                "measured": finding.measured,
                "allowed": finding.allowed,
                "shown": finding.shown,
                "failure": finding.failure,
            }
            for finding in cell.findings
        ],
    }
    if cell.convergence is not None:
        h, error, fitted, order = cell.convergence
        found["convergence"] = {"h": h, "error": error, "fitted": fitted, "order": order}
    if cell.long_run is not None:
        run = cell.long_run
        found["long_run"] = {
            "duration": float(run.times[-1] - run.times[0]), "energy_band": run.band, "energy_drift": run.drift,
        }  # fmt: skip
    return found
