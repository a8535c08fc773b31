"""The block triangular order of a system: which unknowns can be solved for before which others."""

from __future__ import annotations

from collections.abc import Sequence


def matching(columns: Sequence[Sequence[int]]) -> list[int] | None:
    """A row for every unknown that holds it, or None; `columns[i]` are the unknowns of row i."""
    row_of: dict[int, int] = {}

    def place(row: int, tried: set[int]) -> bool:
        # The diagonal first: it is the natural pivot of a discrete Legendre transform.
        for j in sorted(columns[row], key=lambda j: j != row):
            if j in tried:
                continue
            tried.add(j)
            if j not in row_of or place(row_of[j], tried):
                row_of[j] = row
                return True
        return False

    if not all(place(row, set()) for row in range(len(columns))):
        return None
    return [row_of[j] for j in range(len(columns))]


def blocks(columns: Sequence[Sequence[int]]) -> list[list[int]]:
    """Strongly coupled sets of unknowns, those first that the later ones need (Tarjan).

    `columns[i]` are the unknowns in the row of unknown i.
    """
    index: dict[int, int] = {}
    low: dict[int, int] = {}
    stack: list[int] = []
    found: list[list[int]] = []

    def visit(i: int) -> None:
        index[i] = low[i] = len(index)
        stack.append(i)
        for j in columns[i]:
            if j not in index:
                visit(j)
                low[i] = min(low[i], low[j])
            elif j in stack:
                low[i] = min(low[i], index[j])
        if low[i] == index[i]:
            start = stack.index(i)
            found.append(sorted(stack[start:]))
            del stack[start:]

    for i in range(len(columns)):
        if i not in index:
            visit(i)
    return found
