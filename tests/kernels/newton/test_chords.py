"""Iterations with the matrix of an earlier one: they find the roots that Newton's method finds, each lane its own."""

from __future__ import annotations

import numpy as np
import pytest
from equations import Equations, Still

from coadjoint.kernels.program import Code
from coadjoint.kernels.run import native
from coadjoint.kernels.run.ensemble import lanes, run_ensemble

SEED = 5


def problem(random, n):
    """A regular matrix and a right side."""
    matrix = np.eye(n) * 3 + random.normal(size=(n, n)) / 4
    return matrix, random.normal(size=n)


def plain(matrix, right, curved):
    """The root by Newton's method, and its iterations until the increment is below 1e-7 of the unknowns."""
    z, step, count = np.zeros_like(right), np.ones_like(right), 0
    while np.max(np.abs(step)) > 1e-7 * np.max(np.abs(z)):
        step = np.linalg.solve(matrix + curved * np.diag(np.cos(z)), right - matrix @ z - curved * np.sin(z))
        z, count = z + step, count + 1
    return z, count


@pytest.mark.parametrize("scale", [1e-3, 0.3, 3.0, 30.0], ids=["near", "mild", "curved", "far"])
def test_chords_find_the_roots_that_newton_finds_with_few_iterations_more(scale):
    print(f"seed {SEED}")
    random = np.random.default_rng(SEED)
    matrix, right = problem(random, 3)
    expected, count = plain(matrix, right * scale, 1.9)
    chunk = native.run(Still((Equations(1.9),)), matrix, right * scale, 0.1, 1, 1)
    assert chunk.code is Code.CONVERGED
    np.testing.assert_allclose(chunk.records[0], expected, rtol=1e-13)
    assert chunk.iterations <= count + 4


def test_no_lane_depends_on_its_neighbours():
    print(f"seed {SEED}")
    random = np.random.default_rng(SEED)
    count = 4 * lanes()
    matrix, right = problem(random, 3)
    scales = np.geomspace(1e-6, 30.0, count)
    rights = right * scales[:, None]
    program = Still((Equations(1.9),))

    def found(order):
        chunk = run_ensemble(program, matrix, rights[order], 0.1, 1, 1, axes=(False, True), threads=1)
        return {int(i): (chunk.records[k].tolist(), int(chunk.iterations[k])) for k, i in enumerate(order)}

    sorted_, mixed = found(np.arange(count)), found(random.permutation(count))
    assert sorted_ == mixed
    assert len({iterations for _, iterations in sorted_.values()}) > 2
