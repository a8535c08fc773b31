"""Underwater vehicles in closed form: sinking on an even keel, and swinging in pitch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from problem import Problem, turn_about
from scipy.special import ellipj, ellipk

import coadjoint as co
from coadjoint.models import catalogue


@dataclass(frozen=True)
class VerticalSink(Problem):
    """On an even keel, turning about the vertical at Ω: q̈ = W/(m + A₃₃) down, W = mg − B, R = R_z(Ωt) with z down.

    E = ½ J₃Ω² + ½ (m + A₃₃) v₀² − W d₀ + B r_z, with d₀ the first depth. `down` = −1 is the same with z up.
    """

    name: str
    spin: float = 0.0
    velocity: float = 0.0
    depth: float = 2.0
    down: float = 1.0
    mass: float = 130.0
    dt: float = 0.1
    duration: float = 10.0

    @property
    def title(self) -> str:
        return f"vertical sink, {self.name}"

    @cached_property
    def system(self) -> co.System:
        return catalogue["underwater_vehicle"].make(mass=self.mass)

    @cached_property
    def start(self) -> co.State:
        return catalogue["underwater_vehicle"].start(
            self.system,
            position=(0.5, -0.3, self.down * self.depth),
            velocity=(0.0, 0.0, self.down * self.velocity),
            rotation=np.diag([1.0, self.down, self.down]),
            angular_velocity=(0.0, 0.0, self.spin),
            down=(0.0, 0.0, self.down),
        )

    @property
    def net_weight(self) -> float:
        return self.mass * 9.81 - 1215.8

    @property
    def energy(self) -> float:
        kinetic = 0.5 * 5.72 * self.spin**2 + 0.5 * (self.mass + 75.0) * self.velocity**2
        return kinetic - self.net_weight * self.depth - 1215.8 * 0.007

    def exact(self, t: np.ndarray) -> Mapping[str, np.ndarray]:
        t = np.asarray(t)
        acceleration = self.net_weight / (self.mass + 75.0)
        depth = self.depth + self.velocity * t + 0.5 * acceleration * t**2
        q = np.stack([np.full_like(t, 0.5), np.full_like(t, -0.3), self.down * depth], axis=1)
        nothing = np.zeros_like(t)
        return {
            "q": q,
            "g": np.diag([1.0, self.down, self.down]) @ turn_about(2, self.spin * t),
            "pi": np.stack([nothing, nothing, (self.mass + 75.0) * (self.velocity + acceleration * t)], axis=1),
            "mu": np.tile([0.0, 0.0, 5.72 * self.spin], (len(t), 1)),
        }


@dataclass(frozen=True)
class PitchPendulum(Problem):
    """Neutrally buoyant, let go at rest at pitch θ₀: J₂θ̈ = −Bl sin θ, the centre of buoyancy l above the mass centre.

    sin(θ/2) = k sn(K + ω₀t), θ̇ = 2kω₀ cn(K + ω₀t), k = sin(θ₀/2), ω₀² = Bl/J₂; period 4K/ω₀, and 2π/ω₀ for small θ₀.
    E = −Bl cos θ₀. `yaw` turns the plane of the swing.
    """

    name: str
    amplitude: float
    lever: float = 0.02
    yaw: float = 0.7
    dt: float = 0.05
    duration: float = 12.0

    @property
    def title(self) -> str:
        return f"pitch pendulum, {self.name}"

    @cached_property
    def system(self) -> co.System:
        return catalogue["underwater_vehicle"].make(buoyancy=None, center_of_buoyancy=(0.0, 0.0, -self.lever))

    @cached_property
    def start(self) -> co.State:
        return catalogue["underwater_vehicle"].start(
            self.system,
            position=(0.1, 0.2, 0.3),
            velocity=(0.0, 0.0, 0.0),
            euler_zyx=(self.yaw, self.amplitude, 0.0),
            angular_velocity=(0.0, 0.0, 0.0),
        )

    @property
    def righting(self) -> float:
        return 123.8 * 9.81 * self.lever

    @property
    def frequency(self) -> float:
        """ω₀ of small oscillations, rad/s."""
        return float(np.sqrt(self.righting / 5.29))

    @property
    def period(self) -> float:
        return float(4 * ellipk(np.sin(self.amplitude / 2) ** 2) / self.frequency)

    @property
    def energy(self) -> float:
        return -self.righting * float(np.cos(self.amplitude))

    def pitch(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """θ and θ̇."""
        k = np.sin(self.amplitude / 2)
        sn, cn, _, _ = ellipj(ellipk(k * k) + self.frequency * t, k * k)
        return 2 * np.arcsin(k * sn), 2 * k * self.frequency * cn

    def exact(self, t: np.ndarray) -> Mapping[str, np.ndarray]:
        t = np.asarray(t)
        theta, rate = self.pitch(t)
        nothing = np.zeros_like(t)
        return {
            "g": turn_about(2, np.full_like(t, self.yaw)) @ turn_about(1, theta),
            "mu": np.stack([nothing, 5.29 * rate, nothing], axis=1),
            "q": np.tile([0.1, 0.2, 0.3], (len(t), 1)),
        }


VEHICLES = [
    VerticalSink("from rest"),
    VerticalSink("from rest, z up", down=-1.0),
    VerticalSink("turning, thrown upwards", spin=0.8, velocity=-1.5),
    VerticalSink("rising, turning", mass=118.0, spin=-0.5),
    PitchPendulum("small", amplitude=0.02),
    PitchPendulum("large", amplitude=2.4),
]
