"""The table of theorems names functions and tests that exist, leaves no number out, and quotes residuals that hold."""

from __future__ import annotations

import importlib
import re
from functools import reduce
from pathlib import Path

import pytest
import theorem_table as table

ROOT = Path(__file__).parents[2]
ROWS = [*table.P, *table.B]
THEOREMS = [f"Theorem {n}" for n in (1, 2, 6, 7)] + [f"Definition {n}" for n in (3, 4, 5)]
THEOREMS += ["Lemma 8", "Remark 9", "Lemma 10", *(f"Theorem {n}" for n in ("3.1", "3.2", "4.1", "5.1", "6.1", "6.2"))]
ROUND_OFF = 5e-13


def numbers(rows, paper):
    """Every equation number that the rows cover."""
    found = []
    for row in rows:
        if row.number.startswith("after"):
            continue
        for first, last in re.findall(rf"\({paper}(\d+)\)(?:–\({paper}(\d+)\))?", row.number):
            found += range(int(first), int(last or first) + 1)
    return found


@pytest.mark.parametrize(("rows", "paper", "count"), [(table.P, "P", 100), (table.B, "B", 37)])
def test_every_equation_number_stands_in_one_row(rows, paper, count):
    assert sorted(numbers(rows, paper)) == list(range(1, count + 1))


@pytest.mark.parametrize("name", THEOREMS)
def test_every_theorem_definition_lemma_and_remark_has_a_row(name):
    assert sum(re.search(rf"{re.escape(name)}(?![\d.])", row.number) is not None for row in ROWS) == 1


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.number)
def test_functions_and_tests_of_a_row_exist(row):
    for name in row.functions:
        parts = name.split(".")
        for length in range(len(parts), 0, -1):
            try:
                module = importlib.import_module(".".join(["coadjoint", *parts[:length]]))
            except ModuleNotFoundError:
                continue
            assert reduce(getattr, parts[length:], module) is not None
            break
        else:
            pytest.fail(f"coadjoint.{name} does not exist")
    assert row.tests
    for test in row.tests:
        file, name = test.split("::")
        assert re.search(rf"^def {name}\(", (ROOT / "tests" / file).read_text(encoding="utf-8"), re.MULTILINE), test


@pytest.mark.long
def test_every_residual_of_the_table_is_round_off():
    for row in ROWS:
        assert row.residual() < ROUND_OFF, row.number


def test_the_page_is_that_of_the_rows():
    """All but the measured figures, whose last digit depends on the machine."""
    page = table.PAGE.read_text(encoding="utf-8")
    quoted = [float(x) for x in re.findall(r"\| (\d(?:\.\d)?e[-+]\d+) \|", page)]
    assert len(quoted) == len(ROWS)
    assert max(quoted) < ROUND_OFF
    for row in ROWS:
        assert f"| {row.number} | {row.statement} |" in page, (
            f"run tests/theory/theorem_table.py: {row.number} is not there"
        )
