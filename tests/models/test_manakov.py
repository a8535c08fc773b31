"""The rigid body in n dimensions: its Lax pair, its integrals, Jacobi's functions for n = 3, and steady turns."""

from __future__ import annotations

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import catalogue, manakov
from systems import generator


def momentum(system: co.System, name: str = "manakov") -> np.ndarray:
    return generator(name, system.group.dim).normal(size=system.group.dim)


def velocity(system: co.System, mu: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """ξ = ∂ℋ/∂μ, by JAX, and μ̇ = ad*_ξ μ."""
    p = system.parameters
    xi = evaluate(jax.grad(lambda mu: manakov.energy(mu, p)), mu)
    return xi, evaluate(system.group.ad_dual, xi, mu)


@pytest.mark.parametrize("n", [3, 4, 7])
@pytest.mark.parametrize("z", [0.0, 0.7, -3.0])
def test_the_equation_of_motion_is_a_lax_equation_at_every_z(n: int, z: float):
    system = manakov.body(moments=np.linspace(0.5, 3.0, n) ** 1.5)
    mu = momentum(system)
    xi, slope = velocity(system, mu)
    L, B = manakov.lax_pair(system, mu, z)
    still = manakov.lax_pair(system, np.zeros_like(mu), z)
    np.testing.assert_allclose(B - still[1], evaluate(system.group.hat, xi), atol=1e-14)
    moving = manakov.lax_pair(system, slope, 0.0)[0]
    np.testing.assert_allclose(L @ B - B @ L, moving, atol=1e-12 * np.max(np.abs(L)) ** 2)


def test_the_traces_are_those_of_the_matrices():
    system = manakov.body(moments=[1.0, 2.0, 3.5, 5.0, 0.7])
    mu, z = momentum(system), 0.3
    found = manakov.integrals(system, mu)
    squares = np.array([1.0, 2.0, 3.5, 5.0, 0.7]) ** 2
    for k in range(2, 6):
        L = manakov.lax_pair(system, mu, z)[0]
        parts = sum(value * z**j for (power, j), value in found.items() if power == k)
        assert parts + z**k * np.sum(squares**k) == pytest.approx(np.trace(np.linalg.matrix_power(L, k)), rel=1e-13)
    assert set(found) == {(2, 0), (3, 1), (4, 0), (4, 2), (5, 1), (5, 3)}  # 10 − 2 Casimirs = 2 · 4 integrals


@pytest.mark.long
@pytest.mark.parametrize("method", [co.IsospectralMidpoint(), co.LeftRectangle(co.Cayley())], ids=["iso", "left"])
def test_both_rules_keep_the_casimirs_and_hold_the_spectral_curve_in_a_band(method):
    """The left rule, too, has the order 2 where no parameter is advected."""
    system = manakov.body(moments=[1.0, 2.0, 3.5, 5.0, 0.7])
    start = system.state(mu=momentum(system))
    bands = []
    for h in (0.02, 0.01):
        run = co.simulate(system, start, dt=h, duration=4.0, method=method, accuracy=False)
        traces = manakov.integrals(system, run.records.mu)
        for casimir in ((2, 0), (4, 0)):
            assert np.ptp(traces[casimir]) < 2e-13 * np.max(np.abs(traces[casimir]))
        moved = [np.max(np.abs(traces[key] / traces[key][0] - 1)) for key in ((3, 1), (4, 2), (5, 1), (5, 3))]
        curve = [manakov.spectral_polynomial(system, mu, 0.4) for mu in (run.records.mu[0], run.records.mu[-1])]
        bands.append([*moved, np.max(np.abs(curve[1] - curve[0]))])
        np.testing.assert_allclose(run.dataset.trace_4_2.values, traces[4, 2], rtol=1e-12)
    np.testing.assert_allclose(np.log2(np.divide(*bands)), 2, atol=0.1)
    assert np.max(bands[1][:-1]) < 1e-2


@pytest.mark.long
def test_in_three_dimensions_it_is_eulers_body():
    moments = np.array([0.4, 1.0, 1.7])
    inertia = moments.sum() - moments
    omega = np.array([0.3, 1.1, -0.5])
    euler = catalogue["free_rigid_body"].make(inertia=tuple(inertia))
    first = co.simulate(euler, euler.state(xi=omega), dt=0.02, steps=100, accuracy=False, monitors=False).final
    ours = manakov.body(moments=moments)
    skew = np.array([[0, -omega[2], omega[1]], [omega[2], 0, -omega[0]], [-omega[1], omega[0], 0]])
    second = co.simulate(
        ours, manakov.start(ours, angular_velocity=skew), dt=0.02, steps=100, accuracy=False, monitors=False
    ).final
    np.testing.assert_allclose(second.g, first.g, atol=1e-13)
    np.testing.assert_allclose(second.mu, [first.mu[2], -first.mu[1], first.mu[0]], atol=1e-13)


@pytest.mark.long
@pytest.mark.cases(2)
@pytest.mark.parametrize(("order", "grows"), [((0, 1, 2), False), ((1, 0, 2), True), ((2, 0, 1), False)])
def test_turns_in_one_plane_stand_and_are_unstable_about_the_middle_axis(order: tuple[int, ...], grows: bool):
    """In four dimensions with the fourth axis at rest: σ² = Ω²(I_c − I_a)(I_b − I_c)/(I_a I_b), as Euler's."""
    moments = np.array([1.0, 2.0, 3.0, 10.0])
    axis, first, second = order  # turns in the plane of the two others
    system = manakov.body(moments=moments)
    Omega = np.zeros((4, 4))
    Omega[second, first], Omega[first, second] = 2.0, -2.0
    start = manakov.start(system, angular_velocity=Omega)
    run = co.simulate(system, start, dt=0.05, steps=40, method=co.IsospectralMidpoint(), accuracy=False)
    assert np.max(np.abs(run.records.mu - start.mu)) < 1e-14
    off = Omega.copy()
    off[second, axis], off[axis, second] = 1e-7, -1e-7
    near = manakov.start(system, angular_velocity=off)
    run = co.simulate(system, near, dt=0.01, steps=600, method=co.IsospectralMidpoint(), accuracy=False)
    I = moments[:3].sum() - moments[:3]
    square = 4.0 * (I[axis] - I[first]) * (I[second] - I[axis]) / (I[first] * I[second])
    away = np.linalg.norm(run.records.mu - start.mu, axis=1)
    assert (square > 0) == grows
    if grows:
        assert np.log(away[600] / away[400]) / 2.0 == pytest.approx(np.sqrt(square), rel=2e-2)
    else:
        assert np.max(away) < 1e-5


@pytest.mark.long
def test_fifty_dimensions_step():
    """1225 momenta: no basis is formed."""
    system = manakov.body(moments=np.linspace(1.0, 2.0, 50))
    start = system.state(mu=momentum(system))
    run = co.simulate(system, start, dt=0.005, steps=5, method=co.IsospectralMidpoint(), accuracy=False)
    spectra = [np.linalg.eigvalsh(1j * manakov.lax_pair(system, mu, 0.0)[0]) for mu in run.records.mu[[0, -1]]]
    np.testing.assert_allclose(spectra[1], spectra[0], atol=1e-13 * np.max(np.abs(spectra[0])))


BODY = manakov.body(moments=[1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: manakov.body(moments=[1.0]), "two or more numbers, but has shape"),
        (lambda: manakov.body(moments=[1.0, -2.0, 5.0]), "those of the axes 2 and 1 make -1: a body has a mass"),
        (
            lambda: manakov.start(manakov.body(moments=[1.0, 2.0, 3.0]), angular_velocity=np.eye(3)),
            "must be skew, but Ω \\+ Ωᵀ has an entry of 2 rad/s",
        ),
        (
            lambda: jax.jit(lambda mu: manakov.integrals(BODY, mu)[2, 0])(np.zeros(3)),
            "computed from numbers: under jax.jit observe `trace_k_j`",
        ),
        (lambda: manakov.body(moments=[1.0, 2.0]).replace(moments=[1, 2, 3]), "must hold 2 numbers"),
        (
            lambda: manakov.lax_pair(catalogue["free_rigid_body"].make(), np.zeros(3), 0.0),
            "a body of co.models.manakov",
        ),
        (
            lambda: manakov.start(
                co.models.pseudo_rigid.elastic(moments=[1, 2, 3], shear=1, lame=1), angular_velocity=np.zeros(9)
            ),
            "a body of co.models.manakov",
        ),
        (lambda: manakov.integrals(BODY, np.zeros(6)), r"`mu` must have shape \(…, 3\), but has shape \(6,\)"),
        (lambda: manakov.integrals(BODY, [0.0, np.nan, 0.0]), "`mu` must be finite"),
        (lambda: manakov.lax_pair(BODY, np.zeros(3), np.array([1.0, 2.0])), "`z` must be a finite number"),
        (lambda: manakov.spectral_polynomial(BODY, np.zeros((2, 3)), 1.0), r"of one momentum, but has shape \(2, 3\)"),
    ],
)
def test_what_is_no_body_is_told_in_a_sentence(call, says):
    with pytest.raises(co.errors.ArgumentError, match=says):
        call()


def test_a_rate_that_is_skew_to_round_off_is_one():
    """RΩRᵀ of rotations R has an error of round-off."""
    body = manakov.body(moments=[1.0, 2.0, 3.0, 0.7])
    random = np.random.default_rng(3)
    R, S = np.linalg.qr(random.normal(size=(4, 4)))[0], random.normal(size=(4, 4))
    Omega = R @ (S - S.T) @ R.T
    assert not np.array_equal(Omega, -Omega.T)
    exact = manakov.start(body, angular_velocity=0.5 * (Omega - Omega.T))
    np.testing.assert_allclose(manakov.start(body, angular_velocity=Omega).mu, exact.mu, rtol=1e-13)


def test_a_complex_spectral_parameter_has_a_complex_curve():
    mu, z = np.array([1.0, -2.0, 0.5]), 1 + 2j
    found = manakov.spectral_polynomial(BODY, mu, z)
    for w in (0.3, -1 + 0.5j):
        expected = np.linalg.det(w * np.eye(3) - manakov.lax_pair(BODY, mu, z)[0])
        assert abs(np.polyval(found, w) - expected) < 1e-12 * abs(expected)
