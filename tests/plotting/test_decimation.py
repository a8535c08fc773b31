"""Thinned curves keep every extreme."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.plotting.decimation import CAPACITY, thin

SEED = 20260101


def test_few_points_are_all_drawn():
    assert np.array_equal(thin(np.arange(CAPACITY)), np.arange(CAPACITY))


@pytest.mark.parametrize("nodes", [CAPACITY + 1, 50_001, 1_000_003])
def test_the_highest_and_lowest_of_every_stretch_are_kept(nodes):
    random = np.random.default_rng(SEED)
    series = np.cumsum(random.normal(size=nodes))
    series[random.integers(nodes)] += 1e6
    series[random.integers(nodes)] -= 1e6
    kept = thin(series)
    assert len(kept) <= CAPACITY + 2
    assert np.all(np.diff(kept) > 0)
    assert (kept[0], kept[-1]) == (0, nodes - 1)
    stretches = np.linspace(0, nodes, CAPACITY // 2, endpoint=False).astype(int)
    bounds = [*stretches, nodes]
    for a, b in zip(bounds[:-1:97], bounds[1::97], strict=False):
        inside = kept[(kept >= a) & (kept < b)]
        assert series[inside].max() == series[a:b].max()
        assert series[inside].min() == series[a:b].min()


def test_a_path_keeps_the_extremes_of_every_coordinate():
    random = np.random.default_rng(SEED)
    path = np.cumsum(random.normal(size=(100_000, 3)), axis=0)
    kept = thin(path)
    assert np.array_equal(path[kept].min(axis=0), path.min(axis=0))
    assert np.array_equal(path[kept].max(axis=0), path.max(axis=0))
    assert len(kept) <= CAPACITY + 2


def test_a_constant_curve_is_thinned_too():
    assert len(thin(np.ones(1_000_000))) <= CAPACITY + 2
