"""Rows fill the lanes of machine code, idle ones repeat the last row, and come back as they were."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.kernels.lanes import in_lanes, of_lanes


@pytest.mark.parametrize("count", [1, 4, 5])
def test_rows_come_back_from_lanes(count):
    rows = np.random.default_rng(3).normal(size=(count, 3))
    grouped = in_lanes(rows, 4)
    assert grouped.shape == (-(-count // 4), 3, 4) and grouped.flags.c_contiguous
    np.testing.assert_array_equal(of_lanes(grouped, count), rows)
    np.testing.assert_array_equal(of_lanes(grouped)[count:], np.broadcast_to(rows[-1], (-count % 4, 3)))


def test_one_row_fills_as_many_groups_as_are_asked_for():
    assert np.array_equal(in_lanes(np.array([[1.0, 2.0]]), 2, 3), np.tile([[1.0], [2.0]], (3, 1, 2)))


@pytest.mark.parametrize("shape", [(2, 5, 0, 4), (2, 5, 3, 4), (2, 0, 4)])
def test_arrays_of_more_axes_come_back_by_members_also_where_an_axis_is_empty(shape):
    grouped = np.arange(float(np.prod(shape))).reshape(shape)
    found = of_lanes(grouped, 7)
    assert found.shape == (7, *shape[1:-1])
    if found.size:
        np.testing.assert_array_equal(found[5], grouped[1, ..., 1])
