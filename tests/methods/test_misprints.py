"""The paper's scheme for the vehicle, and its misprints: as printed they fail, corrected they pass.

The schemes (P88) and (P97) are written here in NumPy as the paper has them, with Newton on f of (P89) and (P98).
"""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.evaluate import evaluate
from stepping import Stepper
from systems import generator

J = np.diag([5.46, 5.29, 5.72])
M = np.diag([123.8 + 65, 123.8 + 70, 123.8 + 75])
R_BUOYANCY, BUOYANCY, WEIGHT = np.array([0, 0, -0.007]), 1215.8, 123.8 * 9.81 - 1215.8
FAST = np.radians([100.0, 30.0, 200.0])
VELOCITY = np.array([0.1, 0.1, 0.8])


def hat(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


class Cayley:
    """F and f of (P89)."""

    name = "cayley"

    def F(self, omega, h):
        half = 0.5 * h * hat(omega)
        return np.linalg.solve(np.eye(3) - half, np.eye(3) + half)

    def f(self, omega, h, np=np):
        p = J @ omega
        turned = np.cross(omega, p)
        return p + h / 2 * turned + h**2 / 4 * (omega @ omega * p + np.cross(omega, turned))

    def jacobian(self, omega, h, printed=False):
        """(P90), where 2ω(Jω)ᵀ must read 2(Jω)ωᵀ."""
        p, W = J @ omega, hat(omega)
        outer = np.outer(omega, p) if printed else np.outer(p, omega)
        rest = omega @ omega * J - hat(np.cross(omega, p)) + W @ (W @ J - hat(p))
        return J + h / 2 * (W @ J - hat(p)) + h**2 / 4 * (2 * outer + rest)


@dataclass
class Exponential:
    """F and f of (P98), with α at θ = h‖ω‖, or at ‖ω‖ as printed in (P93), (P95)."""

    printed: bool = False
    name = "exponential"

    def F(self, omega, h):
        angle = h * np.linalg.norm(omega)
        W = h * hat(omega)
        return np.eye(3) + np.sin(angle) / angle * W + (1 - np.cos(angle)) / angle**2 * W @ W

    def alpha(self, omega, h, np=np):
        angle = np.sqrt(omega @ omega) * (1.0 if self.printed else h)
        return (1 - angle / 2 / np.tan(angle / 2)) / angle**2

    def f(self, omega, h, np=np):
        p = J @ omega
        turned = np.cross(omega, p)
        return p + h / 2 * turned + h**2 * self.alpha(omega, h, np) * np.cross(omega, turned)

    def jacobian(self, omega, h, transposed=False, without_h=False):
        """(P99) with (P100): the last term must be (ω×(ω×Jω))(∂α/∂ω)ᵀ, and θ = h‖ω‖ in α and its derivative."""
        p, W, scale = J @ omega, hat(omega), 1.0 if (self.printed or without_h) else h
        turned, t = np.cross(omega, p), scale * np.linalg.norm(omega)
        slope = (t**2 / 4 / np.sin(t / 2) ** 2 - 2 + t / 2 / np.tan(t / 2)) * scale**2 * omega / t**4
        last = np.outer(np.cross(omega, turned), slope)
        middle = self.alpha(omega, h) * (-hat(turned) + W @ (W @ J - hat(p)))
        return J + h / 2 * (W @ J - hat(p)) + h**2 * (middle + (last.T if transposed else last))


def run(scheme, omega, h, steps):
    """The scheme from R = I, q = (0, 0, 1): the values of (P51) with 𝒦 = a, and (g, n, ω, ν) of the last node."""
    g, n, a, nu = np.eye(3), np.array([0, 0, 1.0]), np.array([0, 0, 1.0]), VELOCITY
    quantities = []
    for _ in range(steps):
        quantities.append(a @ (scheme.f(omega, h) - np.cross(M @ nu, n + h * nu)))
        F = scheme.F(omega, h)
        momentum = scheme.f(-omega, h)
        g, n, a = g @ F, F.T @ (n + h * nu), F.T @ a
        nu = np.linalg.solve(M, F.T @ M @ nu + h * WEIGHT * a)
        right = -momentum - h * BUOYANCY * np.cross(R_BUOYANCY, a) + h * np.cross(M @ nu, nu)
        for _ in range(12):
            increment = np.linalg.solve(scheme.jacobian(omega, h), right - scheme.f(omega, h))
            omega = omega + increment
        assert np.max(np.abs(scheme.f(omega, h) - right)) < 1e-12 * np.max(np.abs(right))
    return np.array(quantities), (g, n, omega, nu)


def differentiated(scheme, omega, h):
    return evaluate(jax.jacfwd(lambda w: scheme.f(w, h, jnp)), omega)


@pytest.fixture
def omega():
    return generator("misprints").normal(size=3)


def test_jacobian_of_the_cayley_scheme(omega):
    scheme, expected = Cayley(), differentiated(Cayley(), omega, 0.3)
    np.testing.assert_allclose(scheme.jacobian(omega, 0.3), expected, rtol=0, atol=1e-14 * np.max(np.abs(expected)))
    assert np.max(np.abs(scheme.jacobian(omega, 0.3, printed=True) - expected)) > 1e-3


def test_jacobian_of_the_exponential_scheme(omega):
    scheme, expected = Exponential(), differentiated(Exponential(), omega, 0.3)
    size = np.max(np.abs(expected))
    np.testing.assert_allclose(scheme.jacobian(omega, 0.3), expected, rtol=0, atol=1e-14 * size)
    assert np.max(np.abs(scheme.jacobian(omega, 0.3, transposed=True) - expected)) > 1e-5
    assert np.max(np.abs(scheme.jacobian(omega, 0.3, without_h=True) - expected)) > 1e-5


def test_printed_argument_of_alpha_destroys_the_kelvin_noether_quantity():
    """Relative drift over 20 s: 1e-4, 2.4e-5, 6e-6 at h = 0.1, 0.05, 0.025 as printed; ≤ 4e-13 at θ = h‖ω‖."""
    for h, expected in ((0.1, 1e-4), (0.05, 2.4e-5), (0.025, 6e-6)):
        steps = round(20 / h)
        printed, _ = run(Exponential(printed=True), FAST, h, steps)
        corrected, _ = run(Exponential(), FAST, h, steps)
        drift, kept = (np.max(np.abs(x / x[0] - 1)) for x in (printed, corrected))
        assert drift == pytest.approx(expected, rel=0.25)
        assert kept <= 4e-13


@pytest.mark.parametrize("scheme", [Cayley(), Exponential()], ids=lambda s: s.name)
def test_left_rule_with_velocity_start_is_the_paper_s_scheme(scheme):
    """(P73), (P74) step by step; after 40 steps of 0.05 s round-off has grown by the fast rotation."""
    tau = {"cayley": co.Cayley(), "exponential": co.Exponential()}[scheme.name]

    def lagrangian(xi, n, nu, a):
        return 0.5 * nu @ M @ nu + 0.5 * xi @ J @ xi + WEIGHT * n @ a - BUOYANCY * R_BUOYANCY @ a

    vehicle = co.System(co.SO3(), lagrangian, additional=co.Defining(), advected=co.Defining())
    start = vehicle.state(q=[0, 0, 1], xi=FAST, qdot=VELOCITY, a0=[0, 0, 1])
    leaps = Stepper(vehicle, co.LeftRectangle(tau, start="velocity"), compiled=True).run(start, 0.05, 41)
    _, (g, n, omega, nu) = run(scheme, FAST, 0.05, 40)
    last = leaps[40].record
    for found, expected in ((last.g, g), (last.n, n), (last.xi, omega), (last.nu, nu)):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * (1 + np.max(np.abs(expected))))
