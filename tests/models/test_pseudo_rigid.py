"""Pseudo-rigid bodies: figures of equilibrium, steady turns, frequencies, and circulation by the symmetry within."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import continuous
from coadjoint.models import pseudo_rigid
from systems import generator

EXACT = co.Midpoint(co.Exponential())
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def rates(body: co.System, state: co.State) -> tuple[np.ndarray, np.ndarray]:
    """U = F⁻¹Ḟ and its rate, (3, 3), and the rate of C."""
    slope = evaluate(lambda s: continuous.vector_field(body, s), state)
    hat = lambda x: np.tensordot(x, body.group.basis, axes=1)  # noqa: E731
    return hat(state.xi), hat(slope.xi), slope.a.reshape(3, 3)


def A(axes: np.ndarray, i: int) -> float:
    """A_i = a₁a₂a₃ ∫₀^∞ du/((a_i² + u)Δ) (Chandrasekhar, chapter 3)."""

    def integrand(u):
        return np.prod(axes) / ((axes[i] ** 2 + u) * np.sqrt(np.prod(axes**2 + u)))

    return quad(integrand, 0, 1, epsabs=1e-13)[0] + quad(integrand, 1, np.inf, epsabs=1e-13)[0]


def riemann(axes: np.ndarray) -> tuple[float, float]:
    """Ω and Λ of F = e^{ΩtT}Ae^{−ΛtT}, steady about the third axis, where G = m = r = 1 and a₁a₂a₃ = 1:

    e(Ω² + Λ²)a_i − 2eΩΛa_j + p/a_i = ∂W/∂a_i for i = 1, 2, p/a₃ = ∂W/∂a₃, with ∂W/∂a_i = (3/10) A_i a_i.
    """
    slopes = 0.3 * np.array([A(axes, i) for i in range(3)]) * axes
    p, e = slopes[2] * axes[2], 0.2
    first, second = (slopes[:2] - p / axes[:2]) / e
    squares, product = np.linalg.solve([[axes[0], -2 * axes[1]], [axes[1], -2 * axes[0]]], [first, second])
    plus, minus = np.sqrt(squares + 2 * product), np.sqrt(squares - 2 * product)
    return (plus + minus) / 2, (plus - minus) / 2


def fluid() -> co.System:
    return pseudo_rigid.gravitating(mass=1.0, radius=1.0, gravitational_constant=1.0)


def spheroid(e: float) -> np.ndarray:
    flat = np.sqrt(1 - e**2)
    return np.array([1.0, 1.0, flat]) / flat ** (1 / 3)


@pytest.mark.parametrize("e", [0.3, 0.8])
def test_maclaurins_spheroids_turn_at_their_rate(e: float):
    """Ω²/πGρ = 2√(1 − e²)(3 − 2e²) arcsin(e)/e³ − 6(1 − e²)/e²."""
    root = np.sqrt(1 - e**2)
    square = 3 / 4 * (2 * root * (3 - 2 * e**2) * np.arcsin(e) / e**3 - 6 * (1 - e**2) / e**2)  # πρ = 3/4
    axes, body = np.diag(spheroid(e)), fluid()
    state = pseudo_rigid.start(body, deformation=axes, velocity=np.sqrt(square) * TURN @ axes)
    U, U_dot, C_dot = rates(body, state)
    assert np.max(np.abs(U_dot)) < 1e-9 * square and np.max(np.abs(C_dot)) < 1e-14
    assert np.max(np.abs(U)) > 0.3 * e


@pytest.mark.parametrize("axes", [(1.3, 0.9), (1.2, 1.1)])
def test_riemanns_ellipsoids_turn_and_stream_within(axes: tuple[float, float]):
    """F = R(t)AQ(t)ᵀ: U and C = FᵀF turn with Q alone, U̇ = [Λ, U], Ċ = [Λ, C]."""
    a = np.array([*axes, 1 / np.prod(axes)])
    Omega, Lambda = riemann(a)
    body = fluid()
    velocity = Omega * TURN @ np.diag(a) - np.diag(a) @ (Lambda * TURN)
    state = pseudo_rigid.start(body, deformation=np.diag(a), velocity=velocity)
    U, U_dot, C_dot = rates(body, state)
    turn, C = Lambda * TURN, np.diag(a**2)
    np.testing.assert_allclose(U_dot, turn @ U - U @ turn, atol=2e-10)
    np.testing.assert_allclose(C_dot, turn @ C - C @ turn, atol=1e-13)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("swap", [False, True], ids=["Jacobi", "Dedekind"])
def test_jacobis_ellipsoid_turns_and_dedekinds_streams_and_both_keep_their_shape(swap: bool):
    """Dedekind's theorem: with F also Fᵀ is a motion, and a figure that turns becomes one that stands."""
    b = 0.7
    low, high = 0.45, 0.62  # c/a where a²b²A₁₂ = c²A₃, that is, Λ = 0

    def streaming(c: float) -> float:
        return riemann(np.array([1.0, b, c]) / (b * c) ** (1 / 3))[1]

    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if streaming(middle) * streaming(low) > 0 else (low, middle)
    a = np.array([1.0, b, low]) / (b * low) ** (1 / 3)
    Omega = riemann(a)[0]
    body, F = fluid(), np.diag(a)
    start = pseudo_rigid.start(body, deformation=F, velocity=Omega * (-F @ TURN if swap else TURN @ F))
    off = []
    for steps in (20, 40):
        end = co.trajectory(body, start, dt=1.0 / steps, steps=steps, method=EXACT).final.g
        turned = expm(Omega * TURN)
        off.append(np.max(np.abs(end - (F @ turned.T if swap else turned @ F))))
    assert off[1] < 2e-3 and off[0] / off[1] == pytest.approx(4, rel=0.05)
    assert np.max(np.abs(turned - np.eye(3))) > 0.45


