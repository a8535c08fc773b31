"""Iterations with the matrix of an earlier one: they find the roots that Newton's method finds, each lane its own."""

from __future__ import annotations

import numpy as np
import pytest
from equations import Equations, Still

from coadjoint.kernels.program import CONTRACTION, FLOOR, REMAINDER, STALLED, TOLERANCE, Code
from coadjoint.kernels.run import native
from coadjoint.kernels.run.ensemble import lanes, run_ensemble

SEED = 5


def problem(random, n):
    """A regular matrix and a right side."""
    matrix = np.eye(n) * 3 + random.normal(size=(n, n)) / 4
    return matrix, random.normal(size=n)


def by_hand(matrix, right, curved, h):
    """The root by Newton's method with chords between, and the iterations, by the rules of `kernels.program`."""
    z, count, chords, floor = np.zeros_like(right), 0, True, FLOOR / h

    def largest(x):
        return np.max(np.abs(x))

    while True:
        jacobian = matrix + curved * np.diag(np.cos(z))

        def increment(z, jacobian=jacobian):
            return np.linalg.solve(jacobian, right - matrix @ z - curved * np.sin(z))

        step, quick = increment(z), chords
        z, count = z + step, count + 1
        if largest(step) <= TOLERANCE * largest(z) + floor:
            return z, count
        while quick:
            last, step = largest(step), increment(z)
            settled = largest(step) ** 2 <= last * (REMAINDER * largest(z + step) + 1e-3 * floor)
            chords = settled or largest(step) <= STALLED * last
            quick = chords and largest(step) <= CONTRACTION * last
            if chords:
                z, count = z + step, count + 1
            if settled:
                return z, count


@pytest.mark.parametrize("scale", [1e-3, 0.3, 3.0, 30.0], ids=["near", "mild", "curved", "far"])
def test_chords_find_the_root_in_the_iterations_that_their_rules_give_by_hand(scale):
    print(f"seed {SEED}")
    random = np.random.default_rng(SEED)
    matrix, right = problem(random, 3)
    expected, count = by_hand(matrix, right * scale, 1.9, 0.1)
    chunk = native.run(Still((Equations(1.9),)), matrix, right * scale, 0.1, 1, 1)
    assert chunk.code is Code.CONVERGED
    np.testing.assert_allclose(chunk.records[0], expected, rtol=1e-13)
    assert chunk.iterations == count


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
