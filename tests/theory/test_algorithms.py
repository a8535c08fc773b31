"""Reduced and unreduced algorithms give one motion; reduction and reconstruction are inverse (B17, Theorem 3.2)."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from discrete import at, named_point, random_group_system, random_path
from systems import generator

H, STEPS = 0.1, 40
ROUND_OFF = 1e-13
"""Of 1 + the largest entry."""
SAME = 1e-11
"""Of 1 + the largest entry after 40 steps of a random system, whose round-off grows with the motion's own spread."""


def close(found, expected, within=SAME):
    for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(x, y, rtol=0, atol=within * (1 + np.max(np.abs(y), initial=0.0)))


def run_of(world):
    """A run by co.methods.GroupVariational, with its configurations and links."""
    system, start = random_group_system(world)
    run = co.simulate(
        system, start, dt=H, steps=STEPS, method=co.methods.GroupVariational(co.Exponential(), "velocity")
    )
    path = theory.Configuration(run.records.g, run.records.q)
    a0 = evaluate(lambda s: system.advected.act(system.group, s.g, s.a), start)
    return system, path, named_point(system, a0)


@pytest.mark.cases(1)
@pytest.mark.parametrize("world", ["SO3", "SE3", "SO3xSE2", "SO4"])
def test_reduction_and_reconstruction_are_inverse(world):
    system, _ = random_group_system(world)
    path, a0, _, _ = random_path(system, world, nodes=12)
    reduced = theory.reduced_path(system.places, path, named_point(system, a0))
    again = theory.reconstruct(system.places, at(path.g, 0), reduced)
    close(again, path, 1e-13)
    close(theory.reduced_path(system.places, again, named_point(system, a0)), reduced, 1e-12)


@pytest.mark.long
@pytest.mark.parametrize("world", ["SO3 alone", "SO3", "SE2", "SO3 on a sphere"])
def test_unreduced_reduced_and_reconstructed_algorithms_give_one_motion(world):
    """(B16) on G × Q, (P42)–(P44) with (B17), and the method of the library."""
    system, path, a0 = run_of(world)
    a0 = None if system.advected == co.Trivial(0) else a0
    L = theory.unreduce(system)
    unreduced = theory.discrete_euler_lagrange_algorithm(L, at(path, 0), at(path, 1), a0, H, STEPS)
    first = at(theory.reduced_path(system.places, path, a0), 0)
    links = theory.discrete_euler_poincare_algorithm(system, first, H, STEPS)
    rebuilt = theory.reconstruct(system.places, at(path.g, 0), links)
    close(unreduced, path)
    close(rebuilt, path)


def coupled(f, y, u, h):
    """l(f, y, u⁺) on SO(3) Ⓢ ℝ³."""
    A, d = generator("semidirect").normal(size=(3, 3)), u - y
    turn = co.SO3().vee(f.T - f) / (2 * h)
    coupling = jnp.sin(y @ A @ turn) + 0.3 * (u @ y) ** 2 / (1 + u @ u)
    return h * (turn @ turn + 0.5 * (d @ d) / h**2 + 0.05 * coupling - 0.5 * u @ u)


def test_the_residual_of_the_semidirect_product_is_minus_that_of_total_momenta_at_any_sequence():
    """(B13) in f, y, u⁺, of l itself and of what the reduced system has for it, against (P42)."""
    group, V = co.SO3(), co.Defining()
    system = theory.semidirect_system(group, V, coupled)
    path, _, _, _ = random_path(system, "semidirect")
    links, back = theory.reduced_path(system.places, path), theory.semidirect_lagrangian(system)

    def both(before, here):
        mu, pi = theory.discrete_euler_poincare(system, before, here, H)
        pair = theory.semidirect_link(group, V, before), theory.semidirect_link(group, V, here)
        rows = [theory.discrete_euler_poincare_semidirect(group, V, l, *pair, H) for l in (back, coupled)]
        return rows, [(V.diamond(group, pi, here.n) - mu, -pi)] * 2

    close(*evaluate(both, at(links, 0), at(links, 1)), ROUND_OFF)
    with pytest.raises(co.errors.GroupError, match="needs a representation of the group"):
        theory.semidirect_system(group, co.Sphere(co.Defining()), coupled)