def rubber(moments=(0.4, 0.4, 0.4)) -> co.System:
    return pseudo_rigid.elastic(moments=moments, shear=2.0, lame=3.0, volume=0.5)


def test_an_elastic_body_turns_steadily_where_its_stretches_balance():
    """eΩ²λ₁ = ∂V/∂λ₁ and ∂V/∂λ₃ = 0, ∂V/∂λ_i = v(G(λ_i − 1/λ_i) + λ ln J/λ_i)."""
    across = 1.2
    # G(λ₃² − 1) + λ(2 ln λ₁ + ln λ₃) = 0, by bisection
    low, high = 0.5, 1.0
    for _ in range(60):
        along = 0.5 * (low + high)
        value = 2.0 * (along**2 - 1) + 3.0 * (2 * np.log(across) + np.log(along))
        low, high = (along, high) if value < 0 else (low, along)
    log = 2 * np.log(across) + np.log(along)
    slope = 0.5 * (2.0 * (across - 1 / across) + 3.0 * log / across)
    F = np.diag([across, across, along])
    body = rubber()
    state = pseudo_rigid.start(body, deformation=F, velocity=np.sqrt(slope / (0.4 * across)) * TURN @ F)
    U, U_dot, C_dot = rates(body, state)
    assert np.max(np.abs(U)) > 0.5 and np.max(np.abs(U_dot)) < 1e-13 and np.max(np.abs(C_dot)) < 1e-14


@pytest.mark.long
@pytest.mark.parametrize(
    ("mode", "square"),
    [(np.eye(3), 0.5 * (2 * 2.0 + 3 * 3.0) / 0.4), (np.diag([1.0, -1.0, 0.0]), 2 * 0.5 * 2.0 / 0.4)],
    ids=["breathing", "shearing"],
)
def test_it_swings_about_rest_at_its_frequencies(mode: np.ndarray, square: float):
    body, size, ends = rubber(), 1e-6, []
    start = pseudo_rigid.start(body, deformation=np.eye(3) + size * mode)
    for steps in (40, 80):
        duration = 0.5 * np.pi / np.sqrt(square)  # a quarter of a period
        end = co.trajectory(body, start, dt=duration / steps, steps=steps).final.g - np.eye(3)
        ends.append(np.sum(end * mode) / np.sum(mode**2) / size)
    assert abs(ends[0]) > 1e-4 and ends[0] / ends[1] == pytest.approx(4, rel=0.05)
    assert abs((4 * ends[1] - ends[0]) / 3) < 1e-5


