"""The families of systems by which the benchmark of sizes grows."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from benchmarks import large
from coadjoint.kernels.trace.evaluate import evaluate


@pytest.mark.cases(1)
@pytest.mark.parametrize("size", [2, 3, 4])
def test_a_basis_of_a_unitary_group_spans_it(size: int) -> None:
    for special, dim in ((True, size**2 - 1), (False, size**2)):
        group = large.unitary(size, special)
        assert group.dim == dim
        xi = 0.3 * np.cos(np.arange(dim))
        g = co.groups.complex_form(evaluate(lambda xi, group=group: group.matrix(group.exp(xi)), xi))
        assert np.max(np.abs(g.conj().T @ g - np.eye(size))) < 1e-12
        assert (abs(np.linalg.det(g) - 1) < 1e-12) == special


@pytest.mark.long
def test_a_chain_has_the_unknowns_that_are_asked_for_and_keeps_its_momentum() -> None:
    system, start = large.chain(12)
    assert system.unknowns == 12
    run = co.simulate(system, start, dt=0.01, steps=200)
    assert run.plan.backend == "native"
    assert run.relative_change("kelvin_noether") < 1e-12
