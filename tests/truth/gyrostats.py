"""A gyrostat in closed form: a symmetric body with a free rotor on its axis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import jax
import numpy as np
from problem import Problem, turn_about

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import catalogue


@dataclass(frozen=True)
class Gyrostat(Problem):
    """I = (I₁, I₁, I₃) with a rotor on the axis: R = R₀ exp(tμ₀/I₁) exp(t(ω₃ − μ₃/I₁)e₃), π and ω₃ constant."""

    dt: float = 0.02
    duration: float = 5.0

    @property
    def title(self) -> str:
        return "symmetric gyrostat"

    @cached_property
    def system(self) -> co.System:
        return catalogue["rigid_body_with_rotor"].make(inertia=(2.0, 2.0, 3.0), rotor_inertia=0.4, axis=(0, 0, 1))

    @cached_property
    def start(self) -> co.State:
        entry = catalogue["rigid_body_with_rotor"]
        return entry.start(self.system, euler_zyx=(0.3, 0.2, 0.1), angular_velocity=(0.7, -0.2, 0.5), rotor_rate=3.0)

    @property
    def energy(self) -> float:
        return float(0.5 * (2.0 * (0.7**2 + 0.2**2) + 3.0 * 0.5**2) + 0.5 * 0.4 * 3.5**2)

    def exact(self, t: np.ndarray) -> Mapping[str, np.ndarray]:
        s = self.start
        own = s.xi[2] - s.mu[2] / 2.0
        turned = evaluate(jax.vmap(lambda t: self.system.group.exp(t * s.mu / 2.0)), np.asarray(t))
        spun = turn_about(2, own * np.asarray(t))
        return {
            "g": s.g @ turned @ spun,
            "mu": np.einsum("tji,j->ti", spun, s.mu),
            "pi": np.broadcast_to(s.pi, (len(t), 1)),
        }


GYROSTATS = [Gyrostat()]
