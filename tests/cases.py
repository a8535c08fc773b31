"""Which cases of a parametrised test run: all of a list, and of a product few that cover its values and their pairs.

A function with one parametrised argument runs all of its cases. One with several runs as many as its longest list has
values, and at least `LEAST`. With `@pytest.mark.cases(k)` either runs k. The cases of a function are always the same,
and those of another one differ. The first value of each list is taken as the trivial one (0, None, SO(3)): a case with
few of them comes first. Cases that are marked `long` are drawn in the same way, apart from the others.

`pytest --all` collects complete products, and so does a function that is named, as in `pytest FILE::test_name`.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from itertools import combinations

import pytest

LEAST = 12
"""Cases that a product without a mark runs, if it has so many."""

CANDIDATES = 100
"""Cases of a long product among which each next one is chosen."""


def drawn(rows: Sequence[tuple[int, ...]], count: int, seed: str) -> list[int]:
    """The rows, `count` of them, whose values and pairs of values differ most; a row has one index for each list."""
    generator = random.Random(seed)
    left = list(range(len(rows)))
    generator.shuffle(left)
    left.sort(key=lambda i: rows[i].count(0))
    seen: set[object] = set()
    found: list[int] = []
    while left and len(found) < count:
        unseen = [i for i in left if not seen.issuperset(enumerate(rows[i]))]
        best = max((unseen or left)[:CANDIDATES], key=lambda i: _new(rows[i], seen))
        seen.update(enumerate(rows[best]), combinations(enumerate(rows[best]), 2))
        found.append(best)
        left.remove(best)
    return sorted(found)


def _new(row: tuple[int, ...], seen: set[object]) -> tuple[int, int]:
    """How many values of a row, and how many pairs of them, are not in those seen."""
    values = list(enumerate(row))
    return len(set(values) - seen), len(set(combinations(values, 2)) - seen)


def pytest_addoption(parser) -> None:
    parser.addoption("--all", action="store_true", help="collect complete products of cases")


@pytest.hookimpl(trylast=True)
def pytest_generate_tests(metafunc) -> None:
    """Leave to a function of tests the cases that run."""
    end = f"::{metafunc.function.__name__}"
    named = any(argument.split("[", 1)[0].endswith(end) for argument in metafunc.config.args)
    calls = metafunc._calls
    lists = _lists(calls)
    mark = metafunc.definition.get_closest_marker("cases")
    if named or metafunc.config.option.all or not lists or (len(lists) == 1 and not mark):
        return
    count = mark.args[0] if mark else max(LEAST, *(len(set(indices)) for indices in lists))
    shared = any(scope.name != "Function" for scope in calls[0]._arg2scope.values())
    seed = metafunc.module.__name__ + ("" if shared else "." + metafunc.function.__name__)
    rows = list(zip(*lists, strict=True))
    chosen = []
    for kind in (False, True):
        part = [i for i, call in enumerate(calls) if any(m.name == "long" for m in call.marks) == kind]
        chosen += [part[i] for i in drawn([rows[i] for i in part], count, seed)]
    metafunc._calls = [calls[i] for i in sorted(chosen)]


def _lists(calls) -> list[tuple[int, ...]]:
    """The index of each case in each list; arguments that are given together have one list."""
    names = calls[0].indices if calls and hasattr(calls[0], "indices") else ()
    columns = [tuple(call.indices[name] for call in calls) for name in names]
    return [column for column in dict.fromkeys(columns) if len(set(column)) > 1]
