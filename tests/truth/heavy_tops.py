"""Heavy tops in closed form: the steady precession of a symmetric top."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from problem import Problem, turn_about

import coadjoint as co
from coadjoint.models import catalogue


@dataclass(frozen=True)
class SteadyPrecession(Problem):
    """J = (I₁, I₁, I₃), tilt θ, precession Ω: R = R_z(Ωt) R_x(θ) R_z(σt), mgl = Ω(I₃ω₃ − I₁Ω cos θ), σ = ω₃ − Ω cos θ.

    E = ½ I₁Ω² sin²θ + ½ I₃ω₃² + mgl cos θ.
    """

    name: str
    precession: float
    tilt: float
    transverse: float = 5.0
    axial: float = 1.0
    mass: float = 2.0
    lever: float = 0.8
    dt: float = 0.005
    duration: float = 3.0

    @property
    def title(self) -> str:
        return f"steady precession, {self.name}"

    @property
    def moment(self) -> float:
        return self.mass * 9.81 * self.lever

    @property
    def axial_rate(self) -> float:
        """ω₃."""
        swing = self.transverse * self.precession * np.cos(self.tilt)
        return float((self.moment / self.precession + swing) / self.axial)

    @cached_property
    def system(self) -> co.System:
        # The same top stated about its mass centre: I_c = I₁ − ml².
        across = self.transverse - self.mass * self.lever**2
        return catalogue["heavy_top"].make(
            mass=self.mass,
            center_of_mass=(0.0, 0.0, self.lever),
            inertia=(across, across, self.axial),
            inertia_about="center_of_mass",
        )

    @cached_property
    def start(self) -> co.State:
        rates = (self.precession, 0.0, self.axial_rate - self.precession * np.cos(self.tilt))
        return catalogue["heavy_top"].start(self.system, euler_zxz=(0.0, self.tilt, 0.0), euler_rates=rates)

    @property
    def energy(self) -> float:
        across = 0.5 * self.transverse * (self.precession * np.sin(self.tilt)) ** 2
        return float(across + 0.5 * self.axial * self.axial_rate**2 + self.moment * np.cos(self.tilt))

    def exact(self, t: np.ndarray) -> Mapping[str, np.ndarray]:
        t = np.asarray(t)
        spin = (self.axial_rate - self.precession * np.cos(self.tilt)) * t
        tilted = turn_about(2, self.precession * t) @ turn_about(0, np.full_like(t, self.tilt))
        up = np.stack([np.sin(spin), np.cos(spin)], axis=1) * np.sin(self.tilt)
        across = self.transverse * self.precession * up
        axial = np.full((len(t), 1), self.axial * self.axial_rate)
        return {
            "g": tilted @ turn_about(2, spin),
            "mu": np.concatenate([across, axial], axis=1),
            "a": np.concatenate([up, np.full((len(t), 1), np.cos(self.tilt))], axis=1),
        }


HEAVY_TOPS = [
    SteadyPrecession("slow", precession=0.9, tilt=0.6),
    SteadyPrecession("fast, hanging", precession=-2.5, tilt=2.0),
]
