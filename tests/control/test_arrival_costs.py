"""Costs as roots: least values, spreads, sums and eliminations, of numbers of sizes that differ by powers of ten."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import coadjoint as co
from coadjoint.control.arrival_cost import Part, Quadratic, _units, cleaned, least_to, require_finite
from coadjoint.control.expansion import FLOOR, convex
from coadjoint.control.horizon_limits import HorizonLimits
from coadjoint.control.window import SeenAtNode, Window
from coadjoint.errors import OptimumError

SCALES = np.array([1.0, 1e3, 1e-2, 50.0])


def value(cost: Quadratic, v: np.ndarray) -> float:
    residual = cost.J @ v + cost.r
    return float(0.5 * residual @ residual + cost.l @ v)


def random_root(rank: int, seed: int = 3) -> np.ndarray:
    """J (6, 4) of this rank, in the units of SCALES."""
    random = np.random.default_rng(seed)
    return random.normal(size=(6, rank)) @ random.normal(size=(rank, 4)) / SCALES


@pytest.mark.parametrize("rank", [4, 2])
def test_the_least_value_is_where_the_slope_vanishes_and_unknown_directions_stay(rank):
    random, J = np.random.default_rng(4), random_root(rank)
    cost = Quadratic.of_root(J, random.normal(size=6))
    v = cost.least()
    np.testing.assert_allclose(cost.H @ v + cost.g, 0, atol=1e-9 * np.max(np.abs(cost.g)))
    S, blind, units = cost.spread()
    assert S.shape == (4, rank) and blind.shape == (4, 4 - rank)
    np.testing.assert_allclose(S.T @ cost.H @ S, np.eye(rank), atol=1e-9)
    assert np.max(np.abs(J @ (blind / units[:, None])), initial=0.0) < 1e-12 * np.max(np.abs(J))
    assert np.max(np.abs(blind.T @ (v * units)), initial=0.0) < 1e-9 * np.max(np.abs(v * units))


def test_a_cost_given_by_its_hessian_has_it_without_its_negative_curvature():
    random = np.random.default_rng(5)
    J, g = random_root(3), random.normal(size=4) / SCALES
    cost = Quadratic.of_hessian(J.T @ J, g)
    np.testing.assert_allclose(cost.H * SCALES * SCALES[:, None], J.T @ J * SCALES * SCALES[:, None], atol=1e-10)
    np.testing.assert_allclose(cost.g * SCALES, g * SCALES, atol=1e-10)
    assert len(cost.J) == 3
    bent = Quadratic.of_hessian(np.diag([2.0, -1.0, 0.0, 3.0]), np.array([1.0, 2.0, 0.0, 0.0]))
    np.testing.assert_allclose(bent.H, np.diag([2.0, 0.0, 0.0, 3.0]), atol=1e-14)
    np.testing.assert_allclose(bent.g, [1.0, 2.0, 0.0, 0.0], atol=1e-14)
    with pytest.raises(OptimumError, match="not finite about the estimate: `reset` forgets it"):
        Quadratic.of_hessian(np.diag([1.0, np.nan]), np.zeros(2))
    require_finite(np.ones(2), np.zeros((0, 3)))


@pytest.mark.parametrize("place", [0, 1])
def test_a_cost_by_a_hessian_that_is_not_finite_is_refused(place):
    given = [np.eye(2), np.zeros(2)]
    given[place][1] = np.nan
    with pytest.raises(OptimumError, match="is not finite about the estimate"):
        Quadratic.of_hessian(*given)


def test_a_cost_by_directions_is_that_of_the_motion_along_them():
    random = np.random.default_rng(8)
    T, J, g = random.normal(size=(3, 2)), random.normal(size=(5, 4)), random.normal(size=4)
    sizes: Any = cast(Any, SimpleNamespace(nx=3, nu=1))
    cost = Window._by_directions(sizes, T, J.T @ J, g)
    for y in random.normal(size=(3, 3)):
        v = np.append(T @ y[:2], y[2])
        assert value(cost, y) - value(cost, np.zeros(3)) == pytest.approx(0.5 * v @ J.T @ J @ v + g @ v, rel=1e-12)


def test_a_robust_loss_weighs_the_residual_of_a_value_and_not_its_slope():
    """J and r of each node times 1/σ and √w(|r/σ|²); a missing number has no row."""
    seen, loss = np.array([[2.0, 9.0, 1.0]]), co.losses.Student(4)
    J, u, sigma = np.arange(1.0, 10.0).reshape(3, 3), np.zeros((1, 1)), np.array([2.0, 0.0, 4.0])
    data = SimpleNamespace(space=SimpleNamespace(origin=np.zeros(3), dim=3))
    problem = SimpleNamespace(measured={"y": SimpleNamespace(loss=loss)})
    transcription = SimpleNamespace(data={"y": data}, problem=problem)
    tables = {"y": lambda x, u, p, h, y: (y, np.stack([J, J]))}
    window: Any = SimpleNamespace(nx=2, nu=1, most=1, p=None, h=0.1, _seen=tables, transcription=transcription)
    nodes = [SeenAtNode({"y": seen[0]}, {"y": sigma}), SeenAtNode({}, {})]
    first, last = Window._misfits(window, np.zeros((2, 2)), u, np.stack([np.eye(2)] * 2), nodes)
    rows = np.column_stack([J, seen[0]])[[0, 2]] * sigma[[0, 2], None]
    weight = loss.weight(np.sum(rows[:, -1] ** 2), 3)
    assert weight < 0.5
    np.testing.assert_allclose(first.H, weight * rows[:, :3].T @ rows[:, :3], rtol=1e-12)
    np.testing.assert_allclose(first.g, weight * rows[:, :3].T @ rows[:, 3], rtol=1e-12)
    assert not last.H.any() and not last.g.any()


def test_a_sum_of_costs_is_their_sum_at_every_place():
    random = np.random.default_rng(6)
    whole = Quadratic.of_root(random.normal(size=(5, 4)), random.normal(size=5))
    slope = Quadratic(np.zeros((0, 2)), np.zeros(0), random.normal(size=2), np.zeros(2))
    rows, offset = random.normal(size=(4, 3)), random.normal(size=4)
    some = random.normal(size=(2, 3))
    total = Quadratic.of_parts(3, [Part(whole, rows, offset), Part(slope, some, np.zeros(2))])
    base = value(whole, offset) - value(total, np.zeros(3))
    for v in random.normal(size=(4, 3)):
        expected = value(whole, rows @ v + offset) + value(slope, some @ v)
        assert value(total, v) + base == pytest.approx(expected, rel=1e-12)
    assert total.sizes == pytest.approx(np.sqrt(whole.sizes**2 @ rows**2))


@pytest.mark.parametrize("held", [None, 1])
def test_the_least_cost_of_what_leads_to_a_place_is_that_of_the_place(held):
    """V(θ) = min {cost(v): Gv = Kθ}, by the multipliers of the constraint; a row of G that is zero moves nothing."""
    random = np.random.default_rng(7)
    cost = Quadratic.of_root(random_root(4), random.normal(size=6))
    G = random.normal(size=(3, 4)) / SCALES * np.array([[1.0], [1e3], [1e-3]])
    if held is not None:
        G[held] = 0.0
    K, least = least_to(cost, G)
    assert K.shape == (3, 3 if held is None else 2) and (held is None or not np.any(K[held]))
    moving = np.any(G != 0, axis=1)
    shift = None
    for theta in random.normal(size=(3, K.shape[1])):
        A, b = G[moving], (K @ theta)[moving]
        matrix = np.block([[cost.H, A.T], [A, np.zeros((len(A),) * 2)]])
        units = np.concatenate([SCALES, 1 / np.linalg.norm(A * SCALES, axis=1)])
        v = (units * np.linalg.solve(matrix * units * units[:, None], units * np.concatenate([-cost.g, b])))[:4]
        gap = value(cost, v) - value(least, theta)
        shift = gap if shift is None else shift
        assert gap == pytest.approx(shift, rel=1e-6, abs=1e-8 * abs(value(cost, v)))


def test_bounds_that_exclude_each_other_are_told_by_the_one_that_the_least_cost_violates_most(monkeypatch):
    pytest.importorskip("casadi")
    limits: Any = object.__new__(HorizonLimits)
    limits._solvers, cost = {}, Quadratic.of_root(np.array([[1.0, 0.0]]), np.zeros(1))

    def least(*rows: tuple[list[float], float, float, str]) -> np.ndarray:
        found = [np.array(column) for column in zip(*rows, strict=True)]
        monkeypatch.setattr(limits, "_rows", lambda *_: found)
        return limits.solved(cost, [], None)

    np.testing.assert_allclose(
        least(([1.0, 1.0], 0.5, 3.0, "a"), ([1.0, 0.0], -1.0, -0.2, "b")), [-0.2, 0.7], atol=1e-6
    )
    with pytest.raises(OptimumError, match="violate most b, by 2"):
        least(([1.0, 0.0], 1.0, np.inf, "a"), ([1.0, 0.0], -np.inf, -2.0, "b"))


def test_units_are_the_sizes_of_columns_but_not_far_below_the_largest():
    np.testing.assert_allclose(_units(np.array([2.0, 1e-9, 0.5])), [2.0, 2e-3, 0.5])
    assert _units(np.zeros(2)).tolist() == [1.0, 1.0] and _units(np.zeros(0)).shape == (0,)


def test_entries_that_are_round_off_of_their_sums_are_left_out():
    a, b = np.array([[1.0, 1.0]]), np.array([[1.0, 1e-3], [-1.0, 0.0]])
    product = np.array([[3e-17, 1e-3]])
    np.testing.assert_array_equal(cleaned(product, a, b), [[0.0, 1e-3]])


def test_the_nearest_convex_matrix_keeps_what_is_positive_and_raises_the_rest_to_the_floor():
    H = np.array([[[2.0, 0.0], [0.0, -1.0]], [[4.0, 1.0], [1.0, 3.0]]])
    found = convex(H.copy(), False)
    np.testing.assert_allclose(found[0], np.diag([2.0, 4.0 * FLOOR]), rtol=1e-9)
    np.testing.assert_allclose(found[1], H[1], rtol=1e-8)
    sound = H[1:].copy()
    np.testing.assert_allclose(convex(sound.copy(), False), sound + 4.0 * FLOOR * np.eye(2), rtol=1e-15)
    np.testing.assert_allclose(convex(sound.copy(), True), sound + 4.0 * FLOOR * np.eye(2), rtol=1e-15)
    off = np.array([[[1e-3, -5.0], [-5.0, 1e6]]])
    assert np.all(np.linalg.eigvalsh(convex(off, False)) > 0)
