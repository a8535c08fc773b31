"""Writes docs/theorems.md: every theorem, definition and displayed algorithm of both papers, with its residual.

Run as: PYTHONPATH=tests python tests/theory/theorem_table.py — it measures every row, and every mutation of every
function that a row names, which takes some minutes.
"""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rows_bundles
import rows_constraints
import rows_continuous
import rows_discrete
import rows_large_groups
import rows_links
import rows_maps
import rows_poisson
import rows_products
import rows_right
import rows_schemes
import rows_semidirect
import rows_vehicle
from theorem_mutations import detected, mutations
from theorem_row import Row

PAGE = Path(__file__).parents[2] / "docs" / "theorems.md"

P = [*rows_continuous.ROWS, *rows_maps.ROWS, *rows_discrete.ROWS, *rows_vehicle.ROWS, *rows_schemes.ROWS]
B = [*rows_products.ROWS, *rows_semidirect.ROWS, *rows_poisson.ROWS, *rows_bundles.ROWS]
L = [*rows_links.ROWS, *rows_right.ROWS, *rows_large_groups.ROWS]
C = rows_constraints.ROWS
ROWS = [*P, *B, *L, *C]

HEAD = """# Theorems of both papers

A row for every numbered theorem, definition and displayed algorithm of the papers that [errata](errata.md) names, and
for the numbered equations between them. Functions stand under `coadjoint.`, tests under `tests/`.
Where print and library differ, [errata](errata.md) says why.

The residual is that of the corrected statement, relative to the largest term in it, over random systems with fixed
seeds: several groups that do not commute, Lagrangians that are not quadratic in the velocities, spaces of several
kinds, bundles with two shapes and random connections. The functions of the row are compared with the same quantity
from matrices and derivatives of the action alone, at states and sequences that solve nothing, so that a wrong value
has nothing to vanish with; algorithms by the stationarity of the action along what they return.

A residual is worth as much as the errors it would see. So every function of a row is mutated where the library uses
it: the sign of its value, zero, a factor 1.001, the transpose of a matrix or of a linear map, the identity. A mutation
is detected when the residual rises above the row's bound (at most 1e-11); an exception does not count.
"""

TAIL = """This page is written by `PYTHONPATH=tests python tests/theory/theorem_table.py`.
Tests import every function, look for every test, measure every residual and try every mutation anew, and see that no
number is left out.
`coadjoint.theory.printed_equations(run)` measures the discrete equations on a run of your own.
"""


LARGE = """## L: chains, right-invariant systems and large groups

The same statements on `co.Power(G, N)`, with `invariance="right"`, and on U(n), SU(n) and SO(n) that form no basis.
Chains are compared with the block matrices of G × … × G, right-invariant systems with derivatives of L along
(1 + εη̂)g, large groups with their matrices. Not for `co.Power`: a semidirect product of it (B1–B17), whose elements
would have one matrix; the product is then that of a link. Isospectral steps have neither additional dynamics nor
forces nor a discrete Lagrangian of their own: Theorems 1, 2, 6 and 7 apply to them, those of reduction and of bundles
do not; with Θ no momentum is kept, but all Casimir functions are. On `co.SUn` Cayley's map leaves the group, so that
no g is carried there.
"""


HELD = """## C: constraints

Theorems 2, 6 and 7 with reactions, see [constraints](constraints.md): on SO(3), SE(2) and SL(2) with masses that
depend on the place and two random constraints, steps with random unknowns; the two-form on steps that are solved.
"""


class Measured(NamedTuple):
    """A row with its residual, its mutations, and which of those that are not equivalent were not detected."""

    row: Row
    residual: float
    tried: int
    survived: list[tuple[str, str]]

    @property
    def detected(self) -> int:
        """How many mutations raised the residual above the bound."""
        return self.tried - len(self.row.equivalent) - len(self.survived)

    def line(self) -> str:
        """The row as the page has it."""
        row = self.row
        functions, tests = ", ".join(f"`{name}`" for name in row.functions), ", ".join(map(link, row.tests))
        mutated = f"{self.detected} of {self.tried}"
        return f"| {row.number} | {row.statement} | {functions} | {tests} | {self.residual:.0e} | {mutated} |"


def measure(index: int) -> tuple[float, int, list[tuple[str, str]]]:
    """The residual of a row, the number of its mutations, and those that are neither detected nor equivalent."""
    row = ROWS[index]
    residual, tried = row.residual(), mutations(row)
    survived = [one for one in tried if one not in row.equivalent and not detected(row, *one)]
    return residual, len(tried), survived


def measured() -> list[Measured]:
    """All rows, several at a time."""
    workers = int(os.environ.get("WORKERS", os.cpu_count() or 1))
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        return [Measured(row, *found) for row, found in zip(ROWS, pool.map(measure, range(len(ROWS))), strict=True)]


def link(test: str) -> str:
    """A test as its name in words that leads to its file."""
    file, name = test.split("::")
    return f"[{name.removeprefix('test_').replace('_', ' ')}](../tests/{file})"


def table(rows: list[Measured]) -> str:
    head = ["| | Statement | Computed by | Tested by | Residual | Mutations detected |", "|---|---|---|---|---|---|"]
    return "\n".join([*head, *(measured.line() for measured in rows)])


def counts(rows: list[Measured]) -> str:
    """How many mutations there are, and what became of them."""
    tried = sum(row.tried for row in rows)
    found = sum(row.detected for row in rows)
    functions = {name for row in rows for name in row.row.functions}
    equal = [(row.row.number, *key, why) for row in rows for key, why in row.row.equivalent.items()]
    lines = [
        f"Mutations of {len(functions)} functions in {len(rows)} rows: {tried} generated, {found} detected, "
        f"{len(equal)} equivalent.",
        *(f"Equivalent in {number}: `{name}`, {kind}. {why}" for number, name, kind, why in equal),
    ]
    survived = [f"{row.row.number}: {tried}" for row in rows for tried in row.survived]
    assert not survived, f"not detected: {survived}"
    return "\n".join(lines)


def page() -> str:
    rows = measured()
    ends = np.cumsum([0, len(P), len(B), len(L), len(C)])
    first, second, third, fourth = (rows[a:b] for a, b in pairwise(ends))
    titles = "## P: advected parameters and additional dynamics", "## B: semidirect products and principal bundles"
    head = [HEAD.rstrip() + "\n" + counts(rows), TAIL.rstrip()]
    papers = titles[0], table(first), titles[1], table(second)
    return "\n\n".join([*head, *papers, LARGE.rstrip(), table(third), HELD.rstrip(), table(fourth)]) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