@pytest.mark.long
def test_a_map_that_does_not_turn_with_the_body_keeps_no_circulation():
    """τ(Ad_Qξ) = Qτ(ξ)Q⁻¹ does not hold of coordinates of the second kind."""
    body = rubber((0.4, 0.4, 0.4))
    random = generator("pseudo-rigid")
    F, F_dot = np.eye(3) + 0.15 * random.normal(size=(3, 3)), 0.5 * random.normal(size=(3, 3))
    start = pseudo_rigid.start(body, deformation=F, velocity=F_dot)
    run = co.simulate(
        body, start, dt=0.02, steps=100, method=co.LeftRectangle(co.difference_maps.SecondKind()), accuracy=False
    )
    assert run.relative_change("kelvin_noether") < 1e-12
    assert max(np.ptp(run.dataset[f"circulation_{axis}"].values) for axis in "xyz") > 1e-8


@pytest.mark.long
@pytest.mark.cases(3)
@pytest.mark.parametrize("method", [co.Midpoint(), co.LeftRectangle(co.Exponential())], ids=["midpoint", "left"])
@pytest.mark.parametrize("moments", [(0.4, 0.4, 0.4), (0.4, 0.6, 0.5)], ids=["round", "not round"])
def test_circulation_is_kept_by_the_symmetry_within_and_angular_momentum_by_that_of_space(method, moments):
    body = rubber(moments)
    random = generator("pseudo-rigid")
    F, F_dot = np.eye(3) + 0.15 * random.normal(size=(3, 3)), 0.5 * random.normal(size=(3, 3))
    start = pseudo_rigid.start(body, deformation=F, velocity=F_dot)
    run = co.simulate(body, start, dt=0.02, steps=200, method=method, accuracy=False)
    assert run.relative_change("kelvin_noether") < 1e-12
    moved = max(np.ptp(run.dataset[f"circulation_{axis}"].values) for axis in "xyz")
    assert moved < 1e-13 if moments[0] == moments[1] else moved > 1e-2
    C = np.einsum("tji,tjk->tik", run.records.g, run.records.g)
    np.testing.assert_allclose(run.records.a.reshape(-1, 3, 3), C, atol=1e-12)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: pseudo_rigid.elastic(moments=(1.0, 1.0, -1.0), shear=1.0, lame=1.0), "`moments` must be"),
        (lambda: pseudo_rigid.start(rubber(), deformation=np.diag([1.0, 1.0, -1.0])), "a positive determinant"),
        (lambda: pseudo_rigid.start(fluid(), deformation=2 * np.eye(3)), "`g` must lie in SLn"),
        (lambda: pseudo_rigid.start(fluid(), velocity=np.eye(3)), "must keep its volume, tr F⁻¹Ḟ = 0, but .* 3/s"),
        (
            lambda: pseudo_rigid.start(fluid(), deformation=np.diag([10.0, 10.0, 0.01])),
            "one axis of which is 0.001 of another, but its gravity is right from 0.05 on",
        ),
        (lambda: co.simulate(fluid(), pseudo_rigid.start(fluid()), dt=0.1, steps=1), "Cayley"),
        (lambda: pseudo_rigid.start(co.System(co.SO3(), lambda xi: xi @ xi)), "a body of co.models.pseudo_rigid"),
    ],
)
def test_what_no_such_body_can_do_is_told_in_a_sentence(call, says):
    with pytest.raises(co.errors.CoadjointError, match=says):
        call()
