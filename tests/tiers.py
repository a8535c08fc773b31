"""Which tests run when: by default some of each function's cases, with `-m long` more of them, with `-m ""` all.

A function of tests that sets up a system costs a second or more a case, and a product of groups, maps and rules has
hundreds of cases. So each function has a budget of processor time, and takes as many of its cases as fit it
(functions of a file with the same cases, for which a fixture prepares the same, put their budgets together):

    by default (the tests of the README)    DEFAULT s a function
    `pytest -m long` (`.ci/run` runs both)  LONG s more, or what `@pytest.mark.budget(seconds)` says; one case of up to
                                            ALONE s where none runs by default
    `pytest -m exhaustive`                  the rest

What a case costs is measured, in `seconds.txt` (`pytest -n 2 -m "" --measure` writes it anew); a function that is not
in it is cheap, and runs whole. The cases that run are spread over the product, always the same, and those of a smaller
budget are among those of a larger one. Cases that are marked `further` come after all others, and
never by default. A test that is named,
as in `pytest tests/theory/test_table.py::test_name`, runs whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

DEFAULT, LONG = 1.0, 2.0
"""Seconds of processor time that a function of tests may take by default, and with `-m long`."""

MOST = 3.0
"""A case of several runs even if it takes so many times the budget."""

ALONE = 24.0
"""Seconds of processor time that a case of a function none of whose cases runs by default may take with `-m long`."""

FILE = Path(__file__).parent / "seconds.txt"
GOLDEN = 0.6180339887498949


def seconds() -> dict[str, float]:
    """Seconds of processor time a case takes, by `file::function`."""
    lines = (line.rsplit(maxsplit=1) for line in FILE.read_text().splitlines() if not line.startswith("#"))
    return {name: float(number) for name, number in lines}


def spread(count: int) -> list[int]:
    """0 … count − 1 in an order of which each beginning is spread over all: by the fractions of i times the golden
    ratio."""
    return sorted(range(count), key=lambda i: (i * GOLDEN) % 1)


def tiers(further: Sequence[bool], each: Sequence[float], more: Sequence[float]) -> list[str]:
    """The tier of each case of functions with the same cases: "" (default), "long" or "exhaustive".

    further: whether a case is marked `further`. each, more: of every function, what a case costs, s, and its budget
    with `-m long`, s.
    """
    plain = [i for i, last in enumerate(further) if not last]
    order = [plain[i] for i in spread(len(plain))]
    rest = [i for i, last in enumerate(further) if last]
    order += [rest[i] for i in spread(len(rest))]
    cost, budget, larger = sum(each), DEFAULT * len(each), sum(more)
    by_default = len(plain) if cost == 0.0 else min(len(plain), int(budget / cost))
    if len(plain) > 1 and cost <= MOST * budget:
        by_default = max(by_default, 1)
    by_long = len(order) if cost == 0.0 else int(larger / cost)
    if cost <= max(MOST * larger, 0.0 if by_default else ALONE * len(each)):
        by_long = max(by_long, 1)
    found = ["exhaustive"] * len(order)
    for place, i in enumerate(order):
        if place < by_default:
            found[i] = ""
        elif place < by_default + by_long:
            found[i] = "long"
    return found
