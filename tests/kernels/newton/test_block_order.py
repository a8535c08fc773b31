"""The block triangular order, and systems that need pivots."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import pytest
from equations import Equations, Still

from coadjoint.kernels.emit.plan import plan
from coadjoint.kernels.emit.stepping import assemble
from coadjoint.kernels.expressions.graph import Graph
from coadjoint.kernels.newton.increments import _affine, blocks, matching, scheme
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import native


def test_blocks_come_before_those_that_need_them():
    # Unknown 2 alone; 0 and 1 need each other and 2; 3 needs 1.
    assert blocks([[0, 1, 2], [0, 1], [2], [1, 3]]) == [[2], [0, 1], [3]]


def test_rows_are_matched_to_unknowns_off_the_diagonal():
    assert matching([[1], [0, 2], [0]]) == [2, 0, 1]
    assert matching([[0], [0], [1, 2]]) is None


def test_an_unknown_whose_row_holds_one_that_is_not_affine_is_none_either():
    """x² = …, y − x = …, z = …: the rows of y and z have constant derivatives."""
    graph = Graph()
    x, y, z = (graph.symbol(name) for name in "xyz")
    rows = [{0: graph.add(x, x)}, {0: graph.constant(-1.0), 1: graph.constant(1.0)}, {2: graph.constant(3.0)}]
    assert _affine([[2], [0], [1]], rows, (x, y, z)) == {2}


def test_an_affine_row_of_one_unknown_starts_from_zero_and_coupled_ones_from_the_guess():
    """2x = p, and 2y + z = p, y + 2z = p: elimination of y and z may lose digits, those of an increment alone."""
    graph = Graph()
    x, y, z, p, *guess = (graph.symbol(name) for name in ("x", "y", "z", "p", "a", "b", "c"))
    two = graph.constant(2.0)
    sums = [graph.mul(two, x), graph.add(graph.mul(two, y), z), graph.add(y, graph.mul(two, z))]
    found = scheme(graph, (x, y, z), guess, [graph.sub(s, p) for s in sums], [p])
    assert found.start == [graph.zero, *guess[1:]]
    assert found.first.right[0] is p


def test_no_division_of_newtons_method_is_reordered():
    """LLVM would turn (1/m) r into r/m, and divide at every step by an m that never changes."""
    given = np.eye(3), np.ones(3)
    assembly = assemble(plan(Still((Equations(0.1),)), *given, (2,) * 9, False))
    assert "fdiv " in assembly
    assert "fdiv reassoc" not in assembly and "fdiv contract" not in assembly


def found(matrix, right, curved=0.0):
    return native.run(Still((Equations(curved),)), matrix, right, 0.1, 1, 1)


@pytest.mark.cases(3)
@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6, 7, 9])
@pytest.mark.parametrize("curved", [0.0, 0.1], ids=["affine", "curved"])
def test_newton_solves_systems_of_every_size(n, curved):
    random = np.random.default_rng(n)
    matrix, right = np.eye(n) * 3 + random.normal(size=(n, n)) / 2, random.normal(size=n)
    chunk = found(matrix, right, curved)
    assert chunk.code is Code.CONVERGED
    np.testing.assert_allclose(matrix @ chunk.records[0] + curved * np.sin(chunk.records[0]), right, atol=1e-13)
    assert chunk.iterations == 1 or curved


def nearly_antisymmetric(n, symmetric):
    """A regular matrix whose last three rows and columns are ω̂ but for a small diagonal, as of light charged bodies."""
    random, matrix, body = np.random.default_rng(n), np.zeros((n, n)), n - 3
    matrix[body:, body:] = np.cross(np.eye(3), [0.3, -0.7, 0.5]) + symmetric * np.diag([1.0, 2.0, 3.0])
    matrix[:body, :body] = 3.0 * np.eye(body) + random.normal(size=(body, body)) / 4
    matrix[:body, body:] = 1e-3 * random.normal(size=(body, 3))
    matrix[body:, :body] = 1e-9 * random.normal(size=(3, body))
    return matrix, random.normal(size=n)


@pytest.mark.parametrize(
    ("n", "symmetric", "curved"),
    [(3, 1e-6, 0.0), (3, 1e-10, 0.0), (5, 1e-4, 0.0), (5, 1e-6, 0.0), (6, 1e-8, 0.0), (5, 1e-8, 1e-9)],
)
def test_last_pivots_that_lose_digits_are_not_used(n, symmetric, curved):
    """Without pivots by size the residuals are 1e-13 to 2, of runs that report success."""
    matrix, solution = nearly_antisymmetric(n, symmetric)
    right = matrix @ solution + curved * np.sin(solution)
    chunk = found(matrix, right, curved)
    assert chunk.code is Code.CONVERGED
    residual = matrix @ chunk.records[0] + curved * np.sin(chunk.records[0]) - right
    assert np.max(np.abs(residual)) < 1e-14 * np.max(np.abs(solution))
    assert chunk.iterations <= (1 if curved == 0.0 else 8)


SINGULAR = np.arange(1.0, 10.0).reshape(3, 3)


@pytest.mark.parametrize("n", [4, 6, 7])
def test_a_singular_corner_is_solved_with_pivots(n):
    random = np.random.default_rng(n)
    matrix, right = random.normal(size=(n, n)), random.normal(size=n)
    # The corner that the closed form would invert has no inverse, but no zeros either.
    matrix[:3, :3] = SINGULAR
    assert np.linalg.cond(matrix) < 1e3
    chunk = found(matrix, right)
    np.testing.assert_allclose(chunk.records[0], np.linalg.solve(matrix, right), rtol=1e-10)


@dataclass(frozen=True)
class CurvedAtTheEnd(Equations):
    """A z + ε sin z = s in the last row alone, and A z = s in the others."""

    def residual(self, p, s, h, z):
        return p @ z - s + self.curved * jnp.concatenate([0 * z[:-1], jnp.sin(z[-1:])])


@pytest.mark.cases(2)
@pytest.mark.parametrize("n", [5, 6, 8])
def test_a_singular_corner_behind_an_unknown_that_stands_alone_is_solved_with_pivots(n):
    random = np.random.default_rng(3)
    matrix, right = random.normal(size=(n, n)), random.normal(size=n)
    matrix[0, 1:] = 0.0
    matrix[1:4, 1:4] = SINGULAR
    chunk = native.run(Still((CurvedAtTheEnd(0.1),)), matrix, right, 0.1, 1, 1)
    assert chunk.code is Code.CONVERGED
    z = chunk.records[0]
    np.testing.assert_allclose(matrix @ z + 0.1 * np.sin(z) * (np.arange(n) == n - 1), right, atol=1e-12)


@pytest.mark.parametrize("n", [3, 6])
def test_rows_and_columns_may_have_any_scale(n):
    random = np.random.default_rng(4)
    rows, columns = 10.0 ** random.integers(-9, 9, size=n), 10.0 ** random.integers(-9, 9, size=n)
    matrix = (np.eye(n) * 3 + random.normal(size=(n, n)) / 2) * rows[:, None] * columns
    exact = random.normal(size=n) / columns
    np.testing.assert_allclose(found(matrix, matrix @ exact).records[0] * columns, exact * columns, rtol=1e-11)


def test_a_zero_diagonal_is_no_obstacle():
    matrix = np.array([[0.0, 2.0, 0.0], [0.0, 0.0, 4.0], [8.0, 0.0, 0.0]])
    np.testing.assert_array_equal(found(matrix, np.ones(3)).records[0], [0.125, 0.5, 0.25])


def test_a_singular_system_is_not_finite():
    assert found(np.ones((3, 3)), np.array([1.0, 2.0, 3.0])).code is Code.NOT_FINITE
    assert found(np.ones((6, 6)), np.arange(6.0)).code is Code.NOT_FINITE
