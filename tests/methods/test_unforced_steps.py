"""Unforced steps keep the discrete two-form and every momentum of the isotropy algebra, and satisfy (P52)."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest

import action
import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.noether import isotropy_algebra, spatial_momentum, total_momentum
from stepping import Leap, tabulated
from systems import MAPS, RULES, all_cases, generator, pairwise_cases, random_system
from two_form import carry, tangents

H, STEPS = 0.15, 3
ROUND_OFF = 2e-13
"""Of the sum of the absolute terms of the two-form; of the largest momentum times 1 + |n|∞ for conserved momenta."""


class Run(NamedTuple):
    """An unforced run whose every stage carried two random tangents along."""

    system: co.System
    leaps: list[Leap]
    two_forms: list[tuple[float, float, float]]
    scale: float


pytestmark = pytest.mark.cases(2)  # which share what the fixture prepares


@pytest.fixture(
    scope="module",
    params=pairwise_cases()
    + [pytest.param(case, marks=pytest.mark.long) for case in all_cases() if case not in pairwise_cases()],
    ids="-".join,
)
def run(request) -> Run:
    world, tau, rule = request.param
    system, state = random_system(world)
    method, random = RULES[rule](MAPS[tau]), generator("tangents", world)
    traced, leaps, forms = {}, [], []
    for _ in range(STEPS):
        for step, fraction in method.stages:
            arguments = (state, fraction * H, tangents(system, state, random), tangents(system, state, random))
            if step not in traced:
                traced[step] = tabulate(partial(carry, system, step), *arguments)
            record, after, code, form = traced[step](*arguments)
            assert code == 0
            leaps.append(Leap(step, fraction * H, record, after))
            forms.append(form)
            state = after
    momenta = [np.concatenate([leap.record.mu, leap.record.pi]) for leap in leaps]
    return Run(system, leaps, forms, max(np.max(np.abs(m)) for m in momenta))


def test_steps_are_symplectic(run):
    for before, after, size in run.two_forms:
        assert abs(before) > 1e-4 * size, "a two-form of nothing proves nothing"
        assert abs(after - before) <= ROUND_OFF * size


def test_momenta_of_the_isotropy_algebra_are_conserved(run):
    system = run.system
    directions = isotropy_algebra(system, run.leaps[0].record)
    if not len(directions):
        pytest.skip("no direction leaves every advected parameter alone")
    momentum = tabulate(partial(spatial_momentum, system), run.leaps[0].record)
    first, last = directions @ momentum(run.leaps[0].record), directions @ momentum(run.leaps[-1].after)
    reach = max(np.max(np.abs(evaluate(system.group.matrix, x.after.g))) for x in run.leaps) ** 2
    size = 1 + max(np.max(np.abs(leap.after.n), initial=0.0) for leap in run.leaps)
    np.testing.assert_allclose(last, first, rtol=0, atol=ROUND_OFF * run.scale * size * reach * system.group.dim)


def test_paper_quantity_satisfies_its_balance(run):
    """(P51)_k = ⟨𝒦_k, (dτ⁻¹_{hξ})*∂_ξΛ/h − ∂_sΛ⋄s⟩, (P52): (P51)_k − (P51)_{k−1} = ⟨𝒦_k, ∂_aΛ⋄a_k⟩, 𝒦 = c."""
    system = run.system
    group, Q, V = system.places
    noether = co.mechanics.KelvinNoether(generator("c0").normal(size=group.dim))

    def quantities(system, step, record, h):
        tau = co.difference_maps.Squared(step.difference_map) if isinstance(step, co.Midpoint) else step.difference_map
        slopes = action.gradients(system, step, record, h)
        s = action.chord_end(system, step, record, h)
        K = noether.momentum_map(system, record)
        momentum = tau.dtau_inverse_dual(group, h * record.xi, slopes[0] / h) - Q.diamond(group, slopes[2], s)
        source = K @ V.diamond(group, slopes[3], record.a)
        offered = noether.paper_quantity(system, step, record, h)
        return K @ momentum, source, K @ total_momentum(system, record), offered, jnp.max(jnp.abs(K))

    rows = tabulated(quantities, system, run.leaps)
    size = 1 + max(np.max(np.abs(leap.after.n), initial=0.0) for leap in run.leaps)
    allowed = ROUND_OFF * run.scale * size * max(row[-1] for row in rows) * group.dim
    for paper, source, ours, offered, _ in rows:
        assert abs(paper - ours - source) <= allowed
        assert abs(paper - offered) <= allowed
    for (before, *_), (after, source, *_) in pairwise(rows):
        assert abs(after - before - source) <= allowed


@pytest.mark.parametrize(("world", "tau", "rule"), pairwise_cases()[::3])
def test_velocity_start_makes_the_given_velocities_the_first_unknowns(world, tau, rule):
    system, start = random_system(world)
    method = RULES[rule](MAPS[tau], start="velocity")
    begun = method.begin(system, start, H)
    step, fraction = method.stages[0]

    def residual(state, h):
        z = step.guess(system, state, h)
        return z, step.residual(system, state, h, z)

    z, error = evaluate(residual, begun, fraction * H)
    momentum = np.max(np.abs(np.concatenate([begun.mu, begun.pi])))
    np.testing.assert_array_equal(z[: system.group.dim], start.xi)
    if system.additional.flat:
        np.testing.assert_array_equal(z[system.group.dim :], start.nu)
    assert np.max(np.abs(error)) <= ROUND_OFF * momentum
    other = np.max(np.abs(np.concatenate([begun.mu - start.mu, begun.pi - start.pi])))
    assert other > 1e-3 * momentum, "the momentum start is another one"
