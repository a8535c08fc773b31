"""What commands print: tables on a terminal, plain lines where the output is piped."""

from __future__ import annotations

import sys
from collections.abc import Sequence


def fields(rows: Sequence[tuple[str, str]]) -> None:
    """Names and texts, one a line."""
    table(("", ""), rows, heads=False)


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], heads: bool = True) -> None:
    """Rows under column heads: a rich table on a terminal, aligned text elsewhere."""
    if not sys.stdout.isatty():
        _plain(columns, rows, heads)
        return
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    made = Table(show_header=heads, box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for index, column in enumerate(columns):
        made.add_column(column, style="bold" if index == 0 else None, no_wrap=index == 0)
    for row in rows:
        made.add_row(*(Text(cell) for cell in row))
    Console().print(made)


def line(text: str) -> None:
    """One line of output."""
    print(text)


def complain(sentence: str) -> None:
    """One sentence on stderr."""
    print(sentence, file=sys.stderr)


def _plain(columns: Sequence[str], rows: Sequence[Sequence[str]], heads: bool) -> None:
    shown = [tuple(columns), *rows] if heads else list(rows)
    widths = [max((len(row[i]) for row in shown), default=0) for i in range(len(columns))]
    for row in shown:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
