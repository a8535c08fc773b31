"""Pairs of links that are coupled, in any order, and how far a member of a group is off from what is derived."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import GroupError
from coadjoint.groups.overrides import _require_close


def test_pairs_of_links_are_kept_once_each_with_the_smaller_number_first():
    assert co.Power(co.SO3(), 4, coupling=[(3, 0), (0, 3), (1, 2)]).coupling == ((0, 3), (1, 2))
    assert co.Power(co.SO3(), 4, coupling=[]).coupling == ()


@pytest.mark.parametrize("pair", [(0, 4), (-1, 2), (1, 1)])
def test_a_pair_that_is_of_no_two_links_raises_and_is_named(pair):
    with pytest.raises(GroupError, match=rf"pair \({pair[0]}, {pair[1]}\) .* must be of two links from 0 to 3"):
        co.Power(co.SO3(), 4, coupling=[(0, 3), pair])


def off(found: float, expected: float) -> str:
    """What is said of a member that gives a number where another is derived."""
    identity = cast(Any, SimpleNamespace(member="Ad", says="Ad = Ad"))
    with pytest.raises(GroupError) as raised:
        _require_close(co.SO3(), "", identity, [(np.array([found]), np.array([expected]))])
    return str(raised.value)


def test_how_far_a_member_is_off_is_said_relative_to_its_size_where_it_has_one():
    assert "off by 5.0e-01 of its size" in off(3.0, 2.0)
    assert "off by 3.0e+00:" in off(3.0, 0.0)
    assert "off by nan:" in off(np.nan, 2.0) and "off by inf:" in off(np.inf, 2.0)


def test_agreement_is_to_a_billionth_of_the_size():
    identity = cast(Any, SimpleNamespace(member="Ad", says="Ad = Ad"))
    _require_close(co.SO3(), "", identity, [(np.array([2.0 + 1.9e-9]), np.array([2.0]))])
    assert "1.1e-09 of its size" in off(2.0 + 2.2e-9, 2.0)
