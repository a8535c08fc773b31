"""Zeitlin's fluids on the sphere: the Laplacian, harmonics in and out, waves that are exact in space, Casimirs."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest
import scipy.special
from llvmlite import ir

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.run.xla_function import PREFIX, ready
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import fluids
from coadjoint.models.fluids.harmonics import legendre, on_diagonal
from coadjoint.models.fluids.laplacian import dirichlet, inverse_laplacian, laplacian
from coadjoint.models.fluids.laplacian_sweep import emit_sweep
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


@pytest.mark.parametrize("size", [2, 9])
def test_machine_code_inverts_the_laplacian_as_a_dense_solution_does(size):
    """For one function and for several, whose numbers are the same bits."""
    import jax

    assert ready(f"{PREFIX}sweep")
    columns = [np.asarray(evaluate(lambda w: laplacian(size, w), w)) for w in np.eye(size**2)]
    several = generator("dense", size).normal(size=(3, size**2))
    mean = np.eye(size).ravel() / size
    centred = several - np.outer(several @ np.eye(size).ravel(), mean)
    expected = np.linalg.lstsq(np.transpose(columns), centred.T)[0].T  # the least solution has no mean
    with jax.enable_x64(True):
        solve = jax.jit(lambda w: inverse_laplacian(size, w))
        found, together = np.array([solve(w) for w in several]), np.asarray(jax.vmap(solve)(several))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
    assert np.array_equal(found, together)


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


def test_functions_come_back_from_theirharmonics_of_diagonals():
    c = fluids.random_vorticity(3, degree=5, enstrophy=2.0)
    found = fluids.coefficients_of(8, fluids.from_coefficients(8, c))
    np.testing.assert_allclose(found[:6, :6], c, atol=1e-14)
    assert np.max(np.abs(found[6:])) < 1e-14
    assert fluids.power_spectrum(c).sum() == pytest.approx(4.0)  # ∫ω² = 2 · enstrophy


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
    for m in range(size):
        own = (-1.0) ** m * on_diagonal(size, m)
        assert np.all(own[:, 0] > -1e-13), m
        if m + 1 < size:
            upper = (size - m) // 2
            assert np.all(own[:upper, 1] > -1e-13) and np.all(own[-upper:, 1] < 1e-13), m
        assert np.all((-1.0) ** np.arange(size - m) * own[:, -1] > -1e-13), m


def on_the_sphere(function, degree):
    """c_lm (degree + 1, degree + 1) of a polynomial of x (3, …), by Gauss's and the trapezoidal rule, exact here."""
    z, weights = np.polynomial.legendre.leggauss(degree + 2)
    longitude = 2 * np.pi * np.arange(2 * degree + 3) / (2 * degree + 3)
    sine = np.sqrt(1 - z * z)[:, None]
    values = function(np.stack([sine * np.cos(longitude), sine * np.sin(longitude), z[:, None] + 0 * longitude]))
    waves = np.exp(-1j * np.outer(np.arange(degree + 1), longitude)) * 2 * np.pi / len(longitude)
    return np.einsum("t,lmt,mp,tp->lm", weights, legendre(degree, z), waves, values)


@pytest.mark.parametrize("size", [16, 64])
def test_commutators_of_matrices_are_poisson_brackets(size):
    """[W_f, W_g]/ħ is W of −{f, g} to order 1/N², where {x, y} = z: of f = (a·x)³ and g = (b·x)²."""
    a, b = np.array([0.3, -0.8, 0.5]), np.array([0.7, 0.4, -0.2])
    f, g, bracket = (
        on_the_sphere(function, 5)
        for function in (
            lambda x: np.tensordot(a, x, 1) ** 3,
            lambda x: np.tensordot(b, x, 1) ** 2,
            lambda x: 6 * np.tensordot(a, x, 1) ** 2 * np.tensordot(b, x, 1) * np.tensordot(np.cross(a, b), x, 1),
        )
    )
    group = co.Un(size)
    F, G = (fluids.from_coefficients(size, c) for c in (f, g))
    found = fluids.coefficients_of(size, evaluate(group.ad, F, G) / (2 / np.sqrt(size**2 - 1)))
    error = np.max(np.abs(found[:6, :6] + bracket)) / np.max(np.abs(bracket))
    assert error < 6 / size**2 and np.max(np.abs(found[6:])) < 1e-12


