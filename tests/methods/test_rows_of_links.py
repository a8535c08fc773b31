"""The numbers of spaces link by link, and spaces of shorter chains."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.methods.link_rows import NONE, placed_by_links, rows_by_links, shortened
from coadjoint.spaces import RelativePoses, Several

CHAIN = ((0, 1), (1, 2), (2, 3), (3, 4), (4, 5))


@pytest.mark.parametrize(
    ("pairs", "to", "expected"),
    [
        (CHAIN, 4, ((0, 1), (1, 2), (2, 3))),
        (((-1, 0), *CHAIN), 5, ((-1, 0), (0, 1), (1, 2), (2, 3), (3, 4))),
        ((*CHAIN, (5, -1)), 4, ((0, 1), (1, 2), (2, 3), (3, -1))),
    ],
)
def test_a_shorter_chain_has_the_first_pairs_and_those_of_the_last_link(pairs, to, expected):
    space = Several({"joint": RelativePoses(pairs), "down": co.Trivial(3)})
    found = shortened(space, 6, to)
    assert found.factors == (RelativePoses(expected), co.Trivial(3)) and found.names == space.names
    plain = RelativePoses(None)
    assert shortened(plain, 6, to) is plain


def test_rows_belong_to_the_larger_link_of_their_pair_and_a_link_without_one_has_none():
    rows = np.arange(1.0, 9.0).reshape(4, 2)
    found = placed_by_links(rows, [1, 0, 1, 3], 4)
    nothing = [NONE, NONE]
    assert found.tolist() == [[[3, 4], nothing], [[1, 2], [5, 6]], [nothing, nothing], [[7, 8], nothing]]
    group = co.Power(co.SO2(), 3)
    space = Several({"joint": RelativePoses(((0, 1), (1, 2)))})
    x = np.arange(1.0, space.ambient(group) + 1)
    (placed,) = evaluate(lambda x: rows_by_links(space, group, x), x)
    assert np.all(placed[0] == NONE) and placed[1:].ravel().tolist() == x.tolist()
