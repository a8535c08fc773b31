"""Every method on every system with a closed-form answer: it converges to the truth at its order, and conserves."""

from __future__ import annotations

import numpy as np
import pytest
from free_rigid_body import FREE_RIGID_BODIES
from gyrostats import GYROSTATS
from heavy_tops import HEAVY_TOPS
from problem import Problem
from sinking_bodies import VEHICLES

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.continuous import energy

METHODS: list[co.methods.Method] = [
    co.LeftRectangle(co.Cayley()),
    co.RightRectangle(co.Exponential()),
    co.Midpoint(co.Cayley()),
    co.Trapezoidal(co.Exponential()),
    co.methods.LeftRight(co.Cayley()),
    co.Suzuki4(co.Midpoint(co.Exponential())),
]
PROBLEMS: list[Problem] = [*FREE_RIGID_BODIES, *GYROSTATS, *HEAVY_TOPS, *VEHICLES]
ULP_A_STAGE = 4e-16
"""Round-off that a stage may leave in g and in the momentum: in a relative equilibrium every step rounds alike, so that
it adds up (measured: 2e-16 a stage at worst)."""
AMPLIFIED = 50
"""By how much the angles of a run amplify it; an error below says nothing about an order."""


def title(thing: Problem | co.methods.Method) -> str:
    return thing.title


@pytest.mark.cases(9)
@pytest.mark.parametrize("problem", PROBLEMS, ids=title)
def test_the_start_has_the_state_and_the_energy_of_the_closed_form(problem: Problem):
    for name, values in problem.exact(np.zeros(1)).items():
        found, scale = getattr(problem.start, name), 1 + np.max(np.abs(values))
        assert np.max(np.abs(found - values[0])) <= 2e-14 * scale, name
    assert float(evaluate(energy, problem.system, problem.start)) == pytest.approx(problem.energy, rel=1e-13)


@pytest.mark.cases(1)
@pytest.mark.parametrize("problem", PROBLEMS, ids=title)
@pytest.mark.parametrize("method", METHODS, ids=title)
def test_a_method_converges_to_the_exact_motion_at_its_order_and_conserves(method: co.methods.Method, problem: Problem):
    errors, energies, floors = [], [], []
    for fraction in (1, 2, 4):
        steps = fraction * round(problem.duration / problem.dt)
        run = co.simulate(
            problem.system, problem.start, dt=problem.dt / fraction, steps=steps, method=method, save_every=fraction
        )
        errors.append(problem.error(run.records, run.steps_saved * run.dt))
        reached = np.ravel(run.extrema["energy"]) - problem.energy
        energies.append(float(np.max(np.abs(reached))) / max(abs(problem.energy), 1.0))
        allowed = 1e-14 + ULP_A_STAGE * steps * len(method.stages)
        floors.append(AMPLIFIED * allowed)
        assert run.relative_change("kelvin_noether") <= allowed and run.largest("group_defect") <= allowed
        assert run.largest("balance") <= 1e-14
    print(f"{method.title}, {problem.title}: errors {errors}, energy {energies}")
    assert errors[-1] <= 0.05
    _assert_order(errors, floors, method.order)
    _assert_order(energies, floors, method.order)


def _assert_order(errors: list[float], floors: list[float], order: int) -> None:
    """The last halving above round-off divides the error by 2^order or more."""
    seen = [error for error, floor in zip(errors, floors, strict=True) if error > floor]
    if len(seen) > 1:
        assert np.log2(seen[-2] / seen[-1]) >= order - 0.15, errors
