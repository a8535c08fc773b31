"""Real Lie algebras given by complex matrices are taken in their real form."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from systems import generator

PAULI = np.array([[[0, 1], [1, 0]], [[0, -1j], [1j, 0]], [[1, 0], [0, -1]]])


def gell_mann() -> np.ndarray:
    """−iλ_j/2 of su(3)."""
    matrices = np.zeros((8, 3, 3), complex)
    for k, (i, j) in enumerate([(0, 1), (0, 2), (1, 2)]):
        matrices[2 * k, i, j] = matrices[2 * k, j, i] = 1
        matrices[2 * k + 1, i, j], matrices[2 * k + 1, j, i] = -1j, 1j
    matrices[6], matrices[7] = np.diag([1, -1, 0]), np.diag([1, 1, -2]) / np.sqrt(3)
    return -0.5j * matrices


SU3 = co.MatrixGroup(gell_mann(), name="SU(3)")


def test_su2_by_pauli_matrices_is_su2():
    group = co.MatrixGroup(-0.5j * PAULI, name="SU(2) by Pauli")
    xi, eta = generator("pauli").normal(size=(2, 3))
    np.testing.assert_allclose(evaluate(group.ad, xi, eta), np.cross(xi, eta), rtol=0, atol=1e-15)
    assert (group.dim, group.matrix_size) == (3, 4)


def test_the_real_form_of_su3_has_its_brackets_exponential_and_adjoint_action():
    basis, random = gell_mann(), generator("su3")
    xi, eta = random.normal(size=(2, 8))
    X, Y = (np.tensordot(x, basis, axes=1) for x in (xi, eta))
    bracket, g = evaluate(lambda x, y: (SU3.ad(x, y), SU3.exp(x)), xi, eta)
    U = scipy.linalg.expm(X)
    np.testing.assert_allclose(np.tensordot(bracket, basis, axes=1), X @ Y - Y @ X, rtol=0, atol=1e-14)
    np.testing.assert_allclose(co.groups.complex_form(g), U, rtol=0, atol=1e-14)
    np.testing.assert_allclose(co.groups.real_form(U), g, rtol=0, atol=1e-14)
    turned = np.tensordot(evaluate(SU3.Ad, g, eta), basis, axes=1)
    np.testing.assert_allclose(turned, U @ Y @ U.conj().T, rtol=0, atol=1e-13)


@pytest.mark.long
def test_a_motion_on_su3_stays_there_and_keeps_its_momentum_and_casimir():
    system = co.System(SU3, lambda xi: 0.5 * xi @ (np.arange(1.0, 9.0) * xi))
    start = system.state(xi=0.1 * np.arange(8.0))
    run = co.simulate(system, start, dt=0.05, steps=60, method=co.Midpoint(co.Exponential()), backend="xla")
    U = co.groups.complex_form(run.final.g)
    assert np.max(np.abs(U.conj().T @ U - np.eye(3))) < 1e-13
    assert abs(np.linalg.det(U) - 1) < 1e-13
    size = np.sum(run.records.mu**2, axis=1)
    assert np.ptp(size) < 1e-13 * size[0]
    assert np.ptp(run.records.mu, axis=0).max() > 0.01
    assert run.summary()["kelvin_noether_error_max"] < 1e-12


def test_a_complex_basis_counts_over_the_real_numbers():
    """sl(2, ℂ), the Lorentz algebra: dependent over ℂ, of dimension 6 over ℝ; ad of its real form is that of both."""
    sl2 = np.array([[[1, 0], [0, -1]], [[0, 1], [0, 0]], [[0, 0], [1, 0]]], complex)
    group = co.MatrixGroup([*sl2, *(1j * sl2)], name="SL(2, C)")
    assert group.dim == 6
    real = co.MatrixGroup(sl2, name="SL2")
    assert (real.dim, real.matrix_size) == (3, 2), "complex numbers without an imaginary part are real"


def test_an_imaginary_part_of_round_off_does_not_double_the_matrices():
    """e^{iπ/4} e^{−iπ/4} and a change of basis leave 1e-17; 1e-12 of a matrix is more than round-off."""
    sl2 = np.array([[[1, 0], [0, -1]], [[0, 1], [0, 0]], [[0, 0], [1, 0]]], complex)
    turn = np.diag(np.exp([0.3j, 0.7j]))
    turned = np.linalg.inv(turn) @ (turn @ sl2 @ np.linalg.inv(turn)) @ turn
    assert np.max(np.abs(np.imag(turned))) > 0
    for unit in (1.0, 1e-9):
        group = co.MatrixGroup(unit * turned)
        assert (group.dim, group.matrix_size) == (3, 2)
        np.testing.assert_allclose(group.basis, unit * np.real(sl2), rtol=0, atol=1e-15 * unit)
    assert co.MatrixGroup([[[1, 1e-12j], [0, 0]]]).matrix_size == 4


def test_a_constraint_sees_the_real_form_and_projection_keeps_it():
    group = co.MatrixGroup(-0.5j * PAULI, lambda g: g.T @ g - np.eye(4), name="SU(2)")
    g = evaluate(group.exp, np.array([0.3, -0.5, 0.8]))
    # A rotation of ℝ⁴ that is no real form satisfies gᵀg = 1, and is outside all the same.
    other = np.diag([1.0, -1.0, 1.0, 1.0]) @ g
    assert evaluate(group.outside, g) < 1e-15
    assert evaluate(group.outside, other) > 0.1
    bent = g + 1e-5 * generator("bent").normal(size=(4, 4))
    assert evaluate(lambda x: group.defect(group.project(x)), bent) < 1e-9


@pytest.mark.parametrize(
    ("basis", "says"),
    [
        (PAULI, "Hermitian ones, such as Pauli's, need a factor i"),
        (-0.5j * PAULI[:2], "closed under the bracket"),
        ([1j * np.eye(2), 2j * np.eye(2)], "linearly independent"),
        ([[[1j, np.nan], [0, 0]]], "finite square matrices"),
    ],
)
def test_complex_matrices_that_are_no_real_algebra_are_refused_in_its_words(basis, says):
    with pytest.raises(co.errors.GroupError, match=says):
        co.MatrixGroup(basis)