def test_random_fields_have_the_spectrum_that_is_asked_for():
    shares = [0, 0, 1.0, 3.0, 0.5]
    c = fluids.random_vorticity(1, degree=4, enstrophy=0.7, spectrum=shares)
    np.testing.assert_allclose(fluids.power_spectrum(c), 2 * 0.7 * np.array(shares) / 4.5, atol=1e-15)
    assert fluids.power_spectrum(fluids.random_vorticity(1, degree=4, enstrophy=0.7)).sum() == pytest.approx(1.4)


def test_vortices_have_their_profile():
    """On the grid ω is the sum of exp((cos γ − 1)/r²), less its mean (1 − e^{−2κ})/(2κ) a vortex."""
    places, strengths, radius = np.array([[0.4, 1.0], [-0.7, 4.0]]), np.array([2.0, -1.0]), 0.4
    latitude, longitude, omega = fluids.on_grid(fluids.vortices(30, places, strengths, radius), 13, 24)
    kappa = 1 / radius**2
    expected = 0.0
    for (north, east), s in zip(places, strengths, strict=True):
        turned = np.cos(latitude)[:, None] * np.cos(north) * np.cos(longitude - east)
        cosine = turned + np.sin(latitude)[:, None] * np.sin(north)
        expected += s * (np.exp(kappa * (cosine - 1)) - (1 - np.exp(-2 * kappa)) / (2 * kappa))
    np.testing.assert_allclose(omega, expected, atol=1e-12)


@pytest.mark.long
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


@pytest.mark.long
def test_a_turbulent_fluid_keeps_energy_and_enstrophy():
    fluid = fluids.euler(9)
    start = fluids.start(fluid, fluids.random_vorticity(7, degree=8))
    run = co.simulate(fluid, start, dt=0.05, steps=60, method=co.IsospectralMidpoint(), accuracy=False)
    c = fluids.vorticity(fluid, run.records)
    assert run.dataset.enstrophy.values[0] == pytest.approx(1.0)
    assert run.relative_change("enstrophy") < 1e-13 and run.relative_change("kinetic_energy") < 1e-4
    l = np.arange(1, 9)
    energy = 0.5 * np.sum(fluids.power_spectrum(c)[:, 1:] / (l * (l + 1)), axis=1)
    np.testing.assert_allclose(energy, run.dataset.kinetic_energy.values, rtol=1e-12)
    assert np.max(np.abs(c[-1] - c[0])) > 0.1


@pytest.mark.long
def test_a_fluid_goes_on_from_the_harmonics_of_its_end_and_any_scale_of_shares_is_the_same():
    fluid = fluids.euler(6, rotation=0.5)
    shares = np.array([0.0, 1.0, 2.0, 0.5])
    c, small = (fluids.random_vorticity(3, 3, 1.0, scale * shares) for scale in (1.0, 1e-308))
    np.testing.assert_allclose(small, c, rtol=1e-14)
    start = fluids.start(fluid, c)
    end = co.trajectory(fluid, start, dt=0.05, steps=60, method=co.IsospectralMidpoint()).final
    found = fluids.vorticity(fluid, end)
    assert found[0, 0] != 0
    np.testing.assert_allclose(fluids.start(fluid, found).mu, end.mu, rtol=0, atol=1e-14)


@pytest.mark.long
def test_a_spectrum_does_not_drift():
    """Random signs of round-off over 4000 steps leave 5e-15; what each step leaves of its iteration would add up."""
    fluid = fluids.euler(8)
    start = fluids.start(fluid, fluids.random_vorticity(1, degree=7))
    end = co.trajectory(fluid, start, dt=0.7, steps=4000, save_every=4000, method=co.IsospectralMidpoint()).final
    first, last = casimirs(fluid, start.mu), casimirs(fluid, end.mu)
    assert np.max(np.abs(last - first)) < 1.2e-14 * np.max(np.abs(first))


@pytest.mark.long
def test_datasets_have_units():
    size: Any = np.int64(3)
    fluid = fluids.euler(size)
    start = fluids.start(fluid, fluids.random_vorticity(7, degree=2))
    data = co.simulate(fluid, start, dt=0.1, steps=2, method=co.IsospectralMidpoint(), accuracy=False).dataset
    assert {name: data[name].attrs["units"] for name in ("mu", "xi", "enstrophy", "kinetic_energy", "energy")} == {
        "mu": "1/s", "xi": "1/s", "enstrophy": "1/s^2", "kinetic_energy": "1/s^2", "energy": "1/s^2"
    }  # fmt: skip


