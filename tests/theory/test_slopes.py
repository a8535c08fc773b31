"""The slope of Λ along the ends of a step, and what a curve changes beyond them."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.theory.curves import trial
from coadjoint.theory.slopes import _through
from systems import random_system


@pytest.mark.parametrize("inner", [0, 2])
def test_a_slope_along_unknowns_is_one_along_the_ends_and_what_the_ends_do_not_see(inner):
    """∂_z = Eᵀ(D_F, ∂_s) + rest, E rest = 0."""
    random = np.random.default_rng(5)
    ends, slope = random.normal(size=(4, 4 + inner)), random.normal(size=4)
    _, _, free = np.linalg.svd(ends)
    rest = random.normal(size=inner) @ free[4:]
    group_part, shift, left = _through(jnp.asarray(ends), jnp.asarray(ends.T @ slope + rest), 3)
    np.testing.assert_allclose(np.append(group_part, shift), slope, rtol=1e-5)
    assert len(left) == (4 + inner if inner else 0)
    np.testing.assert_allclose(left, rest[: len(left)], atol=1e-5)


@pytest.mark.parametrize(
    "rule",
    [
        co.Midpoint(),
        co.LeftRectangle(co.Exponential()),
        co.Galerkin(co.Cayley(), degree=2),
    ],
    ids=lambda rule: rule.title,
)
def test_the_curve_of_a_step_has_its_relative_motion_and_its_action(rule):
    """Λ and F = g⁻¹g⁺ of a record, d = s − n, and nodes whose weights are those of one step."""
    h = np.float64(0.1)
    system, start = random_system("SE2")
    begun = rule.begin(system, start, h)
    random = np.random.default_rng(2)

    def both(state, z):
        record = rule.record(system, state, h, z)
        here = trial(system, rule, h, record)
        curve = here.curve(here.z, record.n, record.a)
        after = rule.advance(system, record, h)
        known = rule.relative(system, record, h), rule.discrete_lagrangian(system, record, h), after.n
        return curve, known, system.additional.act(system.group, curve.F, after.n) - record.n

    z = evaluate(lambda state: rule.guess(system, state, h), begun)
    curve, (F, value, _), d = evaluate(both, begun, z + 0.1 * random.normal(size=z.shape))
    for found, expected in zip(jax.tree.leaves(curve.F), jax.tree.leaves(F), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(curve.value, value, rtol=1e-12)
    np.testing.assert_allclose(curve.d, d, atol=1e-12)
    assert sum(place.weight for place in curve.places) == pytest.approx(1.0)
