"""Zeitlin's fluids on the sphere: the Laplacian, harmonics in and out, waves that are exact in space, Casimirs."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.special

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import fluids
from coadjoint.models.fluids.harmonics import _matrices, legendre
from coadjoint.models.fluids.laplacian import dirichlet, inverse_laplacian, laplacian
from systems import generator


def casimirs(fluid, mu):
    """The spectrum of −iW, in order."""
    A, B = evaluate(fluid.group.parts, mu)
    return np.linalg.eigvalsh(B - 1j * A)


def test_the_laplacian_has_the_eigenvalues_of_the_sphere_and_is_inverted():
    size = 9
    for degree, order in ((1, 0), (3, 2), (8, 8)):
        c = np.zeros((size, size), complex)
        c[degree, order] = 1 + (0.5j if order else 0)
        omega = fluids.from_coefficients(size, c)
        np.testing.assert_allclose(evaluate(lambda w: laplacian(size, w), omega), -degree * (degree + 1) * omega,
                                   atol=1e-12)  # fmt: skip
    omega = generator("omega").normal(size=size**2)
    psi = evaluate(lambda w: inverse_laplacian(size, w), omega)
    mean = np.trace(omega.reshape(size, size)) / size * np.eye(size).ravel()
    np.testing.assert_allclose(evaluate(lambda w: laplacian(size, w), psi), omega - mean, atol=1e-12)
    assert abs(np.trace(psi.reshape(size, size))) < 1e-14


def test_the_energy_has_the_stream_function_as_its_gradient():
    import jax

    size = 5
    omega, along = generator("gradient").normal(size=(2, size**2))

    def both(omega):
        slope = jax.grad(dirichlet)(omega)
        return slope, inverse_laplacian(size, omega), jax.jvp(jax.grad(dirichlet), (omega,), (along,))[1]

    slope, psi, curvature = evaluate(both, omega)
    np.testing.assert_allclose(slope, -psi, atol=1e-14)
    np.testing.assert_allclose(curvature, -evaluate(lambda w: inverse_laplacian(size, w), along), atol=1e-13)


def test_functions_come_back_from_their_matrices():
    c = fluids.random_vorticity(3, degree=5, enstrophy=2.0)
    found = fluids.coefficients_of(8, fluids.from_coefficients(8, c))
    np.testing.assert_allclose(found[:6, :6], c, atol=1e-14)
    assert np.max(np.abs(found[6:])) < 1e-14
    assert fluids.power(c).sum() == pytest.approx(4.0)  # ∫ω² = 2 · enstrophy


def test_harmonics_are_those_of_scipy():
    """Orthonormal, with the phase of Condon and Shortley, on a grid of latitudes and longitudes."""
    z = np.linspace(-0.9, 0.9, 7)
    for degree in range(5):
        for order in range(degree + 1):
            factor = np.sqrt((2 * degree + 1) / (4 * np.pi) / scipy.special.poch(degree - order + 1, 2 * order))
            expected = factor * scipy.special.lpmv(order, degree, z)
            np.testing.assert_allclose(legendre(5, z)[degree, order], expected, atol=1e-13)
    c = np.zeros((3, 3), complex)
    c[2, 1] = 1j
    latitude, longitude, values = fluids.on_grid(c, 5, 8)
    P = legendre(2, np.sin(latitude))[2, 1]
    np.testing.assert_allclose(values, -2 * np.outer(P, np.sin(longitude)), atol=1e-14)


@pytest.mark.parametrize("size", [64, 128])
def test_matrices_of_harmonics_have_the_signs_of_closed_forms(size):
    # Of T_mm ∝ (−S₊)^m all entries have one sign; T_m+1,m ∝ S_z S₊^m + S₊^m S_z is odd about the middle; the entries
    # of T_N−1,m are (−1)^i √(C(N−1, i) C(N−1, i + m)).
    for m, columns in enumerate(_matrices(size)):
        own = (-1.0) ** m * columns
        assert np.all(own[:, 0] > -1e-13), m
        if m + 1 < size:
            upper = (size - m) // 2
            assert np.all(own[:upper, 1] > -1e-13) and np.all(own[-upper:, 1] < 1e-13), m
        assert np.all((-1.0) ** np.arange(size - m) * own[:, -1] > -1e-13), m


def test_waves_of_rossby_and_haurwitz_turn_at_their_rate_without_change_of_form():
    """c = 2(Ω + α)/(l(l + 1)) − α westwards, at N = l + 3, and nothing else appears, both to order h²."""
    rotation, spin, degree, order, duration = 0.7, 0.3, 3, 2, 1.0
    fluid = fluids.euler(6, rotation=rotation)
    start = fluids.start(fluid, fluids.rossby_haurwitz(degree, order, 0.5, spin))
    rate = 2 * (rotation + spin) / (degree * (degree + 1)) - spin
    errors, others = [], []
    for steps in (10, 20):
        path = co.trajectory(fluid, start, dt=duration / steps, steps=steps, method=co.IsospectralMidpoint())
        c = fluids.vorticity(fluid, path.final)
        errors.append(abs(c[degree, order] / 0.5 - np.exp(1j * order * rate * duration)))
        c[degree, order] = 0
        c[1, 0] -= 2 * spin * np.sqrt(4 * np.pi / 3)
        others.append(np.max(np.abs(c)))
        np.testing.assert_allclose(casimirs(fluid, path.final.mu), casimirs(fluid, start.mu), atol=1e-14)
    assert errors[1] < 2e-3 and others[1] < 1e-4
    for found in (errors, others):
        assert np.log2(found[0] / found[1]) == pytest.approx(2, abs=0.05)


def test_a_turbulent_fluid_keeps_energy_and_enstrophy():
    fluid = fluids.euler(9)
    start = fluids.start(fluid, fluids.random_vorticity(7, degree=8))
    run = co.simulate(fluid, start, dt=0.05, steps=60, method=co.IsospectralMidpoint(), accuracy=False)
    c = fluids.vorticity(fluid, run.records)
    assert run.dataset.enstrophy.values[0] == pytest.approx(1.0)
    assert run.relative_change("enstrophy") < 1e-13 and run.relative_change("kinetic_energy") < 1e-4
    l = np.arange(1, 9)
    energy = 0.5 * np.sum(fluids.power(c)[:, 1:] / (l * (l + 1)), axis=1)
    np.testing.assert_allclose(energy, run.dataset.kinetic_energy.values, rtol=1e-12)
    assert np.max(np.abs(c[-1] - c[0])) > 0.1


def test_what_is_no_fluid_is_refused():
    fluid = fluids.euler(4)
    for call, sentence in (
        (lambda: fluids.euler(1), "`size` must be a whole number N from 2, but is 1"),
        (lambda: fluids.euler(4, rotation=np.nan), "`rotation` must be a finite number, rad/s, but is nan"),
        (lambda: fluids.start(fluid, np.ones((5, 5))), r"\(L, L\) with L up to N = 4, but has shape \(5, 5\)"),
        (lambda: fluids.start(fluid, np.eye(3)), "must have mean 0, but c_00 is 1.0"),
        (lambda: fluids.from_coefficients(4, 1j * np.eye(2)), "must be real for m = 0"),
        (
            lambda: fluids.from_coefficients(4, np.triu(np.ones((3, 3)))),
            r"must be 0 where m > l, but c\[0, 1\] is 1\+0j",
        ),
        (lambda: fluids.rossby_haurwitz(3, 4, 1.0), "`order` must be from 1 to degree = 3, but is 4"),
        (lambda: fluids.start(co.System(co.SO3(), lambda xi: xi @ xi), np.eye(2)), "must be a fluid of co.models"),
    ):
        with pytest.raises(ArgumentError, match=sentence):
            call()
