"""F± and J±: the right discrete Legendre transform of a step is the left one of the next, for every method."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.noether import isotropy_algebra
from coadjoint.methods.step import Step
from coadjoint.theory.curves import NODES
from discrete import at, random_group_system, random_path
from systems import MAPS, flat, random_system

H = 0.1
ROUND_OFF = 5e-14
"""Of the largest momentum."""


@lru_cache
def with_discrete_lagrangian(world: str) -> tuple[co.System, co.State]:
    """The forced random system of a world with Λ(ξ, n, s, a; h) of t, that of a rule with its node a little inside."""
    system, start = random_system(world, forced=True)
    Q, V = system.additional.ambient(system.group), system.advected.ambient(system.group)

    def discrete(xi, *rest, t):
        h, (n, s) = rest[-1], map(flat, rest[:2] if Q else (np.zeros(0),) * 2)
        a = flat(rest[-3]) if V else np.zeros(0)
        return h * system.reduced_lagrangian(xi, 0.7 * n + 0.3 * s, (s - n) / h, a, t + 0.4 * h)

    made = co.System(
        system.group, discrete_lagrangian=discrete, additional=system.additional, advected=system.advected,
        forces=system.forces, parameters=system.parameters,
    )  # fmt: skip
    return made, start.replace(from_velocities=False)


@lru_cache
def without_time(world: str) -> tuple[co.System, co.State]:
    """The random system of a world with an ℓ that does not take t, as co.methods.VariableStep asks for."""
    system, start = random_system(world)

    def lagrangian(*arguments):
        return system.lagrangian(*arguments, t=0.0)

    spaces: dict = {"additional": system.additional, "advected": system.advected}
    return co.System(system.group, lagrangian, parameters=system.parameters, **spaces), start


METHODS = {
    "left": ("SO3", co.methods.LeftRectangle(co.Exponential())),
    "right": ("SE2", co.methods.RightRectangle(MAPS["bent"])),
    "trapezoidal": ("SL2", co.Trapezoidal()),
    "midpoint": ("SO3 on a sphere", co.Midpoint()),
    "simpson": ("Heisenberg", co.Simpson(co.Exponential())),
    "galerkin": ("SE2", co.Galerkin(degree=2)),
    "galerkin 3": ("SO3", co.Galerkin(co.Exponential(), degree=3)),
    "variational": ("SL2", co.Variational()),
    "adjoint variational": ("SO3", co.methods.AdjointVariational()),
    "group variational": ("SO3xSE2", co.methods.GroupVariational(co.Exponential(), "velocity")),
    "group variational on a sphere": ("SO3 on a sphere", co.methods.GroupVariational(co.Exponential(), "velocity")),
    "pair": ("SE2", co.methods.LeftRight()),
    "symmetrised": ("SO3 on a sphere", co.methods.Symmetrised(co.methods.RightRectangle())),
    "suzuki": ("R3", co.Suzuki4(co.Midpoint())),
    "variable": ("SO3", co.methods.VariableStep()),
}
UNFORCED = ("suzuki", "variable")
"""Substeps backwards, and a held energy, refuse dissipation."""
LONG = ("galerkin 3", "symmetrised", "group variational", "simpson", "pair")


@lru_cache
def run_of(name: str):
    world, method = METHODS[name]
    made = {"variable": without_time, "variational": with_discrete_lagrangian}
    made["adjoint variational"] = with_discrete_lagrangian
    if isinstance(method, co.methods.GroupVariational):
        system, start = random_group_system(world, forced=True)
    elif name in made:
        system, start = made[name](world)
    else:
        system, start = random_system(world, forced=name not in UNFORCED)
    return co.simulate(system, start, dt=H, steps=5, method=method, monitors=False)


@pytest.mark.long
@pytest.mark.cases(4)
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.long) if n in LONG else n for n in METHODS])
def test_the_right_transform_of_a_step_is_the_left_one_of_the_next(name):
    """F⁺_{k} = F⁻_{k+1} and J⁺_k = J⁻_{k+1}, and both are the momenta that the method carries; forced and timed."""
    run = run_of(name)
    found = theory.discrete_legendre(run.system, run.method, run.records, H)
    maps = theory.discrete_momentum_maps(run.system, run.method, run.records, H)
    Q, group = run.system.additional, run.system.group
    on_space = jax.vmap(lambda n, b: Q.coordinates(group, n, b))
    size = max(np.max(np.abs(run.records.mu)), np.max(np.abs(run.records.pi), initial=0.0))
    pairs = [
        (found.plus.mu[:-1], found.minus.mu[1:]),
        (found.minus.mu, run.records.mu),
        (maps.plus[:-1], maps.minus[1:]),
    ]
    for x, y in ((found.plus.pi[:-1], found.minus.pi[1:]), (found.minus.pi[1:], run.records.pi[1:])):
        pairs.append(tuple(evaluate(on_space, run.records.n[1:], part) for part in (x, y)))
    worst = max(np.max(np.abs(x - y), initial=0.0) for x, y in pairs) / size
    print(f"{name}: {worst:.1e}")
    assert worst < ROUND_OFF
    assert np.max(np.abs(maps.plus - maps.minus)) > 1e-4 * size, "a step that gives nothing proves nothing"


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["midpoint", "galerkin", "group variational on a sphere"])
def test_the_transforms_do_not_read_the_momenta_of_a_record(name):
    run = run_of(name)
    record = at(run.records, 2)
    expected = theory.discrete_legendre(run.system, run.method, record, H)
    wrong = record.replace(mu=record.mu + 1.0, pi=2.0 * record.pi)
    found = theory.discrete_legendre(run.system, run.method, wrong, H)
    for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_array_equal(x, y)


@pytest.mark.cases(1)
@pytest.mark.parametrize("world", ["SO3", "SE2", "SL2", "SO3xSE2", "SO3 on a sphere"])
def test_the_momentum_maps_are_derivatives_of_the_unreduced_lagrangian_along_the_group(world):
    """⟨J⁻, η⟩ = −d/dε L(e^{εη}x, x⁺), ⟨J⁺, η⟩ = d/dε L(x, e^{εη}x⁺) at fixed a₀, on a step that solves nothing."""
    system, _ = random_group_system(world)
    group, Q, _ = system.places
    path, a0, _, _ = random_path(system, world, nodes=2)
    L, (first, second) = theory.unreduce(system), (at(path, 0), at(path, 1))
    eta = np.random.default_rng(8).normal(size=group.dim)

    def moved(e, place):
        return theory.Configuration(
            group.compose(group.exp(e * eta), place.g), Q.act(group, group.exp(e * eta), place.q)
        )

    def sides(first, second, a0):
        below = -jax.grad(lambda e: L(moved(e, first), second, a0, H))(jnp.zeros(()))
        above = jax.grad(lambda e: L(first, moved(e, second), a0, H))(jnp.zeros(()))
        maps = theory.link_momentum_maps(system, first.g, theory.link_of(system.places, first, second, a0), H)
        return below, above, maps.minus @ eta, maps.plus @ eta

    below, above, minus, plus = evaluate(sides, first, second, a0)
    scale = abs(below) + abs(above)
    assert abs(minus - below) < 1e-13 * scale
    assert abs(plus - above) < 1e-13 * scale


def test_without_forces_the_momentum_maps_agree_along_the_isotropy_of_the_parameters():
    """Noether: J⁻ = J⁺ along every η with η·a₀ = 0 on any step; along others they differ."""
    system, start = random_system("SL2")
    run = co.simulate(system, start, dt=H, steps=3, method=co.Midpoint(), monitors=False)
    maps = theory.discrete_momentum_maps(system, co.Midpoint(), run.records, H)
    free = isotropy_algebra(system, start)
    assert len(free) == 1
    change = maps.plus - maps.minus
    assert np.max(np.abs(change @ free.T)) < 1e-14 * np.max(np.abs(maps.plus)) * 10
    assert np.max(np.abs(change)) > 1e-3


@dataclass(frozen=True)
class Own(co.methods.Method, Step):
    """A rule of one's own, which says what it sums: the left rectangle again."""

    order = co.methods.LeftRectangle.order
    equations = co.methods.LeftRectangle.equations
    advance = co.methods.LeftRectangle.advance
    sources = co.methods.LeftRectangle.sources
    relative = co.methods.LeftRectangle.relative
    nodes = co.methods.LeftRectangle.nodes
    _node = co.methods.LeftRectangle._node

    @property
    def stages(self):
        return ((self, 1.0),)


