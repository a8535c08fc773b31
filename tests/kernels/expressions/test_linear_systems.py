"""Linear systems over expressions, on numbers: expressions of constants are constants, which NumPy finds too."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from coadjoint.kernels.emit import link_elimination
from coadjoint.kernels.expressions import block_elimination, elimination
from coadjoint.kernels.expressions.graph import Graph, substitute
from coadjoint.kernels.untraceable import NotLinked

RANDOM = np.random.default_rng(1809)


def nodes(graph: Graph, array: Any) -> Any:
    """An array as expressions, in lists."""
    return graph.constant(float(array)) if np.ndim(array) == 0 else [nodes(graph, part) for part in array]


def numbers(found: Any) -> Any:
    if isinstance(found, list | tuple):
        return np.array([numbers(part) for part in found])
    assert not found.args, f"{found.op} of constants is not one"
    return found.value


def matrix(size: int) -> np.ndarray:
    """One that needs its rows exchanged, in several columns."""
    a = RANDOM.normal(size=(size, size))
    a[0, 0] = 0.0
    return a


@pytest.mark.parametrize("size", [1, 2, 3, 4, 6])
def test_solutions_factors_and_determinants_are_those_of_numbers(size):
    graph, a, b = Graph(), matrix(size) + (size == 1), RANDOM.normal(size=(2, size))
    given = nodes(graph, a)
    assert numbers(elimination.solve(graph, given, nodes(graph, b))) == pytest.approx(np.linalg.solve(a, b.T).T)
    assert numbers(elimination.determinant(graph, given)) == pytest.approx(np.linalg.det(a))
    if size <= 3:
        assert numbers(elimination.inverse(graph, given)) == pytest.approx(np.linalg.inv(a))
    rows, pivots, order = map(numbers, elimination.factors(graph, given))
    L, U = np.tril(rows, -1) + np.eye(size), np.triu(rows)
    np.testing.assert_allclose(L @ U, a[order.astype(int)], atol=1e-12)
    assert np.max(np.abs(L)) <= 1
    exchanged = list(range(size))
    for k, place in enumerate(pivots.astype(int)):
        exchanged[k], exchanged[place] = exchanged[place], exchanged[k]
    assert exchanged == order.tolist()
    positive = a @ a.T + np.eye(size)
    assert numbers(elimination.cholesky(graph, nodes(graph, positive))) == pytest.approx(np.linalg.cholesky(positive))
    for lower, unit in ((True, False), (True, True), (False, False), (False, True)):
        t = np.tril(positive) if lower else np.triu(positive)
        found = numbers(elimination.triangular(graph, nodes(graph, t), nodes(graph, b[0]), lower, unit))
        t = t - np.diag(np.diag(t) - 1) if unit else t
        assert t @ found == pytest.approx(b[0])


def test_a_column_without_a_pivot_stays_as_it_is():
    graph, a = Graph(), np.array([[0.0, 2.0], [0.0, 3.0]])
    rows, _, order = map(numbers, elimination.factors(graph, nodes(graph, a)))
    assert rows.tolist() == a.tolist() and order.tolist() == [0, 1]


def test_independent_parts_are_the_unknowns_that_rows_couple():
    coupled = {0: (0, 3), 1: (1,), 2: (2, 4), 3: (3,), 4: (), 5: (1,)}
    assert sorted(elimination.parts(6, coupled.__getitem__)) == [[0, 3], [1, 5], [2, 4]]


@pytest.mark.parametrize("size", [1, 2, 3, 5, 8])
def test_elimination_by_blocks_gives_the_solution_and_says_where_a_block_cancels(size):
    graph, b = Graph(), RANDOM.normal(size=size)
    a = RANDOM.normal(size=(size, size)) + 2 * size * np.eye(size)
    first = lambda graph, a: list(range(len(a)))[-2:]  # noqa: E731
    for pivots in (block_elimination.sparse_pivots, first):
        found = block_elimination.solve(graph, nodes(graph, a), nodes(graph, b), pivots)
        assert numbers(found[0]) == pytest.approx(np.linalg.solve(a, b))
        assert [x.value for x in found[1:]] == [True, True]
    assert numbers(block_elimination.guarded_solve(graph, nodes(graph, a), nodes(graph, b))) == pytest.approx(
        np.linalg.solve(a, b)
    )
    if size > 1:
        a[-2:, -2:] = [[1.0, 1.0], [1.0, 1.0 + 1e-5]]
        *_, sound, last = block_elimination.solve(graph, nodes(graph, a), nodes(graph, b), first)
        assert sound.value is (size <= 3) and (size != 2 or last.value is False)


@pytest.mark.parametrize(("size", "safe"), [(2, True), (5, False)])
def test_a_system_beyond_three_unknowns_is_guarded_where_its_last_block_cancels(monkeypatch, size, safe):
    graph, a = Graph(), np.eye(size)
    a[-2:, -2:] = [[1.0, 1.0], [1.0, 1.0 + 1e-6]]
    seen: list[Any] = []
    monkeypatch.setattr(graph, "guarded", lambda quick, safe, *rest: seen.append(safe.value) or quick)
    block_elimination.guarded_solve(graph, nodes(graph, a), nodes(graph, np.ones(size)))
    assert seen == [safe]


def test_unknowns_without_a_pivot_come_after_those_that_they_couple():
    """Of a saddle point the multiplier is last; of the others those come first that are coupled with the fewest."""
    graph = Graph()
    saddle = [[2, 0, 0, 1], [0, 3, 1, 1], [0, 1, 4, 0], [1, 1, 0, 0]]
    assert block_elimination.sparse_pivots(graph, nodes(graph, saddle)) == [0]
    assert block_elimination.sparse_pivots(graph, nodes(graph, [[2, 1, 1], [1, 3, 0], [1, 0, 4]])) == [0, 1, 2]
    assert block_elimination.sparse_pivots(graph, nodes(graph, [[0, 1, 1, 1]] * 4)) == [1, 2, 3]


def test_blocks_that_do_not_change_are_eliminated_first():
    graph = Graph()
    x = graph.symbol("x")
    a = nodes(graph, np.eye(5) + 1)
    a[1][3] = graph.add(a[1][3], x)
    a[0][0] = graph.mul(x, x)
    changing = block_elimination.Changing({x})
    assert block_elimination.steady_pivots(changing, graph, a) == [1, 2, 4]
    assert block_elimination.steady_pivots(block_elimination.Changing(set()), graph, a) == [0, 1, 2]
    every = block_elimination.Changing({node for row in a for node in row})
    assert block_elimination.steady_pivots(every, graph, a) == [0, 1, 2]
    assert block_elimination.steady_pivots(every, graph, [row[:4] for row in a[:4]]) == [0, 1]


# Chains of joints.


@pytest.mark.parametrize("m", [1, 2])
def test_sweeps_over_blocks_solve_a_block_tridiagonal_system(m):
    graph, count = Graph(), 4
    L, U = RANDOM.normal(size=(2, count, m, m))
    D, r = 5 * np.eye(m) + RANDOM.normal(size=(count, m, m)), RANDOM.normal(size=(count, m))
    L[0], U[-1] = 0.0, 0.0
    full = np.zeros((count, m, count, m))
    for i in range(count):
        full[i, :, i] = D[i]
        if i:
            full[i, :, i - 1], full[i - 1, :, i] = L[i], U[i - 1]
    expected = np.linalg.solve(full.reshape(count * m, -1), r.ravel()).reshape(count, m)
    found = link_elimination.sweep(graph, m)
    before, kept = nodes(graph, np.zeros(m**2 + m)), []
    for parts in zip(L, D, U, r, strict=True):
        row = nodes(graph, np.concatenate([part.ravel() for part in parts]))
        before = substitute(graph, found.forward, dict(zip([*found.rows, *found.before], [*row, *before], strict=True)))
        kept.append(before)
    x = nodes(graph, np.zeros(m))
    for here, wanted in zip(reversed(kept), expected[::-1], strict=True):
        x = substitute(graph, found.backward, dict(zip([*found.here, *found.ahead], [*here, *x], strict=True)))
        assert numbers(x) == pytest.approx(wanted)


def chain(graph: Graph, count: int, base: int, joint: int) -> Any:
    """The symbols of a short chain with so many unknowns of a body and of a joint."""
    b = base + joint
    return SimpleNamespace(
        graph=graph, count=count, base=base, joint=joint, positions=range(count), address={},
        z=np.array([graph.symbol(f"z{i}") for i in range(count * b)]), z_places=np.arange(count * b).reshape(count, b),
        d=np.array([graph.symbol(f"d{i}") for i in range(count * joint)]),
        d_places=np.arange(count * joint).reshape(count, joint),
    )  # fmt: skip


def linear(graph: Graph, rows: np.ndarray, right: np.ndarray, symbols: Any) -> list[Any]:
    """rows · symbols + right, as expressions."""
    return [
        graph.add(elimination.dot(graph, nodes(graph, row), list(symbols)), graph.constant(float(x)))
        for row, x in zip(rows, right, strict=True)
    ]


def of_joints(across: tuple[int, ...], back: tuple[int, ...], inside: tuple[int, ...], count=4, base=2, joint=2):
    """The matrix and right side of bodies that joints connect, of these neighbours."""
    b = base + joint
    a, r = np.zeros((count, b, count, b)), RANDOM.normal(size=count * b)
    for i in range(count):
        a[i, :base, i, :base] = 4 * np.eye(base) + RANDOM.normal(size=(base, base))
        for rows, columns, near in (
            (slice(0, base), slice(base, b), across),
            (slice(base, b), slice(0, base), back),
            (slice(base, b), slice(base, b), inside),
        ):
            for j in (i + d for d in near if 0 <= i + d < count):
                a[i, rows, j, columns] = RANDOM.normal(size=(rows.stop - rows.start, columns.stop - columns.start))
    return a.reshape(count * b, -1), r


@pytest.mark.parametrize("near", [((0, 1), (-1, 0), (0,)), ((0,), (0,), (-1, 0, 1)), ((-1, 0), (0, 1), (0,))])
def test_the_schur_complement_of_the_bodies_gives_newtons_increment(near):
    graph, count, base, m = Graph(), 4, 2, 2
    made = chain(graph, count, base, m)
    a, r = of_joints(*near)
    residual = np.array(linear(graph, a, r, made.z), object).reshape(count, base + m)
    schur = link_elimination.Schur(made, residual, lambda found: found)
    at = dict(zip(made.z, nodes(graph, np.zeros(len(made.z))), strict=True))
    columns, q = zip(*(schur.solved(k) for k in range(count)), strict=True)
    columns, q = ([substitute(graph, list(row), at) for row in rows] for rows in (columns, q))
    S = np.zeros((count, m, count, m))
    right = np.zeros((count, m))
    for i in range(count):
        row = numbers(schur.rows(i, q))
        for n, o in enumerate(link_elimination.NEAR):
            if 0 <= i + o < count:
                S[i, :, i + o] = row[n * m**2 : (n + 1) * m**2].reshape(m, m)
        right[i] = row[3 * m**2 :]
    multipliers = np.linalg.solve(S.reshape(count * m, -1), right.ravel())
    known = dict(zip(made.d, nodes(graph, multipliers), strict=True))
    found = [numbers(substitute(graph, schur.increment(k, columns[k]), known)) for k in range(count)]
    assert np.ravel(found) == pytest.approx(np.linalg.solve(a, -r))


def test_joints_of_three_links_and_bodies_that_act_on_each_other_are_none_of_a_chain():
    graph = Graph()
    made = chain(graph, 4, 2, 2)

    def schur(a):
        residual = np.array(linear(graph, a, np.zeros(16), made.z), object).reshape(4, 4)
        return link_elimination.Schur(made, residual, lambda found: found)

    with pytest.raises(NotLinked, match="joints act on more than two links"):
        schur(of_joints((-1, 0, 1), (-1, 0), (0,))[0])
    for place in ((0, 4), (0, 10), (3, 8)):  # body on body, on the multiplier and from the joint of a link far away
        a = of_joints((0, 1), (-1, 0), (0,))[0]
        a[place] = 1.0
        with pytest.raises(NotLinked, match="by more than the reactions of joints"):
            schur(a)


def test_rates_at_the_end_of_a_step_are_affine_in_the_impulse_of_joints_of_two_links():
    graph, m = Graph(), 2
    made = chain(graph, 3, 0, m)
    a, right = RANDOM.normal(size=(3, m, 3, m)), RANDOM.normal(size=(3, m))
    a[0, :, 2] = a[2, :, 0] = 0.0
    rate = np.array(linear(graph, a.reshape(3 * m, -1), right.ravel(), made.d), object).reshape(3, m)
    found = link_elimination.closing(made, rate, lambda nodes: nodes)
    for i in range(3):
        blocks = [a[i, :, i + o].ravel() if 0 <= i + o < 3 else np.zeros(m**2) for o in link_elimination.NEAR]
        assert numbers(found[i]).tolist() == np.concatenate([*blocks, -right[i]]).tolist()
    far, curved = graph.add(made.d[1], made.d[5]), graph.mul(made.d[0], made.d[0])
    for wrong, says in ((far, "more than two links"), (curved, "not affine")):
        rate[0, 0] = wrong
        with pytest.raises(NotLinked, match=says):
            link_elimination.closing(made, rate, lambda nodes: nodes)