@pytest.mark.long
def test_the_algorithm_of_the_semidirect_product_is_the_reduced_one():
    """(B13) on SO(3) Ⓢ ℝ³ in f, y, u⁺ against (P42)."""
    group, V = co.SO3(), co.Defining()
    system, l = theory.semidirect_system(group, V, coupled), coupled
    first = theory.SemidirectLink(
        evaluate(group.exp, np.array([0.1, -0.2, 0.15])), np.array([1.0, 0.2, 0.1]), np.array([1.05, 0.25, 0.0])
    )
    links = theory.semidirect_algorithm(group, V, l, first, H, STEPS)
    F = evaluate(group.inverse, first.f)
    start = theory.Link(F, F @ first.y, F @ first.u, np.zeros(0))
    ours = theory.discrete_euler_poincare_algorithm(system, start, H, STEPS)
    translated = evaluate(jax.vmap(lambda link: theory.semidirect_link(group, V, link)), ours)
    close(links, translated)
    close(np.einsum("kji,kj->ki", links.f[1:], links.y[1:]), links.u[:-1], 1e-13)


def heavy_top(parameter):
    """l(f, a) of a top, with its weight and a coupling of f and a at the left or at the right end of the step."""
    group = co.SO3()
    D = np.diag([2.0, 1.5, 0.4])

    def weighted(f, a, h):
        coupling = a[0] * (f[1, 0] - f[0, 1]) + 0.5 * a[1] * (f[2, 1] - f[1, 2])
        return jnp.trace((jnp.eye(3) - f) @ D) / h - h * a[2] + 0.2 * h * a[0] ** 2 + 0.3 * coupling

    return theory.PoissonLagrangian(group, co.Defining(), weighted, parameter)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("parameter", ["left", "right"])
def test_euler_poincare_poisson_is_the_reduced_algorithm_with_a_parameter(parameter):
    """(B19) in f, a against (P42), both ends."""
    l = heavy_top(parameter)
    system = theory.poisson_system(l)
    start = system.state(g=evaluate(l.group.exp, np.array([0.4, 0.1, 0.0])), xi=[0.3, 0.2, 1.4], a0=[0, 0, 1])
    run = co.simulate(system, start, dt=H, steps=200, method=co.methods.GroupVariational(co.Exponential(), "velocity"))
    path = theory.Configuration(run.records.g, np.zeros((201, 0)))
    reduced = theory.reduced_path(system.places, path, [0, 0, 1])
    ours = evaluate(jax.vmap(lambda link: theory.poisson_link(l.group, link)), reduced)
    theirs = theory.poisson_algorithm(l, at(ours, 0), H, 200)
    close(theirs, ours)
    assert np.ptp(theirs.a[:, 2]) > 0.05, "the top must nod"


@pytest.mark.parametrize("parameter", ["left", "right"])
def test_the_residual_of_euler_poincare_poisson_is_minus_that_of_total_momenta_at_any_sequence(parameter):
    l = heavy_top(parameter)
    system = theory.poisson_system(l)
    again = theory.poisson_lagrangian(system, parameter)
    random, a0, _, _ = random_path(system, "top")
    links = theory.reduced_path(system.places, random, a0)

    def both(before, here):
        row = theory.discrete_euler_poincare_poisson(
            again, theory.poisson_link(l.group, before), theory.poisson_link(l.group, here), H
        )
        ends = theory.discrete_euler_poincare(system, before, here, H).mu
        return row, -ends

    row, expected = evaluate(both, at(links, 0), at(links, 1))
    close(row, expected, ROUND_OFF)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("parameter", ["left", "right"])
def test_discrete_kelvin_noether_theorem_of_euler_poincare_poisson(parameter):
    """(B25) for 𝒦(c, a) = c + sin(c·a) a on a run of the top; at the left end I^B = −I of Theorem 7."""
    l = heavy_top(parameter)
    system = theory.poisson_system(l)
    start = system.state(g=evaluate(l.group.exp, np.array([0.4, 0.1, 0.0])), xi=[0.3, 0.2, 1.4], a0=[0, 0, 1])
    run = co.simulate(system, start, dt=H, steps=30, method=co.methods.GroupVariational(co.Exponential(), "velocity"))
    noether = co.mechanics.KelvinNoether([0.3, -0.5, 0.8], lambda c, a: c + jnp.sin(c @ a) * a, co.Defining())
    path = theory.Configuration(run.records.g, np.zeros((31, 0)))
    links = evaluate(
        jax.vmap(lambda link: theory.poisson_link(l.group, link)),
        theory.reduced_path(system.places, path, [0, 0, 1]),
    )
    K = evaluate(jax.vmap(lambda s: noether.momentum_map(system, s)), run.records)
    before, here = at(links, slice(None, -1)), at(links, slice(1, None))
    found = evaluate(jax.vmap(lambda b, n, K: theory.kelvin_noether_poisson(l, b, n, K, H)), before, here, K[1:-1])
    quantity, change = found
    size = np.max(np.abs(quantity))
    assert np.max(np.abs(change)) > 1e-4 * size
    np.testing.assert_allclose(np.diff(quantity), change[:-1], rtol=0, atol=1e-13 * size)
    if parameter == "left":
        ours = evaluate(jax.vmap(lambda s: noether.quantity(system, s)), run.records)
        np.testing.assert_allclose(quantity, -ours[1:-1], rtol=0, atol=1e-13 * size)


