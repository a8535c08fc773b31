"""Output of commands: tables on a terminal, plain lines where the output is piped.

All output passes through here, and no control character of a name, a file or a folder reaches the terminal.
"""

from __future__ import annotations

import json as json_text
import logging
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from coadjoint.errors import printable
from coadjoint.log import PHASES

NAME = 16
"""The least width of names next to numbers."""


def fields(rows: Sequence[tuple[str, str]]) -> None:
    """Names and texts, one a line."""
    table(("", ""), rows, heads=False)


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], heads: bool = True) -> None:
    """Rows under column heads: a rich table on a terminal, aligned text elsewhere.

    Numbers are never shortened: names next to them are wrapped, and the table exceeds the terminal if necessary.
    """
    columns, rows = _cells(columns), [_cells(row) for row in rows]
    if not sys.stdout.isatty():
        _plain(columns, rows, heads)
        return
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    made = Table(show_header=heads, box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    numbers = {i: max(len(row[i]) for row in rows) for i in range(len(columns)) if rows and _numbers(rows, i)}
    for index, column in enumerate(columns):
        unbroken = index in numbers or (index == 0 and not numbers)
        least = max(numbers[index], len(column)) if index in numbers else NAME if numbers and index == 0 else None
        made.add_column(
            Text(column), style="bold" if index == 0 else None, no_wrap=unbroken, min_width=least, overflow="fold"
        )
    for row in rows:
        made.add_row(*(Text(cell) for cell in row))
    console = Console()
    needed = sum(max(width, len(columns[i])) for i, width in numbers.items()) + NAME + 3 * len(columns)
    (Console(width=needed) if numbers and needed > console.width else console).print(made)


def _numbers(rows: Sequence[Sequence[str]], column: int) -> bool:
    """Whether a column holds numbers alone."""
    try:
        for row in rows:
            float(row[column])
    except ValueError:
        return False
    return True


def line(text: str) -> None:
    """One line of output, or several."""
    print(printable(text))


def text(content: str) -> None:
    """A text that ends its own lines."""
    print(printable(content), end="")


def json(found: object, indent: int | None = 2) -> None:
    """JSON, in which control characters are escapes."""
    print(printable(json_text.dumps(found, indent=indent, ensure_ascii=False)))


def complain(sentence: str) -> None:
    """One sentence on stderr."""
    print(printable(sentence), file=sys.stderr)


class _Lines(logging.Handler):
    """Writes log messages as lines on stderr, each once: a command that goes through many runs says more elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self._written: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage()
        if text not in self._written:
            self._written.add(text)
            print(text, file=sys.stderr, flush=True)


@contextmanager
def phases(wanted: bool = True) -> Iterator[None]:
    """Inside this context, if `wanted`, show each phase of a command on stderr once, on a line."""
    if not wanted:
        yield
        return
    lines, level = _Lines(), PHASES.level
    PHASES.addHandler(lines)
    PHASES.setLevel(logging.DEBUG)
    try:
        yield
    finally:
        PHASES.removeHandler(lines)
        PHASES.setLevel(level)


@contextmanager
def warned() -> Iterator[None]:
    """Inside this context, print warnings as sentences."""
    usual = warnings.formatwarning

    def sentence(message: Any, category: type[Warning], *place: Any, **more: Any) -> str:
        ours = issubclass(category, UserWarning)
        return printable(f"Warning: {message}\n" if ours else usual(message, category, *place, **more))

    warnings.formatwarning = sentence
    try:
        yield
    finally:
        warnings.formatwarning = usual


def _cells(row: Sequence[str]) -> tuple[str, ...]:
    return tuple(printable(cell).replace("\n", " ") for cell in row)


def _plain(columns: Sequence[str], rows: Sequence[Sequence[str]], heads: bool) -> None:
    shown = [tuple(columns), *rows] if heads else list(rows)
    widths = [max((len(row[i]) for row in shown), default=0) for i in range(len(columns))]
    for row in shown:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
