"""Native code takes the steps that XLA takes, on every world, map and rule.

The reference is the XLA path's own step function on NumPy arrays, which needs no compilation; the real XLA path joins
in `long`. States are compared after `STEPS` steps relative to their size; random systems are nowhere stiff.
"""

import jax
import numpy as np
import pytest

from coadjoint.kernels.run import native, xla
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods.program import Constants, StepProgram
from systems import MAPS, RULES, all_cases, pairwise_cases, random_system

STEPS, H = 6, 0.05

INDEXED = [
    (index, case) if index % 4 in (0, 3) else pytest.param(index, case, marks=pytest.mark.long)
    for index, case in enumerate(pairwise_cases())
]
"""Half of the pairwise cases always, free and forced ones; they meet every world, map and rule."""


def prepared(case, forced):
    world, tau, rule = case
    system, start = random_system(world, forced)
    method = RULES[rule](MAPS[tau])
    program = StepProgram(replace_parameters(system, None), method)
    return program, Constants(system.parameters, None), method.begin(system, start, H)


def assert_same(one, other):
    for left, right in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        scale = max(1.0, float(np.max(np.abs(right), initial=0.0)))
        assert np.max(np.abs(left - right), initial=0.0) < 1e-12 * scale


def check(case, forced, reference):
    program, constants, state = prepared(case, forced)
    chunk = native.run(program, constants, state, H, STEPS, 1, monitors=False)
    records, final, iterations = reference(program, constants, state)
    assert chunk.steps == STEPS
    assert_same(chunk.records, records)
    assert_same(chunk.final, final)
    # Chords shrink by a factor, where Newton's increments are squared.
    assert chunk.iterations <= 2 * iterations


def by_numpy(program, constants, state):
    step = tabulate(lambda c, s, h: xla.step(program, c, s, h), constants, state, np.float64(H))
    records, iterations = [], 0
    for _ in range(STEPS):
        result = step(constants, state, np.float64(H))
        assert result.code == 0
        records.append(result.record)
        state, iterations = result.after, iterations + int(result.iterations)
    return jax.tree.map(lambda *rows: np.stack(rows), *records), state, iterations


def by_xla(program, constants, state):
    chunk = xla.run(program, constants, state, H, STEPS, 1, monitors=False)
    return chunk.records, chunk.final, chunk.iterations


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("index", "case"), INDEXED)
def test_native_steps_are_the_steps_of_the_reference(index, case):
    """Free and forced systems in turn."""
    check(case, index % 2 == 1, by_numpy)


@pytest.mark.long
@pytest.mark.parametrize("case", all_cases(), ids="-".join)
def test_native_steps_are_the_steps_of_the_reference_in_all_cases(case):
    check(case, False, by_numpy)


@pytest.mark.long
@pytest.mark.parametrize("case", pairwise_cases()[::3], ids="-".join)
def test_native_steps_are_those_of_xla(case):
    check(case, True, by_xla)
