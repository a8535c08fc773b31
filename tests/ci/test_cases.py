"""Which cases of a product run, and which tests cost too much."""

from __future__ import annotations

import json
from itertools import combinations, product

import pytest

import costs
from cases import LEAST, drawn
from costs import Apart, spent

pytest_plugins = ["pytester"]

FACTORS = [(4, 3, 2), (7, 5), (2, 2, 2, 2), (23, 6, 2)]


def pairs(rows):
    return {pair for row in rows for pair in combinations(enumerate(row), 2)}


@pytest.mark.parametrize("sizes", FACTORS)
def test_cases_cover_each_value_and_soon_each_pair(sizes):
    rows = list(product(*map(range, sizes)))
    few = [rows[i] for i in drawn(rows, max(sizes), "name")]
    assert [len(set(column)) for column in zip(*few, strict=True)] == list(sizes)
    largest, second = sorted(sizes)[:-3:-1]
    more = [rows[i] for i in drawn(rows, 2 * largest * second, "name")]
    assert pairs(more) == pairs(rows)
    assert len(pairs([rows[i] for i in drawn(rows, largest * second, "name")])) > 0.8 * len(pairs(rows))


def test_a_single_case_is_not_the_trivial_one():
    rows = list(product(range(5), range(3)))
    for name in "abcdefgh":
        assert 0 not in rows[drawn(rows, 1, name)[0]]
    assert drawn([(0,), (1,)], 1, "name") == [1]


def test_cases_are_the_same_each_time_and_differ_between_names():
    rows = list(product(range(9), range(9)))
    found = [tuple(drawn(rows, 5, name)) for name in ("one", "one", "two")]
    assert found[0] == found[1] != found[2]
    assert found[0] == (17, 19, 29, 41, 70), "the draw must not depend on the version of Python"


TESTS = """
import pytest

@pytest.fixture(scope="module", params=["trivial", "a", "b"])
def prepared(request):
    return request.param

@pytest.mark.parametrize("y", range(30))
def test_a_list_is_whole(y): ...

@pytest.mark.parametrize("y", range(30))
@pytest.mark.cases(2)
def test_a_list_is_cut(y): ...

@pytest.mark.parametrize("y", range(9))
@pytest.mark.parametrize("x", [0.0, 1.0, pytest.param(2.0, marks=pytest.mark.long)])
def test_a_product(x, y): ...

@pytest.mark.cases(1)
def test_of_a_fixture(prepared): assert prepared != "trivial"

@pytest.mark.cases(1)
def test_of_the_same_fixture(prepared): ...
"""


def collected(pytester, *given: str) -> list[str]:
    pytester.makeconftest('pytest_plugins = ["cases", "costs"]')
    items, _ = pytester.inline_genitems(pytester.makepyfile(test_made=TESTS), "-p", "no:xdist", *given)
    return [item.name for item in items]


def of(name: str, found: list[str]) -> list[str]:
    return [case.partition("[")[2] for case in found if case.startswith(name)]


def test_lists_run_whole_and_products_and_marked_functions_in_part(pytester):
    found = collected(pytester)
    assert [len(of(f"test_a_list_is_{name}", found)) for name in ("whole", "cut")] == [30, 2]
    values = [case.partition("-")[0] for case in of("test_a_product", found)]
    assert values.count("0.0") + values.count("1.0") == LEAST, values
    assert values.count("2.0") == 9, "those that are long are drawn apart"


def test_functions_that_share_a_prepared_case_run_with_the_same_one(pytester):
    found = collected(pytester)
    assert of("test_of_a_fixture", found) == of("test_of_the_same_fixture", found) != ["trivial]"]


def test_all_cases_run_where_they_are_asked_for(pytester):
    found = collected(pytester, "--all")
    assert [len(of(f"test_{name}", found)) for name in ("a_list_is_cut", "a_product", "of_a_fixture")] == [30, 27, 3]


def test_a_function_that_is_named_runs_whole(pytester):
    pytester.makeconftest('pytest_plugins = ["cases", "costs"]')
    path = pytester.makepyfile(test_made=TESTS)
    assert len(pytester.inline_genitems(f"{path}::test_a_product", "-p", "no:xdist")[0]) == 27


COSTS = """
import gc, time, pytest

def burn(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end: sum(range(1000))

@pytest.fixture(scope="module")
def prepared(): burn(0.05)

@pytest.fixture
def own(): burn(0.05)

def test_dear(): burn(0.05)
def test_dear_by_its_fixture(own): ...
def test_dear_by_a_shared_fixture(prepared): ...
def test_cheap(): ...
@pytest.mark.long
def test_dear_and_long(): burn(0.05)
"""


def ran(pytester, monkeypatch, source: str, *given: str, **changed):
    """What pytest says of tests with other limits, which hold for them alone."""
    pytester.makeconftest('pytest_plugins = ["cases", "costs"]')
    pytester.makepyfile(test_made=source)
    with monkeypatch.context() as patched:
        for name, value in {"FIRST": 0.0, **changed}.items():
            patched.setattr(costs, name, value)
        return pytester.runpytest_inprocess("-p", "no:xdist", "-p", "no:cacheprovider", *given)


def test_a_test_that_costs_too_much_fails_with_a_remedy_unless_it_is_long(pytester, monkeypatch):
    done = ran(pytester, monkeypatch, COSTS, LIMIT=0.02, loop=lambda: costs.REFERENCE)
    done.assert_outcomes(failed=2, passed=3)
    done.stdout.fnmatch_lines(["*may take 0.02 s, 1.00 times that*mark it `long` or*", "processor time: *"])


def test_the_costs_of_tests_are_written_and_a_slow_processor_may_take_longer(pytester, monkeypatch):
    given = ("--costs", "costs.json")
    ran(pytester, monkeypatch, COSTS, *given, LIMIT=0.02, loop=lambda: 10 * costs.REFERENCE).assert_outcomes(passed=5)
    known = json.loads((pytester.path / "costs.json").read_text())
    assert len(known) == 5 and known["test_made.py::test_dear"] > 0.04 > known["test_made.py::test_cheap"]


@pytest.mark.parametrize(
    ("budget", "given", "status"), [(1e6, ["--budget"], 0), (1e-6, ["--budget"], 1), (1e-6, [], 0)]
)
def test_the_budget_of_all_tests_fails_where_it_is_asked_for(pytester, monkeypatch, budget, given, status):
    done = ran(pytester, monkeypatch, "def test_cheap(): ...", *given, BUDGET=budget, loop=lambda: costs.REFERENCE)
    assert done.ret == status
    if given:
        done.stdout.fnmatch_lines([f"the budget of *{'exceeded' if status else 'kept'}"])


def test_the_budget_goes_with_the_speed_of_the_processor_while_tests_run(pytester, monkeypatch):
    speeds = iter([1.0, 3.0, 3.0, 3.0])
    changed = {"BUDGET": 100.0, "OFTEN": 1, "loop": lambda count=3: next(speeds) * costs.REFERENCE}
    done = ran(pytester, monkeypatch, "".join(f"def test_{i}(): ...\n" for i in range(3)), "--budget", **changed)
    done.stdout.fnmatch_lines(["the budget of 100 s × 3.00 = 300 s is kept"])


def test_what_happens_within_something_apart_is_counted_once():
    apart, began = Apart(), spent()
    with apart, apart:
        sum(range(100_000))
    assert 0 < apart.seconds <= spent() - began
