"""The chains of the benchmark of joints."""

from __future__ import annotations

import jax
import numpy as np
import pytest

import coadjoint as co
from benchmarks import joints
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.continuous import energy


@pytest.mark.long
def test_the_energy_of_records_is_that_of_the_system() -> None:
    system = joints.chain(2)
    xi, nu = np.random.default_rng(35).normal(size=(2, 2, 3))
    state = joints.level(system)
    state = state.replace(xi=xi.ravel(), nu=nu.ravel(), mu=(xi @ joints.INERTIA).ravel(), pi=nu.ravel())
    records = jax.tree.map(lambda leaf: np.asarray(leaf)[None], state)
    assert joints.energies(records)[0] == pytest.approx(float(evaluate(lambda s: energy(system, s), state)))


@pytest.mark.long
def test_a_chain_falls_in_native_code_with_a_small_error_of_energy() -> None:
    run = co.simulate(joints.chain(3), joints.level(joints.chain(3)), dt=0.002, steps=500, save_every=50)
    assert run.plan.backend == "native" and run.extrema["constraint_gap"][1] < 1e-14
    assert np.ptp(joints.energies(run.records)) < 1e-3 * 9 * joints.GRAVITY * joints.LENGTH / 2
