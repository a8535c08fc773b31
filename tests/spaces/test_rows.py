"""Rows of an array by their numbers, as slices or one by one."""

import jax
import numpy as np
import pytest

from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.rows import LinkRows

NUMBERS = {
    "chain": [0, 1, 2, 3],
    "later rows": [2, 3, 4],
    "ring": [1, 2, 3, 0],
    "one row many times": [1, 1, 1, 4, 4, 0, 2],
    "downwards": [5, 4, 3, 2, 1, 0],
    "one": [3],
}


@pytest.mark.parametrize("numbers", NUMBERS.values(), ids=NUMBERS)
def test_rows_are_those_of_numpy(numbers: list[int]):
    array, rows = np.random.default_rng(3).normal(size=(6, 2, 2)), LinkRows(np.array(numbers))
    assert np.array_equal(evaluate(rows.of, array), array[numbers])
    values, sums = np.random.default_rng(4).normal(size=(len(numbers), 2)), np.zeros((6, 2))
    np.add.at(sums, numbers, values)
    assert np.allclose(evaluate(lambda values: rows.summed(values, 6), values), sums, rtol=0, atol=1e-15)


def test_few_stretches_of_rows_are_no_gather():
    array = np.zeros((6, 2))
    assert "gather" not in str(jax.make_jaxpr(LinkRows(np.array([1, 2, 3, 0])).of)(array))
    assert "gather" in str(jax.make_jaxpr(LinkRows(np.array([5, 4, 3, 2, 1, 0])).of)(array))