def test_what_does_not_fit_in_memory_is_refused_before_it_is_tried(monkeypatch):
    """4 GB: steps of N = 4096 need 60 arrays of N² numbers, all harmonics of N = 1200 N³/3."""
    fluid = fluids.euler(100)
    start = fluids.start(fluid, fluids.random_vorticity(1, degree=3))
    monkeypatch.setattr("coadjoint.memory.installed", lambda: 4e9)
    monkeypatch.setattr("coadjoint.simulation.members.MEMORY_LIMIT", 1e8)
    for call, sentence in (
        (
            lambda: fluids.euler(4096),
            "N = 4096 would take 8.05 GB of memory, and this machine has 4 GB: take N up to 2886",
        ),
        (lambda: fluids.coefficients_of(1200, np.zeros(1200**2)), "would take 4.61 GB .*: take N up to 1144"),
        (
            lambda: co.trajectory(fluid, start, dt=1.0, steps=10_000, method=co.IsospectralMidpoint()),
            r"The 10,000 records of this trajectory would take .* GB of memory: raise save_every from 1 to \d+",
        ),
    ):
        with pytest.raises(ArgumentError, match=sentence):
            call()


def test_what_is_no_fluid_is_refused():
    fluid, fraction = fluids.euler(4), cast(Any, 2.5)
    for call, sentence in (
        (lambda: fluids.euler(1), "`size` must be a whole number from 2, but is 1"),
        (lambda: fluids.euler(4, rotation=np.nan), "`rotation` must be a finite number, but is nan"),
        (
            lambda: fluids.start(fluid, np.tril(np.ones((5, 5)))),
            r"\(L, L\) with L up to N = 4, degrees up to 3, but has shape \(5, 5\)",
        ),
        (lambda: fluids.start(fluid, np.eye(3)), "must have mean 0, but c_00 is 1.0"),
        (lambda: fluids.from_coefficients(4, 1j * np.eye(2)), "must be real for m = 0"),
        (
            lambda: fluids.from_coefficients(4, np.triu(np.ones((3, 3)))),
            r"must be 0 where m > l, but c\[0, 1\] is 1\+0j",
        ),
        (lambda: fluids.power_spectrum(np.ones((2, 2))), r"must be 0 where m > l, but c\[0, 1\]"),
        (lambda: fluids.on_grid(np.ones(3)), r"must be finite numbers c_lm, \(…, L, L\), but is array"),
        (lambda: fluids.on_grid(np.eye(2), 1), "`latitudes` must be a whole number from 2, but is 1"),
        (lambda: fluids.random_vorticity(1, degree=0), "`degree` must be a whole number from 1, but is 0"),
        (lambda: fluids.random_vorticity(1, enstrophy=-1), "`enstrophy` must be a finite number from 0, but is -1"),
        (lambda: fluids.random_vorticity(1, 2, spectrum=[1, 1, 1]), "`spectrum` must hold 3 shares from 0"),
        (lambda: fluids.rossby_haurwitz(fraction, 1, 1.0), "`degree` must be a whole number from 1, but is 2.5"),
        (lambda: fluids.rossby_haurwitz(2, 1, np.inf), "`amplitude` must be a finite number, but is inf"),
        (lambda: fluids.vortices(9, [[2.0, 0]], [1.0], 0.3), "`places` must have latitudes from −π/2 to π/2"),
        (lambda: fluids.vortices(9, [0.1, 0], [1.0], 0.3), r"have the shapes \(2,\) and \(1,\)"),
        (lambda: fluids.vortices(9, [[0.1, 0]], [1.0], 0), "`radius` must be positive, but is 0"),
        (lambda: fluids.rossby_haurwitz(3, 4, 1.0), "`order` must be a whole number from 1 to 3, but is 4"),
        (lambda: fluids.start(co.System(co.SO3(), lambda xi: xi @ xi), np.eye(2)), "must be a fluid of co.models"),
    ):
        with pytest.raises(ArgumentError, match=sentence):
            call()


def test_what_xla_calls_is_seen_outside_of_its_module_and_what_it_calls_is_not():
    module = ir.Module()
    emit_sweep(module, "sweep")
    assert {one.name: one.linkage for one in module.functions} == {"sweep_loops": "internal", "sweep": ""}
