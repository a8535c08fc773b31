"""The density of water over depth, with the head of pressure that buoyancy has as its potential."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError
from coadjoint.extending import traced
from coadjoint.models.quantities import number, positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.numbers import Numbers
from coadjoint_vehicles.water.columns import DOWN, read

DEEPEST = 11000.0
"""m; down to there a density must be positive."""


@dataclass(frozen=True, eq=False)
class Density(Numbers, ABC):
    """ρ(depth), kg/m³, constant above the surface, and its integral from the surface."""

    @abstractmethod
    def density(self, depth: Array, own: Named) -> Array:
        """ρ, kg/m³."""

    @abstractmethod
    def pressure_head(self, depth: Array, own: Named) -> Array:
        """∫₀^depth ρ dz, kg/m²."""


@dataclass(frozen=True, eq=False)
class LinearDensity(Density):
    """ρ = surface + gradient·depth. surface: kg/m³. gradient: kg/m⁴. ρ must be positive down to 11 000 m."""

    surface: Any
    gradient: Any = 0.0

    def __post_init__(self) -> None:
        surface, gradient = positive(self.surface, "surface"), number(self.gradient, "gradient")
        if not traced(surface, gradient) and surface + gradient * DEEPEST <= 0:
            raise ArgumentError(
                f"Argument `gradient` must leave the density positive down to {DEEPEST:g} m, but {gradient:g} kg/m⁴ "
                f"makes it 0 at {-surface / gradient:g} m."
            )
        object.__setattr__(self, "surface", surface)
        object.__setattr__(self, "gradient", gradient)

    def density(self, depth: Array, own: Named) -> Array:
        return own.surface + own.gradient * jnp.maximum(depth, 0.0)

    def pressure_head(self, depth: Array, own: Named) -> Array:
        return own.surface * depth + 0.5 * own.gradient * jnp.maximum(depth, 0.0) ** 2


@dataclass(frozen=True, eq=False)
class ExponentialDensity(Density):
    """ρ = deep + (surface − deep)·exp(−depth/scale). surface, deep: kg/m³. scale: m; all positive."""

    surface: Any
    deep: Any
    scale: Any

    def __post_init__(self) -> None:
        for name in ("surface", "deep", "scale"):
            object.__setattr__(self, name, positive(getattr(self, name), name))

    def density(self, depth: Array, own: Named) -> Array:
        below = jnp.maximum(depth, 0.0)
        return own.deep + (own.surface - own.deep) * jnp.exp(-below / own.scale)

    def pressure_head(self, depth: Array, own: Named) -> Array:
        below = jnp.maximum(depth, 0.0)
        bent = (own.surface - own.deep) * (-own.scale * jnp.expm1(-below / own.scale) - below)
        return own.surface * depth + bent


@dataclass(frozen=True, eq=False)
class DensityTable(Density):
    """A density linear between depths: ρ = ρ₁ + Σ Δs_i max(depth − z_i, 0) with the changes Δs_i of slope at z_i.

    depths: (k,) m, growing, from 0 on. densities: (k,) kg/m³, positive. Outside of the table ρ is held at its ends.
    Raises ArgumentError for other values.
    """

    depths: Any
    densities: Any

    def __post_init__(self) -> None:
        depths = float64(self.depths, "Argument `depths`")
        densities = float64(self.densities, "Argument `densities`")
        if np.ndim(depths) != 1 or np.size(depths) == 0 or np.shape(depths) != np.shape(densities):
            raise ArgumentError(
                "Arguments `depths` and `densities` must have the same shape (k,), but have "
                f"{np.shape(depths)} and {np.shape(densities)}."
            )
        if not traced(depths, densities):
            if np.any(depths < 0):
                raise ArgumentError(f"Argument `depths` must be 0 m or more, but has {np.min(depths):g} m: {DOWN}.")
            checks.increasing(depths, "depths")
            if np.any(densities <= 0):
                raise ArgumentError(f"Argument `densities` must be positive, but has {np.min(densities):g} kg/m³.")
        object.__setattr__(self, "depths", depths)
        object.__setattr__(self, "densities", densities)

    @classmethod
    def from_csv(cls, path: str | os.PathLike[str]) -> DensityTable:
        """The table of a CSV file with the columns depth (m) and density (kg/m³); raises as `CurrentTable.from_csv`."""
        table = read(path, ("depth", "density"))
        depth, density = table.values["depth"], table.values["density"]
        if len(low := np.flatnonzero(density <= 0)):
            raise table.refuse(int(low[0]), "density", f"{density[low[0]]:g} kg/m³ is not positive.")
        table.require_growth(["depth"])
        return cls(depth, density)

    @staticmethod
    def _bends(own: Named) -> Array:
        slopes = jnp.diff(own.densities) / jnp.diff(own.depths)
        ends = jnp.zeros(1)
        return jnp.diff(jnp.concatenate([ends, slopes, ends]))

    def density(self, depth: Array, own: Named) -> Array:
        return own.densities[0] + self._bends(own) @ jnp.maximum(depth - own.depths, 0.0)

    def pressure_head(self, depth: Array, own: Named) -> Array:
        return own.densities[0] * depth + 0.5 * self._bends(own) @ jnp.maximum(depth - own.depths, 0.0) ** 2
