"""What is deprecated works as before, and warns at the line of the caller with what to write."""

from __future__ import annotations

import inspect
import sys

import pytest

from coadjoint.deprecation import deprecated, renamed
from coadjoint.earlier_names import EarlierNames, install
from coadjoint.errors import ArgumentError


@deprecated("co.sum_of", until="0.9")
def total(a: float, b: float = 1.0) -> float:
    """The sum."""
    return a + b


@renamed(until="0.9", step="dt", time="duration")
def steps(duration: float, *, dt: float = 0.5) -> float:
    """How many."""
    return duration / dt


def test_a_deprecated_function_works_and_warns_at_the_caller() -> None:
    with pytest.warns(
        DeprecationWarning, match=r"\.total` is deprecated and goes in 0\.9; write `co\.sum_of`\.$"
    ) as told:
        assert total(1.0, b=2.0) == 3.0
    assert told[0].filename == __file__
    assert (total.__doc__, str(inspect.signature(total))) == ("The sum.", "(a: 'float', b: 'float' = 1.0) -> 'float'")


def test_an_argument_has_its_earlier_name_for_a_while() -> None:
    words = r"^`steps\(step=…\)` is deprecated and goes in 0\.9; write `dt=…`\.$"
    with pytest.warns(DeprecationWarning, match=words) as told:
        assert steps(1.0, step=0.25) == 4.0
    assert told[0].filename == __file__ and len(told) == 1
    assert steps(1.0, dt=0.25) == 4.0
    assert [*inspect.signature(steps).parameters] == ["duration", "dt"]


def test_both_names_of_an_argument_are_refused() -> None:
    with (
        pytest.warns(DeprecationWarning),
        pytest.raises(ArgumentError, match="`step` and `dt` are one: leave out `step`"),
    ):
        steps(1.0, step=0.25, dt=0.25)
    with pytest.raises(ArgumentError, match="has no argument `width` to which another is renamed"):
        renamed(until="0.9", size="width")(steps)


def test_earlier_names_of_modules_are_found_by_one_finder_however_often_it_is_asked_for() -> None:
    before = list(sys.meta_path)
    install()
    assert sys.meta_path == before and sum(isinstance(one, EarlierNames) for one in before) == 1
