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
import rows_phase_space
import rows_poisson
import rows_products
import rows_right
import rows_schemes
import rows_sections
import rows_semidirect
import rows_vehicle
from theorem_mutations import detected, mutations
from theorem_row import Row

PAGE = Path(__file__).parents[2] / "docs" / "theorems.md"

P = [*rows_continuous.ROWS, *rows_maps.ROWS, *rows_discrete.ROWS, *rows_vehicle.ROWS, *rows_schemes.ROWS]
B = [*rows_products.ROWS, *rows_semidirect.ROWS, *rows_poisson.ROWS, *rows_bundles.ROWS, *rows_sections.ROWS]
L = [*rows_links.ROWS, *rows_right.ROWS, *rows_large_groups.ROWS]
C = rows_constraints.ROWS
D = rows_phase_space.ROWS
ROWS = [*P, *B, *L, *C, *D]

HEAD = """# Theorems of both papers

After this page you can find the function, the test and the residual of every theorem, definition, displayed algorithm
and numbered equation of the papers that [errata](errata.md) names. Names of functions begin with `coadjoint.`.

The residual is that of the corrected statement, relative to its largest term, over random systems with fixed seeds:
several noncommutative groups and kinds of spaces, Lagrangians that are not quadratic, bundles with two shapes. The
functions are compared with matrices and derivatives of the action at states and sequences that solve nothing,
algorithms by the stationarity of the action along their results.

*Holds for* names the systems. Q and V\\* are *flat* where G acts by representations or affine maps, *curved* as
`Sphere`, `Submanifold` and `GroupItself`, and *smooth* where G acts by [any smooth
action](groups_and_spaces.md#smooth-actions), `Action`; *every* is all three. Rows of (P1)–(P52) are measured with
Möbius maps of the half plane for Q and V\\*, too. Methods hold for fewer: their tables say which.

Every function of a row is mutated: the sign of its value, zero, a factor 1.001, the transpose, the identity. A mutation
is detected if the residual exceeds the row's bound (at most 1e-11); an exception does not count.
"""

TAIL = """`PYTHONPATH=tests python tests/theory/theorem_table.py` writes this page, and tests repeat its measurements.
On a run of your own `printed_equations` measures the discrete equations:

```python
import coadjoint as co

entry = co.models.catalogue["underwater_vehicle"]
vehicle = entry.make()
run = co.simulate(vehicle, entry.start(vehicle), dt=0.01, steps=100)
print(co.theory.printed_equations(run).worst)
```
"""


LARGE = """## L: chains, right-invariant systems and large groups

The same statements on `co.Power(G, N)`, with `invariance="right"`, and on U(n), SU(n) and SO(n) that form no basis.
Chains are compared with the block matrices of G × … × G, right-invariant systems with derivatives of L along
(1 + εη̂)g, large groups with their matrices. B1–B17 apply to the product of a link, not to one of `co.Power`.

Isospectral steps have no additional dynamics, forces or discrete Lagrangian: Theorems 1, 2, 6 and 7 apply to them. With
Θ no momentum is kept, but all Casimir functions are. On `co.SUn` no g is carried, because Cayley's map leaves
the group.
"""


HELD = """## C: constraints

Theorems 2, 6 and 7 with reactions, see [constraints](constraints.md): on SO(3), SE(2) and SL(2) with masses that
depend on the place and two random constraints, steps with random unknowns; the two-form on steps that are solved.
"""


FIRST_ORDER = """## D: Lagrangians that are linear in the velocities

Motion and steps of [phase-space Lagrangians](hamiltonian.md#phase-space-lagrangians) on SO(3) with Q and V\\* that
turn, and on the plane; the two-form on a step that is solved.
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
        functions, tests = ", ".join(f"`{name}`" for name in row.functions), ", ".join(links(row))
        mutated = f"{self.detected} of {self.tried}"
        said = f"| {row.number} | {row.statement} | {row.domain} | {functions} | {tests} |"
        return f"{said} {self.residual:.0e} | {mutated} |"


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


def links(row: Row) -> list[str]:
    """The files of the row's tests, each once."""
    files = dict.fromkeys(test.split("::")[0] for test in row.tests)
    return [f"[{Path(file).stem}](../tests/{file})" for file in files]


def table(rows: list[Measured]) -> str:
    names = ["", "Statement", "Holds for", "Computed by", "Tested by", "Residual", "Mutations detected"]
    head = ["| " + " | ".join(names).lstrip() + " |", "|---" * len(names) + "|"]
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
    ends = np.cumsum([0, len(P), len(B), len(L), len(C), len(D)])
    first, second, third, fourth, fifth = (rows[a:b] for a, b in pairwise(ends))
    titles = "## P: advected parameters and additional dynamics", "## B: semidirect products and principal bundles"
    head = [HEAD.rstrip() + "\n" + counts(rows), TAIL.rstrip()]
    papers = titles[0], table(first), titles[1], table(second)
    more = (LARGE, third), (HELD, fourth), (FIRST_ORDER, fifth)
    return "\n\n".join([*head, *papers, *(part for text, rows in more for part in (text.rstrip(), table(rows)))]) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
