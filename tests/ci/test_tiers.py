"""Which cases of a test run by default, with `-m long`, and with `-m exhaustive`."""

from __future__ import annotations

import math
import subprocess
import sys
from itertools import pairwise

import pytest

import tiers


@pytest.mark.parametrize("count", [1, 2, 5, 57, 333])
@pytest.mark.parametrize("each", [0.0, 0.1, 1.0, 7.0, 40.0])
def test_cases_fit_their_budgets(count, each):
    found = tiers.tiers([False] * count, [each], [tiers.LONG])
    by_default, by_long = found.count(""), found.count("long")
    assert by_default + by_long + found.count("exhaustive") == count
    assert by_default * each <= max(tiers.DEFAULT, each)
    assert by_long * each <= max(tiers.LONG, each)
    assert by_default == count if each == 0.0 else by_default > 0 or count == 1 or each > tiers.MOST * tiers.DEFAULT
    if count * each > tiers.DEFAULT:  # then as many as fit, and one where none does
        assert (by_default + 1) * each > tiers.DEFAULT
        assert by_long > 0 or by_default == count or each > (tiers.MOST * tiers.LONG if by_default else tiers.ALONE)


def test_further_cases_come_last_and_never_by_default():
    marked = [i % 3 == 0 for i in range(60)]
    found = tiers.tiers(marked, [0.01], [25.0])
    assert all(tier == ("long" if further else "") for tier, further in zip(found, marked, strict=True))
    found = tiers.tiers(marked, [tiers.DEFAULT / 2], [12.5 * tiers.DEFAULT])
    assert found.count("") == 2 and found.count("long") == 25
    assert {tier for tier, further in zip(found, marked, strict=True) if further} == {"exhaustive"}


def test_the_cases_of_a_smaller_budget_are_spread_and_among_those_of_a_larger_one():
    budget = tiers.DEFAULT
    chosen = [i for i, tier in enumerate(tiers.tiers([False] * 100, [budget / 5], [25.0])) if not tier]
    assert len(chosen) == 5
    gaps = [b - a for a, b in pairwise(chosen)]
    assert max(gaps) <= 3 * min(gaps)
    together = [
        i for i, tier in enumerate(tiers.tiers([False] * 100, [0.35 * budget, 0.05 * budget], [25.0, 25.0])) if not tier
    ]
    assert together == chosen  # functions that share their cases share their budgets
    more = [i for i, tier in enumerate(tiers.tiers([False] * 100, [budget / 10], [25.0])) if not tier]
    assert set(chosen) < set(more)


def test_what_costs_are_known_of_is_there():
    """A line of a test that was renamed would leave it unbounded without a word."""
    for name, number in tiers.seconds().items():
        file, _, function = name.partition("::")
        text = (tiers.FILE.parent.parent / file).read_text()
        assert f"def {function.rpartition('::')[2]}(" in text, name
        assert math.isfinite(number) and number > 0


def test_what_has_not_begun_after_the_minutes_given_is_skipped_and_counted():
    one = f"{__file__}::test_what_costs_are_known_of_is_there"
    given = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-rs", one, "--minutes"]
    for minutes, ends in (("0", "1 skipped"), ("9", "1 passed")):
        done = subprocess.run([*given, minutes], capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stdout + done.stderr
        assert ends in done.stdout and ("not begun after 0 minutes" in done.stdout) == (minutes == "0")
