"""The underwater vehicle on SO(3) by the left rectangle rule and the Cayley map, written for the kernels alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.kernels.newton.solver import DenseStage
from coadjoint.kernels.trace.evaluate import evaluate


class Vehicle(NamedTuple):
    """Mass matrix M (3, 3), inertia J (3, 3), net weight mg − B, buoyancy B, centre of buoyancy r (3,)."""

    mass: np.ndarray
    inertia: np.ndarray
    net_weight: np.ndarray
    buoyancy: np.ndarray
    center: np.ndarray


class State(NamedTuple):
    t: np.ndarray
    g: np.ndarray
    n: np.ndarray
    a: np.ndarray
    mu: np.ndarray
    pi: np.ndarray
    xi: np.ndarray
    nu: np.ndarray


PAPER = Vehicle(
    mass=123.8 * np.eye(3) + np.diag([65.0, 70.0, 75.0]),
    inertia=np.diag([5.46, 5.29, 5.72]),
    net_weight=np.asarray(123.8 * 9.81 - 1215.8),
    buoyancy=np.asarray(1215.8),
    center=np.array([0.0, 0.0, -0.007]),
)


def lagrangian(xi, n, nu, a, p: Vehicle):
    kinetic = 0.5 * nu @ p.mass @ nu + 0.5 * xi @ p.inertia @ xi
    return kinetic + p.net_weight * n @ a - p.buoyancy * p.center @ a


def gradients(p, s: State, xi, nu):
    """∂_ξℓ, ∂_νℓ, D/h and κ/h at the node."""
    along_xi, along_n, along_nu, along_a = jax.grad(lagrangian, argnums=(0, 1, 2, 3))(xi, s.n, nu, s.a, p)
    torque = jnp.cross(along_a, s.a) + jnp.cross(along_n, s.n) + jnp.cross(along_nu, nu)
    return along_xi, along_nu, torque, along_n


def dual_tangent(x, mu):
    """(dτ⁻¹_x)* μ of the Cayley map."""
    return mu + 0.5 * jnp.cross(x, mu) + 0.25 * x * (x @ mu)


def cayley(x):
    hat = jnp.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])
    return jnp.eye(3) + (hat + 0.5 * hat @ hat) / (1.0 + 0.25 * x @ x)


@dataclass(frozen=True)
class LeftRectangle(DenseStage):
    """The stage; `limit` bounds h|ξ| as a chart would."""

    fraction: float = 1.0
    tolerant: bool = False
    blocks: tuple[int, ...] = (3, 3)
    limit: float = 4.0

    def guess(self, p, s, h):
        return jnp.concatenate([s.xi, s.nu])

    def residual(self, p, s, h, z):
        xi, nu = z[:3], z[3:]
        mu, pi, torque, force = gradients(p, s, xi, nu)
        return jnp.concatenate([s.mu + h * torque - dual_tangent(h * xi, mu), s.pi + h * force - pi])

    def chart(self, p, s, h, z):
        return h * h * (z[:3] @ z[:3]) / self.limit**2

    def record(self, p, s, h, z):
        return s._replace(xi=z[:3], nu=z[3:])

    def advance(self, p, s, h, z, sound=1.0):
        xi, nu = z[:3], z[3:]
        _, _, torque, force = gradients(p, s, xi, nu)
        F = cayley(h * xi)
        return State(
            t=s.t + h,
            g=s.g @ F,
            n=F.T @ (s.n + h * nu),
            a=F.T @ s.a,
            mu=F.T @ (s.mu + h * torque),
            pi=F.T @ (s.pi + h * force),
            xi=xi,
            nu=nu,
        )

    def certificate(self, p, before, h, z, after):
        before_sum = before.a @ (before.mu - jnp.cross(before.pi, before.n))
        after_sum = after.a @ (after.mu - jnp.cross(after.pi, after.n))
        return {
            "newton_residual": jnp.max(jnp.abs(self.residual(p, before, h, z))),
            "balance_residual": jnp.abs(after_sum - before_sum),
        }


@dataclass(frozen=True)
class VehicleProgram:
    stages: tuple[LeftRectangle, ...] = (LeftRectangle(),)
    substeps: tuple[float, ...] = (1.0,)
    stops: bool = False

    def linked(self, s):
        return None

    def prepare(self, p, s, h):
        return s

    def monitors(self, p, s, h):
        _, _, _, _ = gradients(p, s, s.xi, s.nu)
        energy = 2.0 * (0.5 * s.nu @ p.mass @ s.nu + 0.5 * s.xi @ p.inertia @ s.xi)
        energy = energy - lagrangian(s.xi, s.n, s.nu, s.a, p)
        return {
            "energy": energy,
            "kelvin_noether": s.a @ (s.mu - jnp.cross(s.pi, s.n)),
            "spatial_momentum": s.g @ s.pi,
        }


def start(h: float, xi=None, p: Vehicle = PAPER) -> State:
    """The paper's velocity start; `xi` replaces the body angular velocity."""
    xi = np.deg2rad([10.0, 0.0, 20.0]) if xi is None else np.asarray(xi, float)
    a, q = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0])
    s = State(np.asarray(0.0), np.eye(3), q, a, np.zeros(3), np.zeros(3), xi, np.array([0.1, 0.1, 0.8]))

    def momenta(p, s, h):
        mu, pi, torque, force = gradients(p, s, s.xi, s.nu)
        return s._replace(mu=dual_tangent(h * s.xi, mu) - h * torque, pi=pi - h * force)

    return evaluate(momenta, p, s, h)
