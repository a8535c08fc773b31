"""What members get, and statistics that are merged."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from coadjoint.sweeps import reduction
from coadjoint.sweeps.numbers import Number, design, shares
from coadjoint.sweeps.reduction import Observer, Reduction, _are_rotations
from coadjoint.sweeps.sketch import Sketch, merged


def test_rotations_are_orthogonal_and_right_handed():
    a = np.radians(25)
    R = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    assert _are_rotations(np.stack([R, R @ R, 2 * R, -R, R * np.nan])).tolist() == [True, True, False, False, False]


def test_angles_are_those_of_rotations_and_others_need_none(monkeypatch):
    monkeypatch.setattr(reduction, "variables", lambda plain, records, more, derive: made | derive(None))
    one, made = SimpleNamespace(_plain=None), {reduction.ANGLES: (("time", "angle"), np.ones((2, 3)))}
    assert Observer._without(one, None, {"x": 1.0}) == {**made, "x": 1.0}  # type: ignore[arg-type]
    found = Observer._without(one, None, {"rotation": np.stack([np.eye(3), 2 * np.eye(3)])})  # type: ignore[arg-type]
    np.testing.assert_array_equal(found[reduction.ANGLES][1], [[1.0] * 3, [np.nan] * 3])
    np.testing.assert_array_equal(found["rotation"], [np.eye(3)] * 2)


@pytest.mark.parametrize("sampling", ["random", "latin_hypercube", "sobol"])
def test_draws_fill_the_cube_and_repeat(sampling):
    u = shares(sampling, 1000, 3, 7)
    assert u.shape == (1000, 3) and np.all((u >= 0) & (u < 1))
    assert np.array_equal(u, shares(sampling, 1000, 3, 7)) and not np.array_equal(u, shares(sampling, 1000, 3, 8))
    counts = np.array([np.histogram(column, 10, (0, 1))[0] for column in u.T])
    assert np.max(np.abs(counts - 100)) <= {"random": 35, "latin_hypercube": 0, "sobol": 4}[sampling]


def test_a_member_that_is_drawn_at_random_is_the_same_among_more():
    assert np.array_equal(shares("random", 10, 2, 3), shares("random", 9000, 2, 3)[:10])


def test_numbers_have_the_distribution_that_they_state():
    u = (np.arange(100_000) + 0.5) / 100_000
    normal = Number("x", normal=(2.0, 0.5)).at(u)
    assert normal.mean() == pytest.approx(2.0, abs=1e-9) and normal.std() == pytest.approx(0.5, rel=1e-4)
    assert np.isfinite(Number("x", normal=(0.0, 1.0)).at(np.array([0.0, 1 - 2.0**-53]))).all()
    log = Number("x", between=(1.0, 100.0), even=False).at(u)
    assert np.median(log) == pytest.approx(10.0, rel=1e-4)
    assert set(Number("x", values=np.array([1.0, 5.0])).at(u)) == {1.0, 5.0}


def test_a_grid_has_all_combinations_and_its_ends_to_the_bit():
    numbers = [Number("a", between=(0.1, 0.7), count=3), Number("b", values=np.array([1.0, 2.0]))]
    found, count = design(numbers, "grid", None, 0)
    assert count == 6 and len({*zip(found["a"].tolist(), found["b"].tolist(), strict=True)}) == 6
    assert found["a"].min() == 0.1 and found["a"].max() == 0.7


def test_merged_statistics_are_those_of_all():
    random = np.random.default_rng(1)
    values = random.gamma(2.0, size=(20_000, 2)) + np.array([0.0, 1e6])
    parts = np.split(values, [100, 5000, 5001, 12_000])
    found = merged([Sketch.of(part) for part in parts])
    assert found.count == 20_000
    np.testing.assert_allclose(found.mean, values.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(found.deviation, values.std(axis=0, ddof=1), rtol=1e-9)
    assert np.array_equal(found.low, values.min(axis=0)) and np.array_equal(found.high, values.max(axis=0))
    for q in (0.001, 0.05, 0.5, 0.95, 0.999):
        rank = np.mean(values <= found.quantile(q), axis=0)
        np.testing.assert_allclose(rank, q, atol=max(0.003 * np.sqrt(q * (1 - q)), 2e-4))


def test_quantiles_of_few_members_are_exact():
    values = np.random.default_rng(2).normal(size=(90, 3))
    found = merged([Sketch.of(part) for part in np.array_split(values, 7)])
    for q in (0.0, 0.003, 0.3, 0.997, 1.0):
        np.testing.assert_allclose(found.quantile(q), np.quantile(values, q, axis=0), rtol=1e-12)


def test_shards_without_members_change_nothing():
    values = np.random.default_rng(3).normal(size=(10, 2))
    whole, empty = Sketch.of(values), Sketch.of(values[:0])
    assert merged([empty, whole, empty]).count == 10
    assert np.isnan(merged([empty]).table([0.5])).all()


def test_angles_go_on_over_turns_and_failed_members_are_nan():
    angles = np.array([[3.0, 0.1], [-3.1, np.nan], [-2.0, np.nan]])  # of two members at three nodes
    nodes = iter(angles)

    def observer(records):
        return {"euler_angles": ((), next(nodes))}

    here = SimpleNamespace(t=np.zeros(2), internal=None)
    kept = Reduction(observer, here, False, False)  # pyright: ignore[reportArgumentType]
    for t in ([0.0, 0.0], [1.0, np.nan], [2.0, np.nan]):
        kept.take(SimpleNamespace(t=np.array(t), internal=None))  # pyright: ignore[reportArgumentType]
    found = kept.results(np.array([False, True]))
    on = np.array([3.0, 2 * np.pi - 3.1, 2 * np.pi - 2.0])
    assert found["final_euler_angles"][0] == pytest.approx(on[-1])
    assert found["least_euler_angles"][0] == 3.0 and found["mean_euler_angles"][0] == pytest.approx(on.mean())
    assert all(np.isnan(values[1]) for values in found.values())


def test_a_normal_number_is_finite_at_both_ends_and_follows_its_law_between():
    low, middle, high, end = Number("mass", normal=(10.0, 2.0)).at(np.array([0.0, 0.5, 0.841344746068543, 1.0]))
    assert (middle, high) == pytest.approx((10.0, 12.0)) and low == pytest.approx(10 - 2 * 8.2924, abs=1e-3)
    assert end == pytest.approx(10 + 2 * 8.2095, abs=1e-3)