def test_a_lagrangian_that_is_not_invariant_is_refused():
    group = co.SO3()

    def leaning(g, q, g_next, q_next, a0, h):
        d = g.T @ (q_next - q)
        return 0.5 * d @ d / h + jnp.trace(g.T @ g_next) / h - h * q @ a0 - 0.01 * h * q[2]

    def upright(g, q, g_next, q_next, a0, h):
        return leaning(g, q, g_next, q_next, a0, h) + 0.01 * h * q[2]

    spaces = {"additional": co.Defining(), "advected": co.Defining()}
    system = theory.reduce(theory.UnreducedLagrangian(group, upright, **spaces))
    assert system.group_lagrangian is not None

    def uneven(g, q, g_next, q_next, a0, h):
        step = q_next - q
        return upright(g, q, g_next, q_next, a0, h) + 0.5 * step[2] ** 2 / h

    for wrong in (leaning, uneven):
        with pytest.raises(co.errors.LagrangianError, match="left-invariant"):
            theory.reduce(theory.UnreducedLagrangian(group, wrong, **spaces))


def test_a_curved_space_asks_for_a_point_to_test_invariance_at():
    def pendulum(g, q, g_next, q_next, a0, h):
        return (q_next - q) @ (q_next - q) / h + jnp.trace(g.T @ g_next) / h - h * q @ a0

    L = theory.UnreducedLagrangian(co.SO3(), pendulum, additional=co.Sphere(), advected=co.Defining())
    with pytest.raises(co.errors.ArgumentError, match="curved"):
        theory.reduce(L)
    assert theory.invariance_defect(L, q=[0, 0, 1]) < 1e-13


@pytest.mark.parametrize(
    ("function", "spaces", "says"),
    [
        (lambda g, g_next: 0.0, {}, r"must take \(g, g_next, h\)"),
        (lambda g, g_next, q, q_next, h: 0.0, {"additional": co.Defining()}, "in this order"),
    ],
)
def test_an_unreduced_lagrangian_of_other_arguments_is_refused(function, spaces, says):
    with pytest.raises(co.errors.LagrangianError, match=says):
        theory.UnreducedLagrangian(co.SO3(), function, **spaces)


@pytest.mark.parametrize(("parameter", "source"), [("left", 5.0), ("right", 3.0)])
def test_the_change_of_the_quantity_is_by_the_slope_of_the_step_that_reads_the_parameter(parameter, source):
    """I^B = ⟨D^Rl_{k−1}, 𝒦⟩ and −⟨D₂l⋄a_k + T⁻_k, 𝒦⟩, D₂l of step k at the left end, of step k − 1 at the right."""
    slopes = {"before": (np.array([2.0, 1.0]), np.full(2, 3.0)), "here": (np.array([7.0, 8.0]), np.full(2, 5.0))}
    torques = {"before": np.array([1.0, 1.0]), "here": np.array([0.5, 0.0])}
    l: Any = SimpleNamespace(
        parameter=parameter, slopes=lambda link, h: slopes[link], torque=lambda link, h: torques[link]
    )
    before: Any = "before"
    here: Any = "here"
    found = theory.kelvin_noether_poisson(l, before, here, np.array([1.0, -2.0]), 0.1)
    assert found == (0.0, -(source + 0.5 - 2 * source))


def test_the_momenta_of_both_ends_of_a_step_of_a_point_are_those_of_the_chord():
    """Λ = |s − n|²/2h + h a·s: π_k = (s − n)/h, π_{k+1} = Fᵀ((s − n)/h + ha), and μ_k of F, n, s and a."""
    random, h = generator("chord"), 0.1
    system = co.System(
        co.SO3(), group_lagrangian=lambda F, n, s, a, h: 0.5 * (s - n) @ (s - n) / h + h * a @ s,
        additional=co.Defining(), advected=co.Defining(),
    )  # fmt: skip
    F, (n, s, a) = co.attitude.zyx(0.3, -0.2, 0.5), random.normal(size=(3, 3))
    link = theory.Link(F, n, s, a, theory.Instant())
    left, right = evaluate(
        lambda link: (theory.left_momenta(system, link, h), theory.right_momenta(system, link, h)), link
    )
    along_s = (s - n) / h + h * a
    np.testing.assert_allclose(left.pi, (s - n) / h, rtol=1e-13)
    np.testing.assert_allclose(right.pi, F.T @ along_s, rtol=1e-13)
    turned = np.cross(a, h * s) + np.cross(n, (n - s) / h) + np.cross(s, along_s)
    np.testing.assert_allclose(left.mu, -turned, atol=1e-13)
    np.testing.assert_allclose(right.mu, 0.0, atol=1e-15)
