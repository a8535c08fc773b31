"""Axioms of matrix Lie groups, over every group; closed forms against what the base class derives from matrices."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

import coadjoint as co
from coadjoint.errors import GroupError
from coadjoint.groups import LieGroup
from coadjoint.kernels.trace.evaluate import evaluate
from systems import GROUPS, SL2, element, generator

ROUND_OFF = 2e-14
"""Of the product of the matrix norms that enter."""


@pytest.fixture(params=GROUPS)
def group(request) -> LieGroup:
    return GROUPS[request.param]


@pytest.fixture
def random(group) -> np.random.Generator:
    return generator("group", group)


def vectors(group, random, count):
    return random.normal(size=(count, group.dim))


def close(found, expected, size=1.0):
    for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(x, y, rtol=0, atol=ROUND_OFF * max(1.0, size, np.max(np.abs(y), initial=0.0)))


def matrix_sizes(group, *elements) -> float:
    """The largest norm of the elements and their inverses, cubed: three of them meet in these identities."""
    both = [m for g in elements for m in evaluate(lambda g: (group.matrix(g), group.matrix(group.inverse(g))), g)]
    return float(max(np.linalg.norm(m) for m in both) ** 3)


@pytest.mark.cases(2)
def test_multiplication_is_that_of_matrices(group, random):
    g, h, k = (element(group, random) for _ in range(3))

    def products(g, h, k):
        compose, matrix = group.compose, group.matrix
        return {
            "product": (matrix(compose(g, h)), matrix(g) @ matrix(h)),
            "associative": (matrix(compose(compose(g, h), k)), matrix(compose(g, compose(h, k)))),
            "identity": (matrix(compose(g, group.identity())), matrix(g)),
            "unit": (matrix(group.identity()), jnp.eye(group.matrix_size)),
            "inverse": (matrix(compose(g, group.inverse(g))), jnp.eye(group.matrix_size)),
            "entries": (group.from_matrix(matrix(g)), g),
        }

    for found, expected in evaluate(products, g, h, k).values():
        close(found, expected, matrix_sizes(group, g, h, k))


def test_hat_and_vee_are_inverse_and_linear_in_the_basis(group, random):
    (xi,) = vectors(group, random, 1)
    hatted, back = evaluate(lambda xi: (group.hat(xi), group.vee(group.hat(xi))), xi)
    close(back, xi)
    close(hatted, np.tensordot(xi, group.basis, 1))
    assert group.basis.shape == (group.dim, group.matrix_size, group.matrix_size)


@pytest.mark.cases(15)
def test_tangent_is_the_derivative_of_the_exponential_as_an_element(group, random):
    (xi,) = vectors(group, random, 1)
    found, expected = evaluate(
        lambda xi: (group.tangent(xi), jax.jvp(lambda e: group.exp(e * xi), (0.0,), (1.0,))[1]), xi
    )
    close(found, expected)
    matrix = evaluate(lambda xi: jax.jvp(group.matrix, (group.identity(),), (group.tangent(xi),))[1], xi)
    close(matrix, np.tensordot(xi, group.basis, 1))


@pytest.mark.cases(13)
def test_adjoint_action_is_conjugation(group, random):
    g = element(group, random)
    (xi,) = vectors(group, random, 1)

    def conjugated(g, xi):
        m = group.matrix(g)
        return group.hat(group.Ad(g, xi)), m @ group.hat(xi) @ jnp.linalg.inv(m)

    close(*evaluate(conjugated, g, xi), size=matrix_sizes(group, g))


def test_bracket_is_the_commutator_and_satisfies_jacobi(group, random):
    xi, eta, chi = vectors(group, random, 3)

    def brackets(xi, eta, chi):
        hat, ad = group.hat, group.ad
        jacobi = ad(xi, ad(eta, chi)) + ad(eta, ad(chi, xi)) + ad(chi, ad(xi, eta))
        return hat(ad(xi, eta)), hat(xi) @ hat(eta) - hat(eta) @ hat(xi), jacobi

    found, expected, jacobi = evaluate(brackets, xi, eta, chi)
    close(found, expected, 10)
    close(jacobi, np.zeros(group.dim), 50)


def test_bracket_is_the_derivative_of_the_adjoint_action(group, random):
    xi, eta = vectors(group, random, 2)
    found, expected = evaluate(
        lambda xi, eta: (
            group.ad(xi, eta),
            jax.jvp(lambda g: group.Ad(g, eta), (group.identity(),), (group.tangent(xi),))[1],
        ),
        xi,
        eta,
    )
    close(found, expected, 10)


@pytest.mark.cases(10)
def test_duals_pair_as_they_must(group, random):
    """⟨Ad*_g μ, ξ⟩ = ⟨μ, Ad_g ξ⟩ and ⟨ad*_ξ μ, η⟩ = ⟨μ, ad_ξ η⟩ (P5)."""
    g = element(group, random)
    xi, eta, mu = vectors(group, random, 3)

    def pairings(g, xi, eta, mu):
        return (
            (group.Ad_dual(g, mu) @ xi, mu @ group.Ad(g, xi)),
            (group.ad_dual(xi, mu) @ eta, mu @ group.ad(xi, eta)),
        )

    for found, expected in evaluate(pairings, g, xi, eta, mu):
        close(found, expected, 10 * matrix_sizes(group, g))


@pytest.mark.cases(7)
def test_dual_adjoint_composes_in_reverse_order(group, random):
    """Ad_{gh} = Ad_g Ad_h and Ad*_{gh} = Ad*_h Ad*_g."""
    g, h = element(group, random), element(group, random)
    xi, mu = vectors(group, random, 2)

    def orders(g, h, xi, mu):
        gh = group.compose(g, h)
        return (
            (group.Ad(gh, xi), group.Ad(g, group.Ad(h, xi))),
            (group.Ad_dual(gh, mu), group.Ad_dual(h, group.Ad_dual(g, mu))),
        )

    for found, expected in evaluate(orders, g, h, xi, mu):
        close(found, expected, 10 * matrix_sizes(group, g) * matrix_sizes(group, h))


@pytest.mark.parametrize("scale", [1e-8, 1e-3, 1.0, 1.9, 2.1, 6.0])
def test_exponential_agrees_with_the_matrix_exponential(group, random, scale):
    """With a rotation of about `scale` and a unit translation, so that no small-angle error hides."""
    (xi,) = vectors(group, random, 1)
    xi = xi / np.linalg.norm(xi)
    turning = np.array([np.any(np.abs(b - b.T) > 1.5) for b in group.basis])
    xi = np.where(turning, scale * xi, xi)
    found = evaluate(lambda xi: group.matrix(group.exp(xi)), xi)
    expected = scipy.linalg.expm(np.tensordot(xi, group.basis, 1))
    close(found, expected, 20)


@pytest.mark.cases(13)
def test_exponential_of_commuting_elements_adds(group, random):
    (xi,) = vectors(group, random, 1)
    found = evaluate(lambda xi: group.matrix(group.compose(group.exp(0.3 * xi), group.exp(0.4 * xi))), xi)
    close(found, evaluate(lambda xi: group.matrix(group.exp(0.7 * xi)), xi), float(np.linalg.norm(found)) * 10)


@pytest.mark.cases(7)
def test_projection_removes_a_small_defect_quadratically(group, random):
    g = element(group, random)
    noise = jax.tree.map(lambda x: 1e-5 * random.normal(size=x.shape), g)
    disturbed = jax.tree.map(np.add, g, noise)
    assert evaluate(group.defect, g) <= 100 * ROUND_OFF * matrix_sizes(group, g)
    far = evaluate(group.defect, disturbed)
    if far == 0.0:
        assert isinstance(group, (co.Translation, co.groups.Heisenberg, co.groups.GLn))
        return
    assert far > 1e-6
    once = evaluate(group.project, disturbed)
    assert evaluate(group.defect, once) < 10 * far**2
    close(once, g, max(1e-4, 30 * far) / ROUND_OFF)
    close(evaluate(group.project, g), g, matrix_sizes(group, g))
    assert evaluate(group.defect, evaluate(group.project, once)) <= 100 * ROUND_OFF * matrix_sizes(group, g)


@pytest.mark.cases(5)
def test_closed_forms_equal_the_derivation_from_matrices(group, random):
    g = element(group, random)
    xi, eta, mu = vectors(group, random, 3)

    def both(name, *arguments):
        return getattr(group, name)(*arguments), getattr(LieGroup, name)(group, *arguments)

    def forms(g, xi, eta, mu):
        return (
            both("hat", xi),
            both("vee", group.hat(xi)),
            both("Ad", g, xi),
            both("Ad_dual", g, mu),
            both("ad", xi, eta),
            both("ad_dual", xi, mu),
            both("exp", xi),
        )

    for found, expected in evaluate(forms, g, xi, eta, mu):
        close(found, expected, 10 * matrix_sizes(group, g))


def test_angle_squared_describes_the_spectrum_of_ad(group, random):
    (xi,) = vectors(group, random, 1)
    t = evaluate(group.angle_squared, xi) if group.angle_squared(xi) is not None else None
    if t is None:
        pytest.skip("the group promises nothing")
    ad = evaluate(lambda xi: jax.vmap(lambda eta: group.ad(xi, eta), out_axes=1)(jnp.eye(group.dim)), xi)
    squared = ad @ ad
    turned = squared + t * np.eye(group.dim)
    close(squared @ turned @ turned, np.zeros_like(ad), 1e3)


def test_rotation_angle_is_the_angle_of_the_rotation():
    turns = {co.SO2(): [-0.7], co.SE2(): [-0.7, 3.0, 4.0], co.SO3(): [0.7, 0, 0], co.SE3(): [0, 0.7, 0, 3, 4, 5]}
    for group, xi in turns.items():
        assert evaluate(group.rotation_angle, np.array(xi, float)) == pytest.approx(0.7, abs=1e-15)
    both = co.DirectProduct(co.SO2(), co.SO3())
    assert evaluate(both.rotation_angle, np.array([-0.3, 0, 0.4, 0])) == pytest.approx(0.4, abs=1e-15)


def test_groups_compare_by_what_they_are():
    again = co.MatrixGroup(SL2.basis, SL2._constraint)
    assert again == SL2
    assert hash(again) == hash(SL2)
    assert co.MatrixGroup(2 * SL2.basis) != SL2
    assert co.SO3() == co.SO3() != co.SE3()
    assert co.DirectProduct(co.SO3(), co.SO2()) == co.DirectProduct(co.SO3(), co.SO2())


def test_a_basis_that_is_no_algebra_is_refused_in_one_sentence():
    x, y, z = np.array(SL2.basis)
    for scale in (1e-12, 1e-6, 1.0, 1e6):
        with pytest.raises(GroupError, match="closed under the bracket"):
            co.MatrixGroup([scale * y, scale * z])
    with pytest.raises(GroupError, match="linearly independent"):
        co.MatrixGroup([x, y, x + y])
    with pytest.raises(GroupError, match=r"shape \(dim, N, N\)"):
        co.MatrixGroup(np.eye(3))


@pytest.mark.cases(13)
def test_elements_are_inside_their_group_and_a_reflection_is_outside_by_two(group, random):
    g = element(group, random)
    assert evaluate(group.outside, g) <= 100 * ROUND_OFF * matrix_sizes(group, g)
    if isinstance(group, (co.SO2, co.SO3, co.SE2, co.SE3)):
        size = 2 if isinstance(group, (co.SO2, co.SE2)) else 3
        mirror = np.diag([*np.ones(size - 1), -1.0])
        mirrored = jax.tree.map(lambda leaf: mirror @ leaf if np.ndim(leaf) == 2 else leaf, g)
        assert evaluate(group.defect, mirrored) < 1e-14
        np.testing.assert_allclose(evaluate(group.outside, mirrored), 2.0, rtol=1e-14)


def test_a_product_is_inside_as_far_as_its_worst_factor_and_free_factors_hide_nothing():
    free = co.MatrixGroup(SL2.basis)
    group = co.DirectProduct(co.SO3(), free)
    g = (2 * np.eye(3), 5 * np.eye(2))
    assert group.constrained and evaluate(group.defect, g) == 3.0
    assert evaluate(group.outside, g) == 7.0  # |det 2I − 1|
    turned, other = evaluate(group.project, ((1 + 1e-9) * np.eye(3), g[1]))
    assert np.max(np.abs(turned - np.eye(3))) < 1e-15 and np.array_equal(other, g[1])
    assert not co.DirectProduct(free, free).constrained


def test_a_matrix_group_without_constraint_says_so():
    free = co.MatrixGroup(SL2.basis)
    assert not free.constrained
    for ask in (free.project, free.defect):
        with pytest.raises(GroupError, match="constraint"):
            ask(np.eye(2))


@pytest.mark.parametrize("scale", [1e-12, 3.0, 1e14])
def test_the_unit_of_a_basis_is_free(scale):
    """With e_i′ = s e_i coordinates are ξ/s and c′ = s c: a zero stays one, and what is small is no zero."""
    scales = scale ** np.array([1.0, -1.0, 1.0])
    scaled = co.MatrixGroup(SL2.basis * scales[:, None, None])
    xi, eta = np.array([0.3, -0.2, 0.5]), np.array([-0.7, 0.4, 0.1])
    with jax.enable_x64(True):
        back = np.asarray(scaled.vee(scaled.hat(xi / scales))) * scales
        bracket = np.asarray(scaled.ad(xi / scales, eta / scales)) * scales
        np.testing.assert_allclose(back, xi, rtol=1e-14)
        np.testing.assert_allclose(bracket, SL2.ad(xi, eta), rtol=1e-13)
        e = np.eye(3) / scales[:, None]
        zeros = np.asarray(SL2.ad(np.eye(3)[0], np.eye(3)[1])) == 0
        np.testing.assert_array_equal(np.asarray(scaled.ad(e[0], e[1])) == 0, zeros)
