"""The logarithm of every group: the inverse of its exponential, with two derivatives, up to its branch."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

import coadjoint as co
from coadjoint.errors import GroupError
from coadjoint.groups.matrix_functions import logarithm
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from systems import GROUPS, generator

EVERY = {**GROUPS, "chain": co.Power(co.SE3(), 2), "SOn12": co.SOn(12)}
TURNING = {"SO3": 3, "SE3": 3, "SE2": 1, "SO2": 1, "SO3_R3": 3, "quaternions": 3}
"""Groups with closed forms, and how many of their coordinates turn; the others are a unit translation below."""


@pytest.fixture(params=EVERY)
def group(request) -> co.groups.LieGroup:
    return EVERY[request.param]


def inside(group, *key, size=2.0) -> np.ndarray:
    """A random ξ with |ξ̂| = size."""
    xi = generator("logarithm", group, *key).normal(size=group.dim)
    hats = evaluate(group.hat, xi)
    return xi * size / max(float(np.max(np.linalg.svd(hats, compute_uv=False))), 1e-300)


@pytest.mark.cases(4)
def test_it_is_the_inverse_of_the_exponential_from_tiny_to_large(group):
    way = tabulate(lambda xi: group.log(group.exp(xi)), np.zeros(group.dim))
    for size in (1e-9, 0.3, 3.0):
        xi = inside(group, size, size=size)
        assert np.max(np.abs(way(xi) - xi)) < 4e-15 * max(1.0, np.max(np.abs(xi)))


@pytest.mark.cases(4)
def test_it_changes_its_sign_with_the_inverse_and_turns_with_conjugation(group):
    """log(g⁻¹) = −log g, log(hgh⁻¹) = Ad_h log g."""
    xi, eta = inside(group, 1), inside(group, 2, size=0.7)

    def both(xi, eta):
        g, h = group.exp(xi), group.exp(eta)
        moved = group.compose(group.compose(h, g), group.inverse(h))
        return group.log(group.inverse(g)) + group.log(g), group.log(moved) - group.Ad(h, group.log(g))

    for off in evaluate(both, xi, eta):
        assert np.max(np.abs(off)) < 5e-14


@pytest.mark.parametrize("name", ["SO3", "SE3", "SL2", "SOn4", "Sp2", "SL2_dual"])
def test_it_is_the_matrix_logarithm_of_scipy(name):
    group = GROUPS[name]
    g = evaluate(group.exp, inside(group, 3))
    expected = scipy.linalg.logm(evaluate(group.matrix, g))
    np.testing.assert_allclose(evaluate(group.hat, group.log(g)), expected, rtol=0, atol=2e-13)


@pytest.mark.cases(4)
@pytest.mark.parametrize("size", [0.0, 0.9272, 0.9273, 2.9, 3.14, np.pi - 1e-6])
@pytest.mark.parametrize("name", TURNING)
def test_two_derivatives_are_right_beside_every_switch_up_to_the_branch(name, size):
    """log exp(ξ + tη) is ξ + tη; tan ½|ω| = ½ is where a formula ends. What does not turn has unit size."""
    group, turning = GROUPS[name], TURNING[name]
    xi, eta = np.cos(np.arange(1.0, 1 + group.dim)), np.sin(np.arange(1.0, 1 + group.dim))
    xi[:turning] *= size / np.linalg.norm(xi[:turning])
    xi[turning:] /= np.linalg.norm(xi[turning:]) if turning < group.dim else 1.0

    def slope(t):
        return jax.jvp(lambda t: group.log(group.exp(xi + t * eta)), (t,), (1.0,))

    (value, first), (_, second) = evaluate(lambda t: jax.jvp(slope, (t,), (1.0,)), np.float64(0.0))
    np.testing.assert_allclose(value, xi, rtol=0, atol=3e-15)
    np.testing.assert_allclose(first, eta, rtol=0, atol=1e-14)
    np.testing.assert_allclose(second, np.zeros(group.dim), rtol=0, atol=2e-13)


@pytest.mark.parametrize(
    "name", ["Un2", pytest.param("SLn3", marks=pytest.mark.long), pytest.param("SL2_dual", marks=pytest.mark.long)]
)
def test_two_derivatives_of_the_general_formula_are_right(name):
    group = GROUPS[name]
    eta = inside(group, 5, size=1.0)

    def slopes(xi):
        def slope(t):
            return jax.jvp(lambda t: group.log(group.exp(xi + t * eta)), (t,), (1.0,))

        return jax.jvp(slope, (0.0,), (1.0,))

    both = tabulate(slopes, eta)
    for size in (0.0, 1.5):
        (_, first), (_, second) = both(inside(group, 4, size=size))
        np.testing.assert_allclose(first, eta, rtol=0, atol=1e-13)
        np.testing.assert_allclose(second, np.zeros(group.dim), rtol=0, atol=1e-12)


@pytest.mark.parametrize("apart", [1e-3, 1e-6])
def test_the_general_formula_of_orthogonal_matrices_loses_one_digit_for_each_of_the_distance_to_half_a_turn(apart):
    group = co.SOn(4)
    xi = inside(group, 6, size=np.pi - apart)
    assert np.max(np.abs(group.log(evaluate(group.exp, xi)) - xi)) < 1e-15 / apart


def test_half_a_turn_has_the_axis_whose_largest_component_is_positive():
    for axis in ([0.0, -1.0, 0.0], [-0.6, 0.0, 0.8], [-0.8, 0.0, 0.6], [0.48, -0.6, 0.64]):
        n = np.array(axis)
        R = 2 * np.outer(n, n) - np.eye(3)
        expected = np.pi * n * np.sign(n[np.argmax(np.abs(n))])
        np.testing.assert_allclose(co.SO3().log(R), expected, rtol=0, atol=1e-14)
        omega, v = np.split(co.SE3().log((R, np.array([1.0, 2.0, 3.0]))), 2)
        np.testing.assert_allclose(omega, expected, rtol=0, atol=1e-14)
        assert np.all(np.isfinite(v))
    np.testing.assert_array_equal(co.SO2().log(-np.eye(2)), [np.pi])
    np.testing.assert_array_equal(co.groups.SU2().log(np.array([-1.0, 0.0, 0.0, 0.0])), [2 * np.pi, 0.0, 0.0])


@pytest.mark.parametrize(
    ("group", "g", "sentence"),
    [
        (co.SOn(4), np.diag([1.0, 1.0, -1.0, -1.0]), "is outside the image of exp"),
        (co.groups.SLn(2), np.diag([-2.0, -0.5]), "is outside the image of exp"),
        (co.groups.GLn(2), np.diag([1.0, -1.0]), "is outside the image of exp"),
        (co.SO3(), np.diag([1.0, 1.0, -1.0]), "must be an element of SO3()"),
        (co.SO3(), 1.1 * np.eye(3), "must be an element of SO3(), but is off it by 3.3e-01"),
        (co.SUn(3), (np.cos(2 * np.pi / 3) * np.eye(3), np.sin(2 * np.pi / 3) * np.eye(3)), "is outside the image"),
    ],
)
def test_an_element_without_a_logarithm_raises_one_sentence(group, g, sentence):
    with pytest.raises(GroupError) as caught:
        group.log(g)
    assert sentence in str(caught.value) and "\n" not in str(caught.value)


def test_under_a_transformation_a_matrix_without_a_logarithm_gives_no_number():
    assert not np.any(np.isfinite(evaluate(logarithm, np.diag([-2.0, -0.5]))))


@pytest.mark.long
def test_it_runs_under_jit_and_vmap_and_has_gradients():
    group = co.SO3()
    xi = np.stack([inside(group, k) for k in range(3)])
    g = evaluate(jax.vmap(group.exp), xi)
    with co.float64():
        np.testing.assert_allclose(jax.jit(jax.vmap(group.log))(g), xi, rtol=0, atol=1e-14)
    slope = evaluate(jax.grad(lambda x: jnp.sum(group.log(group.exp(x)) ** 2)), xi[0])
    np.testing.assert_allclose(slope, 2 * xi[0], rtol=0, atol=1e-13)


@pytest.mark.long
def test_a_lagrangian_with_a_logarithm_runs_as_native_code():
    """A spring on SO(3) about the attitude of two advected directions: ℓ = ½|ξ|² − ½|log R(a)|²."""

    def lagrangian(xi, a):
        e = co.SO3().log(jnp.stack([a.x, a.y, jnp.cross(a.x, a.y)], axis=1))
        return 0.5 * xi @ xi - 0.5 * e @ e

    system = co.System(co.SO3(), lagrangian, advected={"x": co.Defining(), "y": co.Defining()})
    start = system.state(xi=[0.3, -0.2, 0.5], a0={"x": [1.0, 0, 0], "y": [0, 1.0, 0]})
    run = co.simulate(system, start, dt=0.02, steps=150, backend="native", accuracy=False)
    theta = np.linalg.norm([0.3, -0.2, 0.5]) * np.sin(3.0)  # a harmonic swing about one axis
    angle = np.linalg.norm(co.SO3().log(run.final.g))
    assert abs(angle - abs(theta)) < 1e-4
