"""What an object is, its sizes and its numbers with their units: one line as text, a table in notebooks."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any, NamedTuple

import numpy as np

from coadjoint.errors import must_give, printable

MOST = 9
"""The most numbers of an array that a table shows, and the most names in one line."""


class NumberRow(NamedTuple):
    """A number or an array under its name, with its unit, "" if it has none or it is unknown."""

    name: str
    value: Any
    unit: str = ""


class Overview(NamedTuple):
    """The title of an object, facts under their names, and its numbers under a heading."""

    title: str
    facts: Mapping[str, object]
    numbers: tuple[NumberRow, ...] = ()
    heading: str = "parameter"


class WithOverview:
    """An object that prints as one line, and shows as a table in notebooks, by its `_overview`."""

    def _overview(self) -> Overview:
        must_give(self, "_overview")

    def __repr__(self) -> str:
        title, facts, numbers, heading = self._overview()
        parts = [f"{name} {value}" for name, value in facts.items() if _said(value)]
        if numbers:
            sized = [f"{one.name}{f' {shape}' if (shape := np.shape(one.value)) else ''}" for one in numbers[:MOST]]
            parts.append(f"{heading}s {', '.join(sized)}{f' and {len(numbers) - MOST} more' * (len(numbers) > MOST)}")
        return printable(f"<{title}: {'; '.join(parts)}>" if parts else f"<{title}>")

    def _repr_html_(self) -> str:
        title, facts, numbers, heading = self._overview()
        top = "".join(_row("", (name, str(value))) for name, value in facts.items() if _said(value))
        rows = "".join(_row("", (one.name, value_text(one.value), one.unit)) for one in numbers)
        below = f"<table><thead>{_row('col', (heading, 'value', 'unit'))}</thead>{rows}</table>" if numbers else ""
        return f"<b>{escape(printable(title))}</b><table>{top}</table>{below}"


def _said(value: object) -> bool:
    return value is not None and value != "" and value != ()


def _row(scope: str, cells: tuple[str, ...]) -> str:
    kind, more = ("th", f' scope="{scope}"') if scope else ("td", "")
    style = ' style="text-align:left"'
    return f"<tr>{''.join(f'<{kind}{more}{style}>{escape(printable(cell))}</{kind}>' for cell in cells)}</tr>"


def value_text(value: Any) -> str:
    """A number or a short array with six digits; of others the shape."""
    try:
        array = np.asarray(value, dtype=float)
    except Exception:  # a tracer of JAX, or values of members
        shape = np.shape(value) if hasattr(value, "shape") else ()
        return f"array of {' × '.join(map(str, shape))}" if shape else str(value)
    if array.size > MOST:
        return f"array of {' × '.join(map(str, array.shape))}"
    return _nested(array.tolist())


def _nested(value: Any) -> str:
    return f"[{', '.join(map(_nested, value))}]" if isinstance(value, list) else f"{value:.6g}"


def listed(names: Any) -> str:
    """Names, separated by commas."""
    return ", ".join(map(str, names))
