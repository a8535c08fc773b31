"""The node forms of the rules (mathematics: section 6) are the derivatives of their discrete Lagrangians."""

from __future__ import annotations

import jax.numpy as jnp
import pytest

import action
from coadjoint.kernels.trace.evaluate import evaluate
from systems import ALL_RULES, MAPS, WORLDS, all_cases, generator, pairwise_cases, random_system

H = 0.2
ROUND_OFF = 1e-14
"""Of the largest momentum, |(μ, π)|∞ at both ends."""

SINGLE = [case for case in pairwise_cases() if case[2] != "pair"]
SINGLE += [(world, list(MAPS)[(i + 1) % len(MAPS)], "simpson") for i, world in enumerate(WORLDS)]


def _check(world, tau, rule):
    system, start = random_system(world, forced=True)
    step = ALL_RULES[rule](MAPS[tau])
    z = 0.7 * generator("unknowns", world, tau, rule).normal(size=system.unknowns)

    def errors(state, z):
        """With (μ_k, π_k) from dΛ, the equations of the step at z hold and it ends with (μ_{k+1}, π_{k+1})."""
        record = step.record(system, state, H, z)
        expected = action.boundary_momenta(system, step, record, H)
        record = record.replace(mu=expected.eta, pi=expected.w)
        after = step.advance(system, record, H)
        F = action.increment(system, step, H * record.xi)
        back = system.group.inverse(F)
        s = action.chord_end(system, step, record, H)
        mismatch = {
            "equations": step.equations(system, record, H),
            "mu": after.mu - expected.eta_next,
            "pi": after.pi - expected.w_next,
            "n": after.n - system.additional.act(system.group, back, s),
            "a": after.a - system.advected.act(system.group, back, record.a),
            "g": system.group.matrix(after.g) - system.group.matrix(record.g) @ system.group.matrix(F),
        }
        scale = jnp.max(jnp.abs(jnp.concatenate(expected)))
        return {name: jnp.max(jnp.abs(error), initial=0.0) for name, error in mismatch.items()}, scale

    found, scale = evaluate(errors, start, z)
    for name, error in found.items():
        assert error <= ROUND_OFF * max(scale, 1.0), name


@pytest.mark.cases(1)
@pytest.mark.parametrize(("world", "tau", "rule"), SINGLE)
def test_node_form_is_the_derivative_of_the_discrete_lagrangian(world, tau, rule):
    _check(world, tau, rule)


@pytest.mark.long
@pytest.mark.parametrize(("world", "tau", "rule"), [case for case in all_cases() if case[2] != "pair"])
def test_every_node_form_is_the_derivative_of_its_discrete_lagrangian(world, tau, rule):
    _check(world, tau, rule)


def test_the_middle_node_of_simpsons_rule_is_off_the_chord_on_a_sphere():
    _check("SO3 on a sphere", "cayley", "simpson")
