"""The groups by name: double covers, dimensions, defining equations, the matrix exponential's reach, refusals."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

import coadjoint as co
from coadjoint.errors import ArgumentError, GroupError
from coadjoint.groups.group import _is_orthogonal
from coadjoint.groups.matrix_functions import REACH, exponential, exponential_minus_one
from coadjoint.kernels.trace.evaluate import evaluate
from systems import GROUPS, element, generator

COVERS = [co.groups.UnitQuaternion(), co.groups.SU2()]


@pytest.mark.parametrize("cover", COVERS, ids=repr)
def test_unit_quaternions_cover_the_rotations(cover):
    """R(pq) = R(p)R(q), R(exp ξ) = exp ξ^×, R(−q) = R(q), Ad_q = R(q)."""
    random = generator("cover")
    p, q = element(cover, random), element(cover, random)
    xi = 2 * random.normal(size=3)

    def both(p, q, xi):
        R = cover.rotation
        return (
            (R(cover.compose(p, q)), R(p) @ R(q)),
            (R(cover.exp(xi)), co.SO3().exp(xi)),
            (R(-q), R(q)),
            (cover.Ad(q, xi), R(q) @ xi),
        )

    for found, expected in evaluate(both, p, q, xi):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("cover", COVERS, ids=repr)
def test_the_cayley_transform_of_the_cover_is_the_squared_one_of_rotations(cover):
    """R(cay(ξ)) = cay(ξ^×/2)²; both have the same (dτ⁻¹)*, because the algebras are the same."""
    xi, mu = generator("squared").normal(size=(2, 3))

    def both(xi, mu):
        above, below = co.Cayley(), co.difference_maps.Squared(co.Cayley())
        return (
            (cover.rotation(above.tau(cover, xi)), below.tau(co.SO3(), xi)),
            (above.dtau_inverse_dual(cover, xi, mu), below.dtau_inverse_dual(co.SO3(), xi, mu)),
        )

    for found, expected in evaluate(both, xi, mu):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


def test_su2_is_of_unitary_matrices_with_determinant_one():
    """[[Re U, −Im U], [Im U, Re U]] with U = w − i(xσ₁ + yσ₂ + zσ₃)."""
    q = element(co.groups.SU2(), generator("su2"))
    real = evaluate(co.groups.SU2().matrix, q)
    U = real[:2, :2] + 1j * real[2:, :2]
    np.testing.assert_allclose(U, [[q[0] - 1j * q[3], -q[2] - 1j * q[1]], [q[2] - 1j * q[1], q[0] + 1j * q[3]]])
    np.testing.assert_allclose(U @ U.conj().T, np.eye(2), atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(U), 1)


@pytest.mark.parametrize(
    ("group", "dim"),
    [
        (co.SOn(2), 1),
        (co.SOn(5), 10),
        (co.groups.SLn(2), 3),
        (co.groups.SLn(4), 15),
        (co.groups.Sp(1), 3),
        (co.groups.Sp(3), 21),
    ],
    ids=repr,
)
def test_bases_span_the_algebra(group, dim):
    """Their number is dim G, they are independent, and each is tangent to the defining equations."""
    assert group.dim == dim == np.linalg.matrix_rank(group.basis.reshape(dim, -1))

    def slope(xi):
        return jax.jvp(lambda e: group.defect(group.from_matrix(jnp.eye(group.matrix_size) + e * group.hat(xi))),
                       (1e-6,), (1.0,))[1]  # fmt: skip

    slopes = [evaluate(slope, e) for e in np.eye(dim)]
    assert np.max(np.abs(slopes)) < 1e-5


def test_symplectic_and_heisenberg_matrices_are_what_they_are_called():
    g = element(co.groups.Sp(2), generator("sp"))
    J = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
    np.testing.assert_allclose(g.T @ J @ g, J, atol=1e-12)
    matrix = evaluate(co.groups.Heisenberg().matrix, np.array([2.0, 3.0, 5.0]))
    np.testing.assert_array_equal(matrix, [[1, 2, 5], [0, 1, 3], [0, 0, 1]])


def test_a_reflection_of_four_dimensions_is_outside_by_two():
    assert evaluate(co.SOn(4).outside, np.diag([1.0, 1, 1, -1])) == 2.0


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1.0, 5.0, 15.0])
def test_matrix_exponential_is_exact_to_round_off_within_its_reach(size):
    """Against scipy, relative to |e^A|; e^A − 1 of a small A relative to |A|. NaN, never a wrong number, beyond."""
    random = generator("expm", size)
    A = random.normal(size=(4, 4))
    A *= size / np.linalg.norm(A, 1)
    found, less = evaluate(lambda A: (exponential(A), exponential_minus_one(A)), A)
    expected = scipy.linalg.expm(A)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * np.linalg.norm(expected))
    if size < 1e-2:
        series = A @ (np.eye(4) + A @ (np.eye(4) + A @ (np.eye(4) + A @ (np.eye(4) + A / 5) / 4) / 3) / 2)
        np.testing.assert_allclose(less, series, rtol=0, atol=2e-15 * size)
    assert np.all(np.isnan(evaluate(exponential, np.diag([1.1 * REACH, 0.0]))))


def test_matrix_exponential_takes_large_translations():
    """Nilpotent parts count little: a rotation with a translation by 500."""
    A = np.zeros((4, 4))
    A[:3, :3], A[:3, 3] = [[0, -1.2, 0.4], [1.2, 0, -0.3], [-0.4, 0.3, 0]], [500.0, -300.0, 40.0]
    np.testing.assert_allclose(evaluate(exponential, A), scipy.linalg.expm(A), rtol=1e-13, atol=1e-16)


@pytest.mark.parametrize("make", [co.SOn, co.groups.SLn, co.groups.Sp, co.groups.Heisenberg])
def test_a_size_that_is_none_is_refused(make):
    for size in (0, 2.5, True):
        with pytest.raises(GroupError, match=f"Argument `size` of {make.__name__} must be a whole number"):
            make(size)


@pytest.mark.long
def test_exponential_steps_beyond_its_chart_fail_in_a_sentence():
    body = co.System(co.SOn(4), lambda xi: 0.5 * xi @ xi)
    start = body.state(xi=[3.0, 0, 0, 0, 0, 0])
    co.simulate(body, start, dt=0.4, steps=2, method=co.LeftRectangle(co.Exponential()))
    with pytest.raises(co.errors.ArgumentError, match=r"leave the chart of Exponential\(\) by a factor"):
        co.simulate(body, start, dt=0.8, steps=2, method=co.LeftRectangle(co.Exponential()))


def test_a_constraint_that_does_not_fit_its_basis_is_refused():
    """det exp(ξ) = 1 on traceless matrices alone."""
    with pytest.raises(GroupError, match="must vanish on the group, but is"):
        co.MatrixGroup([np.eye(2)], constraint=lambda g: jnp.linalg.det(g) - 1)
    with pytest.raises(GroupError, match="must be a function g ↦ array"):
        co.MatrixGroup([np.eye(2)], constraint=3)  # type: ignore[arg-type]
    with pytest.raises(GroupError, match="it raised AttributeError"):
        co.MatrixGroup([np.eye(2)], constraint=lambda g: g.nothing)


@pytest.mark.long
def test_elements_outside_a_group_without_constraint_are_refused():
    """g − I is a sum of products of basis matrices, and g has an inverse."""
    moves = [[[0, -1, 0], [1, 0, 0], [0, 0, 0]], [[0, 0, 1], [0, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0, 1], [0, 0, 0]]]
    plane = co.MatrixGroup(1e-3 * np.array(moves))  # SE(2) in other units
    system = co.System(plane, lambda xi: 0.5 * xi @ xi)
    random = generator("outside")
    inside = evaluate(plane.exp, 900 * random.normal(size=3))
    np.testing.assert_array_equal(system.state(g=inside).g, inside)
    for g in (2 * np.eye(3), inside + np.diag([0, 0, 0.1]), np.eye(3) + 0.1 * np.outer([0, 0, 1], [1, 0, 0])):
        with pytest.raises(ArgumentError, match="must lie in MatrixGroup"):
            system.state(g=g)
    everything = co.MatrixGroup(np.eye(4).reshape(4, 2, 2))
    general = co.System(everything, lambda xi: 0.5 * xi @ xi)
    general.state(g=[[1, 2], [3, 4]])
    with pytest.raises(ArgumentError, match="must lie in MatrixGroup"):
        general.state(g=[[1, 2], [2, 4]])


@pytest.mark.parametrize("group", [co.groups.SLn(3), co.groups.Opposite(co.groups.SLn(3))], ids=repr)
def test_brackets_of_matrices_without_trace_are_commutators_and_volume_is_restored(group):
    """[ξ, η]^ = ξ̂η̂ − η̂ξ̂, ⟨ad*_ξ μ, η⟩ = ⟨μ, [ξ, η]⟩, and det g returns to 1 to second order."""
    xi, eta, mu = generator("volume").normal(size=(3, group.dim))

    def measure(xi, eta, mu):
        X, Y = group.hat(xi), group.hat(eta)
        g = group.from_matrix(1.001 * group.matrix(group.exp(xi)))
        there = group.project(g)
        pairs = (group.hat(group.ad(xi, eta)), X @ Y - Y @ X), (group.ad_dual(xi, mu) @ eta, mu @ group.ad(xi, eta))
        return pairs, group.vee(X), group.defect(g), group.defect(there), group.matrix(there) / group.matrix(g)

    pairs, back, before, after, ratio = evaluate(measure, xi, eta, mu)
    for found, expected in pairs:
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(back, xi, atol=1e-14)
    np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-12)
    assert before == pytest.approx(1.001**3 - 1) and 1e-9 < after < 2e-5


def test_the_defect_of_a_unitary_matrix_is_its_largest_entry_in_either_part():
    """g†g − 1 of 1 + εX: of a real X that is not skew, and of an imaginary one that is not Hermitian times i."""
    group, e = co.groups.Un(3), np.zeros((3, 3))
    for real, imaginary in ((1e-3, 0.0), (0.0, 1e-3)):
        off, odd = e.copy(), e.copy()
        off[0, 0], odd[0, 1] = real, imaginary
        found = evaluate(group.defect, (np.eye(3) + off, odd))
        assert found == pytest.approx(2e-3 if real else 1e-3, rel=1e-3)
    assert evaluate(group.defect, (np.eye(3), e)) == 0.0


@pytest.mark.parametrize("name", ["SO3", "SO4", "Un2", "SE3", "SL2"])
def test_elements_are_orthogonal_where_the_basis_is_skew(name):
    group = GROUPS[name]
    g = evaluate(lambda xi: group.matrix(group.exp(xi)), generator("skew", name).normal(size=group.dim))
    assert _is_orthogonal(group) == (np.max(np.abs(g @ g.T - np.eye(len(g)))) < 1e-12)
