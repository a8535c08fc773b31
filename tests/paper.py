"""The paper's schemes for its vehicle, (P88) and (P97), in NumPy as the paper has them, with Newton on f."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import coadjoint as co

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


def run(scheme, omega, h, steps, q=(0.0, 0.0, 1.0), through_s=False):
    """The scheme from R = I: the values of (P51) with 𝒦 = a, and (g, n, ω, ν) of the last node.

    With `through_s` the velocity is what remains of it in s = n + hν, as if s were the unknown.
    """
    g, n, a, nu = np.eye(3), np.array(q), np.array([0, 0, 1.0]), VELOCITY
    quantities = []
    for _ in range(steps):
        s = n + h * nu
        nu = (s - n) / h if through_s else nu
        quantities.append(a @ (scheme.f(omega, h) - np.cross(M @ nu, s)))
        F = scheme.F(omega, h)
        momentum = scheme.f(-omega, h)
        g, n, a = g @ F, F.T @ s, F.T @ a
        nu = np.linalg.solve(M, F.T @ M @ nu + h * WEIGHT * a)
        right = -momentum - h * BUOYANCY * np.cross(R_BUOYANCY, a) + h * np.cross(M @ nu, nu)
        for _ in range(6):
            increment = np.linalg.solve(scheme.jacobian(omega, h), right - scheme.f(omega, h))
            omega = omega + increment
        assert np.max(np.abs(scheme.f(omega, h) - right)) < 1e-12 * np.max(np.abs(right))
    return np.array(quantities), (g, n, omega, nu)


def vehicle() -> co.System:
    """The same vehicle in the library (P57–P62)."""

    def lagrangian(xi, n, nu, a):
        return 0.5 * nu @ M @ nu + 0.5 * xi @ J @ xi + WEIGHT * n @ a - BUOYANCY * R_BUOYANCY @ a

    return co.System(co.SO3(), lagrangian, additional=co.Defining(), advected=co.Defining())
