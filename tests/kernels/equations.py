"""Linear and curved equations as a program without motion: what Newton solves."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp

from coadjoint.kernels.newton.solver import DenseStage


@dataclass(frozen=True)
class Equations(DenseStage):
    """Unknowns with A z + ε sin z = s, as a program without motion."""

    curved: float
    fraction: float = 1.0
    tolerant: bool = False
    blocks: tuple[int, ...] = ()

    def guess(self, p, s, h):
        return 0.0 * s

    def residual(self, p, s, h, z):
        return p @ z + self.curved * jnp.sin(z) - s

    def chart(self, p, s, h, z):
        return 0.0

    def record(self, p, s, h, z):
        return z

    def advance(self, p, s, h, z, sound=1.0):
        return s

    def certificate(self, p, before, h, z, after):
        return {}


@dataclass(frozen=True)
class Still:
    stages: tuple[Equations, ...]
    substeps: tuple[float, ...] = (1.0,)
    stops: bool = False

    def prepare(self, p, s, h):
        return s

    def monitors(self, p, record, h):
        return {}

    def linked(self, state):
        return None