@pytest.mark.long
def test_a_rule_of_ones_own_has_transforms_and_is_refused_with_forces():
    system, start = random_system("SO3")
    run = co.simulate(system, start, dt=H, steps=3, method=co.methods.LeftRectangle(), monitors=False)
    own, known = (theory.discrete_legendre(system, m, run.records, H) for m in (Own(), co.methods.LeftRectangle()))
    for x, y in zip(jax.tree.leaves(own), jax.tree.leaves(known), strict=True):
        np.testing.assert_allclose(x, y, rtol=0, atol=1e-13)
    system, start = random_system("SO3", forced=True)
    with pytest.raises(co.errors.ArgumentError, match="Where Own lets forces act"):
        theory.discrete_legendre(system, Own(), start, H)


def test_the_weights_of_a_rule_are_those_that_integrate_polynomials_up_to_its_order():
    """Σ w_i c_iʲ = 1/(j + 1) for j below the order."""
    orders = {
        co.methods.LeftRectangle: 1,
        co.methods.RightRectangle: 1,
        co.Trapezoidal: 2,
        co.Midpoint: 2,
        co.methods.Simpson: 4,
    }
    assert orders.keys() == NODES.keys()
    for rule, order in orders.items():
        c, w = np.transpose(NODES[rule])
        assert [w @ c**j for j in range(order)] == pytest.approx([1 / (j + 1) for j in range(order)], abs=1e-15)
    ends = [
        [c for c, _ in NODES[rule]] for rule in (co.methods.LeftRectangle, co.methods.RightRectangle, co.Trapezoidal)
    ]
    assert ends == [[0], [1], [0, 1]]


def test_methods_without_a_discrete_lagrangian_are_refused():
    system, start = random_system("SO3 alone")
    run = co.simulate(system, start, dt=H, steps=2, method=co.EnergyMomentum(), monitors=False)
    for function in (theory.discrete_legendre, theory.discrete_momentum_maps):
        with pytest.raises(co.errors.ArgumentError, match="EnergyMomentum has no discrete Lagrangian"):
            function(system, run.method, run.records, H)
