"""The free rigid body in Jacobi's elliptic functions, attitude included.

Celledoni, Fassò, Säfström and Zanna (2008), The exact computation of the free rigid body motion and its use in
splitting methods, SIAM J. Sci. Comput. 30. Written here from the equations ṁ = m × J⁻¹m, Ṙ = R(J⁻¹m)^×.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from problem import Problem, turn_about
from scipy.special import ellipj, ellipkinc, elliprf, elliprj

import coadjoint as co
from coadjoint.models import catalogue

_SEPARATRIX = 1e-13


@dataclass(frozen=True)
class FreeRigidBody(Problem):
    """J = diag(inertia), body angular momentum m₀, attitude R(0).

    With G = |m|, E the energy, c the principal axis that m circles, b the middle one, a the other:
    m_a = A cn u, m_b = B sn u, m_c = C dn u, u = λt + u₀, A² = J_a(2EJ_c − G²)/(J_c − J_a),
    B² = J_b(2EJ_c − G²)/(J_c − J_b), C² = J_c(G² − 2EJ_a)/(J_c − J_a), λ² = (G² − 2EJ_a)(J_c − J_b)/(J_aJ_bJ_c),
    k² = (2EJ_c − G²)(J_a − J_b)/((G² − 2EJ_a)(J_b − J_c)).
    The line of nodes L × R e_c turns about L = R m by ψ̇ = G(2E − m_c²/J_c)/(G² − m_c²).
    """

    name: str
    inertia: tuple[float, float, float]
    momentum: tuple[float, float, float]
    turned: tuple[float, float, float] = (0.3, -0.5, 0.8)
    dt: float = 0.05
    duration: float = 10.0

    @property
    def title(self) -> str:
        return f"free rigid body, {self.name}"

    @cached_property
    def system(self) -> co.System:
        return catalogue["free_rigid_body"].make(inertia=self.inertia)

    @cached_property
    def start(self) -> co.State:
        omega = self.m0 / self.J
        return catalogue["free_rigid_body"].start(self.system, rotation=self.R0, angular_velocity=omega)

    @property
    def J(self) -> np.ndarray:
        return np.array(self.inertia)

    @property
    def m0(self) -> np.ndarray:
        return np.array(self.momentum)

    @property
    def R0(self) -> np.ndarray:
        return co.attitude.from_rotation_vector(self.turned)

    @property
    def energy(self) -> float:
        return float(0.5 * np.sum(self.m0**2 / self.J))

    def _axes(self) -> tuple[int, int, int]:
        """(a, b, c): c the axis that m circles, b the middle one; with two equal moments, c is the third axis."""
        low, middle, high = (int(i) for i in np.argsort(self.J, kind="stable"))
        if self.J[low] == self.J[middle]:
            return low, middle, high
        if self.J[middle] == self.J[high]:
            return high, middle, low
        circles_high = self.m0 @ self.m0 > 2 * self.energy * self.J[middle]
        return (low, middle, high) if circles_high else (high, middle, low)

    def exact(self, t: np.ndarray) -> Mapping[str, np.ndarray]:
        m, psi = self.momentum_and_precession(np.asarray(t))
        G = np.linalg.norm(self.m0)
        c = self._axes()[2]
        node = np.cross(m, np.eye(3)[c])
        node /= np.linalg.norm(node, axis=1, keepdims=True)
        frame = np.stack([node, np.cross(m / G, node), m / G], axis=-1)
        spatial = self.R0 @ frame[0] @ turn_about(2, psi - psi[0])
        return {"g": spatial @ np.swapaxes(frame, -1, -2), "mu": m}

    def momentum_and_precession(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """m(t) (T, 3) and ψ(t) (T,); t[0] = 0."""
        a, b, c = self._axes()
        J, G2, E = self.J, float(self.m0 @ self.m0), self.energy
        A = np.sqrt(max(J[a] * (2 * E * J[c] - G2) / (J[c] - J[a]), 0.0))
        B = np.sqrt(max(J[b] * (2 * E * J[c] - G2) / (J[c] - J[b]), 0.0))
        C = np.copysign(np.sqrt(J[c] * (G2 - 2 * E * J[a]) / (J[c] - J[a])), self.m0[c])
        rate = np.sqrt((G2 - 2 * E * J[a]) * (J[c] - J[b]) / (J[a] * J[b] * J[c]))
        modulus = (2 * E * J[c] - G2) * (J[a] - J[b]) / ((G2 - 2 * E * J[a]) * (J[b] - J[c]))
        parity = 1.0 if (b - a) % 3 == 1 else -1.0
        # ṁ_b = ±m_c m_a (1/J_a − 1/J_c), the sign that of the permutation (a, b, c), fixes the sign of B.
        B = np.copysign(B, parity * C * (1 / J[a] - 1 / J[c]))
        phase = np.arctan2(self.m0[b] / B, self.m0[a] / A)
        if modulus > 1 - _SEPARATRIX:
            u = rate * t + np.arctanh(self.m0[b] / B)
            sn, cn, dn = np.tanh(u), np.copysign(1 / np.cosh(u), self.m0[a]), 1 / np.cosh(u)
            swept = _integral_on_separatrix(u, G2, C)
        else:
            u = rate * t + ellipkinc(phase, modulus)
            sn, cn, dn, amplitude = ellipj(u, modulus)
            rest = G2 - C**2
            swept = _third_kind(amplitude, -(C**2) * modulus / rest, modulus) / rest
        m = np.empty((len(t), 3))
        m[:, a], m[:, b], m[:, c] = A * cn, B * sn, C * dn
        # ∫ dt/(G² − m_c²) = swept/λ
        G = np.sqrt(G2)
        psi = G * t / J[c] + G * (2 * E - G2 / J[c]) * swept / rate
        return m, psi


@dataclass(frozen=True)
class Separatrix(FreeRigidBody):
    """G² = 2EJ_b: m runs from one end of the unstable middle axis to the other, once.

    Errors grow there like those of the unstable rotation, so the run is short.
    """

    duration: float = 4.0


@dataclass(frozen=True)
class PermanentRotation(FreeRigidBody):
    """m along a principal axis b: R(t) = R(0) exp(t m_b/J_b e_b), m constant."""

    duration: float = 4.0

    def exact(self, t: np.ndarray) -> Mapping[str, np.ndarray]:
        axis = int(np.argmax(np.abs(self.m0)))
        angle = self.m0[axis] / self.J[axis] * np.asarray(t)
        return {"g": self.R0 @ turn_about(axis, angle), "mu": np.tile(self.m0, (len(t), 1))}


@dataclass(frozen=True)
class SymmetricBody(FreeRigidBody):
    """J = (I₁, I₁, I₃): m turns about e₃ by −Ωt, Ω = m₃(I₁ − I₃)/(I₁I₃) clockwise, and R = exp(t L/I₁) R₀ exp(Ωt e₃).

    Elementary functions only, so that it checks the elliptic ones too.
    """

    def exact(self, t: np.ndarray) -> Mapping[str, np.ndarray]:
        t = np.asarray(t)
        rate = self.m0[2] * (self.J[0] - self.J[2]) / (self.J[0] * self.J[2])
        m = np.einsum("tij,j->ti", turn_about(2, -rate * t), self.m0)
        L = self.R0 @ self.m0
        precession = np.stack([co.attitude.from_rotation_vector(s * L / self.J[0]) for s in t])
        return {"g": precession @ self.R0 @ turn_about(2, rate * t), "mu": m}


def _third_kind(phi: np.ndarray, n: float, m: float) -> np.ndarray:
    """Legendre's Π(n; φ | m) = ∫₀^φ dθ/((1 − n sin²θ)√(1 − m sin²θ)) by Carlson's integrals, for every φ."""
    turns = np.round(phi / np.pi)
    s, c = np.sin(phi - np.pi * turns), np.cos(phi - np.pi * turns)

    def within(s, c):
        x, y = c * c, 1 - m * s * s
        return s * elliprf(x, y, 1.0) + n / 3 * s**3 * elliprj(x, y, 1.0, 1 - n * s * s)

    return 2 * turns * within(1.0, 0.0) + within(s, c)


def _integral_on_separatrix(u: np.ndarray, G2: float, C: float) -> np.ndarray:
    """∫ du/(G² − C² sech²u) = (u + (C/√(G² − C²)) atan(C tanh u/√(G² − C²)))/G²."""
    rest = np.sqrt(G2 - C * C)
    return (u + C / rest * np.arctan(C * np.tanh(u) / rest)) / G2


def on_separatrix(inertia: tuple[float, float, float], along: float, side: float, other: float):
    """m on the separatrix 2EJ₂ = G² of J₁ < J₂ < J₃: m₂ given, (m₁, m₃) with the ratio that the separatrix has.

    m₁²(1/J₁ − 1/J₂) = m₃²(1/J₂ − 1/J₃); `side` = m₃, `other` the sign of m₁.
    """
    J1, J2, J3 = inertia
    return float(np.copysign(abs(side) * np.sqrt((1 / J2 - 1 / J3) / (1 / J1 - 1 / J2)), other)), along, side


_TRIAXIAL = (1.0, 2.0, 3.0)
FREE_RIGID_BODIES = [
    FreeRigidBody("circling the axis of largest inertia", _TRIAXIAL, (0.4, 0.7, 2.0)),
    FreeRigidBody("circling the axis of smallest inertia", _TRIAXIAL, (1.5, -0.8, -0.5)),
    FreeRigidBody("axes in another order, near the separatrix", (2.0, 3.0, 1.0), (-1.0, 0.6, 0.65)),
    SymmetricBody("oblate, in elementary functions", (3.0, 3.0, 9.0), (0.0, 5.0, 7.0)),
    FreeRigidBody("oblate, in elliptic functions", (3.0, 3.0, 9.0), (0.0, 5.0, 7.0)),
    FreeRigidBody("prolate", (4.0, 4.0, 1.0), (2.0, -1.0, 1.5)),
    Separatrix("separatrix, m₁ and m₃ of one sign", _TRIAXIAL, on_separatrix(_TRIAXIAL, -1.0, 1.2, 1.0)),
    Separatrix("separatrix, m₁ and m₃ of opposite signs", _TRIAXIAL, on_separatrix(_TRIAXIAL, 0.5, 1.2, -1.0)),
    PermanentRotation("separatrix, unstable permanent rotation", _TRIAXIAL, (0.0, 2.0, 0.0)),
]
