"""Forced runs satisfy the discrete Euler–Poincaré equations (P42)–(P44) and Theorem 7, and symmetric rules go back."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest

import action
import coadjoint as co
from coadjoint.kernels.trace.evaluate import tabulate
from stepping import Leap, Stepper, tabulated
from systems import MAPS, RULES, SL2, all_cases, generator, pairwise_cases, random_system

H, STEPS = 0.15, 3
ROUND_OFF = 1e-13
"""Of the largest momentum |(μ, π)|∞ along the run, of 1 + |n|∞, of 1 + |a|∞; Newton stops near 1e-14 of them."""


class Run(NamedTuple):
    """A forced run of random systems; `scale` is its largest momentum."""

    world: str
    stepper: Stepper
    leaps: list[Leap]
    scale: float


def forced_run(world: str, tau: str, rule: str) -> Run:
    system, start = random_system(world, forced=True)
    stepper = Stepper(system, RULES[rule](MAPS[tau]))
    leaps = stepper.run(start, H, STEPS)
    momenta = [np.concatenate([leap.record.mu, leap.record.pi]) for leap in leaps]
    return Run(world, stepper, leaps, max(np.max(np.abs(m)) for m in momenta))


pytestmark = pytest.mark.cases(1)  # which shares what the fixture prepares


@pytest.fixture(
    scope="module",
    params=pairwise_cases()
    + [pytest.param(case, marks=pytest.mark.long) for case in all_cases() if case not in pairwise_cases()],
    ids="-".join,
)
def run(request) -> Run:
    return forced_run(*request.param)


def close(found, expected, scale) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUND_OFF * scale)


def size(x) -> float:
    return 1 + np.max(np.abs(x), initial=0.0)


def kelvin_noether(world: str, system: co.System) -> co.mechanics.KelvinNoether:
    """A random c₀ with an equivariant 𝒦 that uses the advected parameters where the world has room for it."""
    group = system.group
    choices = {
        "SO3": (co.Defining(), lambda c, a: jnp.sin(c @ a.down) * c + jnp.cross(c, a.spin) + (c @ c) * a.spin),
        "SE2": (co.spaces.Adjoint(), lambda c, a: c + group.ad(c, a.twist)),
        "SE3": (co.spaces.Adjoint(), lambda c, a: jnp.cos(a.field @ c) * c),
        "SL2": (co.Defining(), lambda c, a: SL2.vee(jnp.outer(c, a) - 0.5 * (c @ a) * jnp.eye(2))),
        "Heisenberg": (co.spaces.Adjoint(), lambda c, a: 2 * a + group.ad(c, a)),
        "SO3xSE2": (co.spaces.Adjoint(), lambda c, a: jnp.exp(0.1 * (a @ c)) * c),
        "SO3 on a sphere": (co.Defining(), jnp.cross),
    }
    space, K = choices.get(world, (co.spaces.Adjoint(), None))
    return co.mechanics.KelvinNoether(generator("c0", world).normal(size=space.ambient(group)), K, space)


def test_consecutive_steps_satisfy_the_discrete_equations(run):
    system = run.stepper.system

    def geometry(system, step, record, h):
        F = action.increment(system, step, h * record.xi)
        back, s = system.group.inverse(F), action.chord_end(system, step, record, h)
        end = system.group.matrix(record.g) @ system.group.matrix(F)
        return end, system.additional.act(system.group, back, s), system.advected.act(system.group, back, record.a)

    momenta = tabulated(action.boundary_momenta, system, run.leaps)
    ends = tabulated(geometry, system, run.leaps)
    matrix = tabulate(system.group.matrix, run.leaps[0].record.g)
    for leap, here, (g, n, a) in zip(run.leaps, momenta, ends, strict=True):
        close(leap.record.mu, here.eta, run.scale)
        close(leap.record.pi, here.w, run.scale)
        close(leap.after.mu, here.eta_next, run.scale)
        close(leap.after.pi, here.w_next, run.scale)
        close(leap.after.n, n, size(n))
        close(leap.after.a, a, size(a))
        close(matrix(leap.after.g), g, size(g))
    for before, after in pairwise(momenta):
        close(before.eta_next, after.eta, run.scale)
        close(before.w_next, after.w, run.scale)


def test_balance_of_theorem_7(run):
    system = run.stepper.system
    group, Q, V = system.places
    noether = kelvin_noether(run.world, system)
    noether.require_equivariant(system, run.leaps[0].record)

    def sides(system, step, record, h, after):
        """I_{k+1} − I_k, its value by Theorem 7 from Λ and the virtual work, and by the step's own sources."""
        slope = action.gradients(system, step, record, h)[3]
        force = action.boundary_forces(system, step, record, h)
        K, K_next = noether.momentum_map(system, record), noether.momentum_map(system, after)
        ahead = action.diamond(V, group, slope, record.a) + force.eta - action.diamond(Q, group, force.w, record.n)
        behind = force.eta_next - action.diamond(Q, group, force.w_next, after.n)
        change = noether.quantity(system, after) - noether.quantity(system, record)
        sources = step.sources(system, record, h)
        largest = jnp.max(jnp.abs(jnp.concatenate([K, K_next])))
        return change, K @ ahead + K_next @ behind, K @ sources[0] + K_next @ sources[1], largest

    traced = {}
    for leap in run.leaps:
        if leap.step not in traced:
            traced[leap.step] = tabulate(partial(sides, system, leap.step), leap.record, leap.h, leap.after)
        change, by_action, by_sources, largest = traced[leap.step](leap.record, leap.h, leap.after)
        scale = run.scale * largest * size(leap.record.n) * group.dim
        assert abs(change) > 1e-5 * scale, "a balance of nothing proves nothing"
        close(change, by_action, scale)
        close(change, by_sources, scale)


def test_balance_residual_certifies_a_step_and_sees_a_wrong_one(run):
    system, leap = run.stepper.system, run.leaps[-1]
    balance = tabulate(partial(leap.step.balance, system), leap.record, leap.h, leap.after)
    assert balance(leap.record, leap.h, leap.after) <= ROUND_OFF
    wrong = leap.after.replace(mu=leap.after.mu + 1e-6 * run.scale)
    assert balance(leap.record, leap.h, wrong) > 1e-8


def test_a_symmetric_step_is_undone_by_the_step_back(run):
    if not run.stepper.method.symmetric:
        pytest.skip("the rule is not symmetric")
    ahead = run.leaps[-len(run.stepper.method.stages) :]
    start, back = ahead[0].record, run.stepper.leaps(ahead[-1].after, -H)[-1].after
    matrix = tabulate(run.stepper.system.group.matrix, start.g)
    close(matrix(back.g), matrix(start.g), size(matrix(start.g)))
    close(back.t, start.t, 1.0)
    close(back.n, start.n, size(start.n))
    close(back.a, start.a, size(start.a))
    close(back.mu, start.mu, run.scale)
    close(back.pi, start.pi, run.scale)
