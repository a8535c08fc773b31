"""The table of theorems names functions and tests that exist, leaves no number out, quotes residuals that hold, and
every error that is put into a function of a row raises the row's residual."""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path

import pytest
import theorem_table as table
from theorem_mutations import detected, mutations, resolve

ROOT = Path(__file__).parents[2]
ROWS = table.ROWS
THEOREMS = [f"Theorem {n}" for n in (1, 2, 6, 7)] + [f"Definition {n}" for n in (3, 4, 5)]
THEOREMS += ["Lemma 8", "Remark 9", "Lemma 10", *(f"Theorem {n}" for n in ("3.1", "3.2", "4.1", "5.1", "6.1", "6.2"))]
WORST = 1e-11
each_row = pytest.mark.parametrize("row", ROWS, ids=lambda row: row.number)


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
    assert sum(re.search(rf"{re.escape(name)}(?![\d.])", row.number) is not None for row in [*table.P, *table.B]) == 1


@each_row
def test_functions_and_tests_of_a_row_exist(row):
    assert row.functions and all(callable(resolve(name)[2]) for name in row.functions)
    assert row.tests
    for test in row.tests:
        file, name = test.split("::")
        assert re.search(rf"^def {name}\(", (ROOT / "tests" / file).read_text(encoding="utf-8"), re.MULTILINE), test


@pytest.mark.cases(1)
@each_row
def test_a_row_holds_in_its_first_case(row):
    assert row.bound <= WORST
    assert max(islice(row.cases(), 1)) <= row.bound


@pytest.mark.long
@each_row
def test_every_residual_of_the_table_is_round_off(row):
    assert row.residual() <= row.bound


SOME = [
    ("(P3)–(P5)", "groups.group.LieGroup.ad_dual", "sign"),
    ("[Theorem 1]", "spaces.space.Space.diamond", "sign"),
    ("(P15)–(P19)", "spaces.space.Space.infinitesimal", "factor"),
    ("(P20)–(P24)", "spaces.space.Space.lifted_diamond", "identity"),
    ("[Theorem 2]", "mechanics.noether.total_momentum", "factor"),
    ("[Definition 3]", "difference_maps.difference_map.DifferenceMap.require_fit", "accepts"),
    ("[Definition 4]", "difference_maps.difference_map.DifferenceMap.dtau", "transpose"),
    ("[Definition 5]", "groups.group.LieGroup.Ad", "identity"),
    ("[Theorem 6]", "theory.euler_poincare.discrete_euler_poincare", "factor"),
    ("[Theorem 7]", "mechanics.noether.KelvinNoether.paper_quantity", "sign"),
    ("(P46)", "spaces.space.Space.pull", "transpose"),
    ("(P57)–(P62)", "models.paper_form.vehicle", "factor"),
    ("Lemma 10", "groups.SO3.hat", "sign"),
    ("(P89)–(P90)", "methods.LeftRectangle.equations", "factor"),
    ("(P98)–(P100)", "difference_maps.Exponential.dtau_inverse_dual", "transpose"),
    ("(B4)–(B6)", "groups.SemidirectProduct.Ad_dual", "transpose"),
    ("(B9)–(B12)", "theory.semidirect.semidirect_link", "factor"),
    ("(B16)", "theory.unreduced.discrete_euler_lagrange_algorithm", "factor"),
    ("(B18)", "theory.poisson.PoissonLagrangian.taken", "sign"),
    ("(B28)–(B31)", "mechanics.discrete_connection.DiscreteConnection.in_section", "transpose"),
    ("[Theorem 6.2]", "mechanics.bundle.reconstructed", "factor"),
    ("after (B37), local", "mechanics.principal_bundle.PrincipalBundle.transition", "transpose"),
    ("(P20)–(P24) on Gᴺ", "spaces.links.Links.diamond", "sign"),
    ("[Theorem 1](theorems/euler-poincare.md) on relative", "spaces.RelativePoses.diamond", "factor"),
    ("(P20)–(P24), right", "spaces.by_inverse.ByInverse.lifted_diamond", "sign"),
    ("[Theorem 6](theorems/discrete-euler-poincare.md), right", "theory.euler_poincare.right_momenta", "factor"),
    ("[Theorem 6](theorems/discrete-euler-poincare.md), (P79)", "methods.IsospectralMidpoint.advance", "factor"),
    ("Theorems 2 and 7 with", "mechanics.constraints.Bound.reaction", "factor"),
    ("Discrete momentum", "theory.constraints.generator", "factor"),
]


@pytest.mark.cases(1)
@pytest.mark.parametrize(("number", "name", "kind"), SOME, ids=[f"{row[0]} {row[2]}" for row in SOME])
def test_an_error_in_a_function_of_a_row_is_detected(number, name, kind):
    """A few mutations of every part of the table; the next test has all."""
    row = next(row for row in ROWS if row.number.startswith(number))
    assert name in row.functions
    assert max(islice(row.cases(), 1)) <= row.bound
    assert detected(row, name, kind)


@pytest.mark.long
@each_row
def test_every_mutation_of_a_row_is_detected_or_equivalent(row):
    tried = mutations(row)
    assert set(row.equivalent) <= set(tried), "an argument for a mutation that does not exist"
    survived = [one for one in tried if one not in row.equivalent and not detected(row, *one)]
    revived = [one for one in row.equivalent if detected(row, *one)]
    assert not survived, f"not detected: {survived}"
    assert not revived, f"called equivalent, but detected: {revived}"


def test_the_page_is_that_of_the_rows():
    """All but the measured figures, whose last digit depends on the machine."""
    page = table.PAGE.read_text(encoding="utf-8")
    quoted = [float(x) for x in re.findall(r"\| (\d(?:\.\d)?e[-+]\d+) \|", page)]
    assert len(quoted) == len(ROWS)
    assert max(quoted) <= WORST
    for row in ROWS:
        functions = ", ".join(f"`{name}`" for name in row.functions)
        assert f"| {row.number} | {row.statement} | {row.domain} | {functions} |" in page, (
            f"run tests/theory/theorem_table.py: {row.number} is not there"
        )
    found = [tuple(map(int, pair)) for pair in re.findall(r"\| (\d+) of (\d+) \|\n", page)]
    generated, caught, equal = map(int, re.search(r"(\d+) generated, (\d+) detected, (\d+) equivalent", page).groups())
    assert (generated, caught) == (sum(all_ for _, all_ in found), sum(some for some, _ in found))
    assert generated == caught + equal
    assert equal == sum(len(row.equivalent) for row in ROWS)
