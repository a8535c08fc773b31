"""Currents that change with depth: linear, by a power law, logarithmic."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.extending import traced
from coadjoint.models.quantities import positive, vector
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.numbers import Numbers
from coadjoint_vehicles.water.water import UniformWater, Water

VISCOUS = 0.01
"""The part of the depth above the bottom in which a power law, whose slope has no bound there, goes linearly to 0."""


@dataclass(frozen=True, eq=False)
class LinearShear(Water):
    """c = surface + gradient·depth, everywhere, above the surface, too: a flow of constant vorticity.

    surface: (3,) m/s. gradient: ∂c/∂depth, (3,) 1/s, of which the third part must be 0, because water keeps its volume.
    """

    surface: Any
    gradient: Any

    uniform = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "surface", vector(self.surface, "surface"))
        gradient = vector(self.gradient, "gradient")
        if not traced(gradient) and gradient[2] != 0:
            raise ArgumentError(
                f"The third part of `gradient` must be 0: water keeps its volume; it is {gradient[2]:g}."
            )
        object.__setattr__(self, "gradient", gradient)

    def current(self, position: Array, t: Scalar, internal: PyTree, own: PyTree) -> Array:
        return own.surface + own.gradient * position[2]


@dataclass(frozen=True, eq=False)
class Profile(Numbers, ABC):
    """The current at a depth as a part of that at the surface: 1 there and above, 0 below the bottom."""

    @abstractmethod
    def part(self, depth: Array, own: Named) -> Array:
        """c(depth)/c(0)."""


@dataclass(frozen=True, eq=False)
class LinearProfile(Profile):
    """1 − depth/reach down to `reach` (m), 0 below: a current that the wind drives. DNV-RP-C205, with reach 50 m."""

    reach: Any = 50.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "reach", positive(self.reach, "reach"))

    def part(self, depth: Array, own: Named) -> Array:
        return jnp.clip(1 - depth / own.reach, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class PowerLaw(Profile):
    """(1 − depth/bottom)^exponent: a tidal current over a bottom at the depth `bottom` (m). DNV-RP-C205: 1/7.

    In the lowest hundredth it goes linearly to 0.
    """

    bottom: Any
    exponent: Any = 1 / 7

    def __post_init__(self) -> None:
        object.__setattr__(self, "bottom", positive(self.bottom, "bottom"))
        object.__setattr__(self, "exponent", positive(self.exponent, "exponent"))

    def part(self, depth: Array, own: Named) -> Array:
        height = jnp.clip(1 - depth / own.bottom, 0.0, 1.0)
        above = jnp.maximum(height, VISCOUS)
        return jnp.where(height > VISCOUS, above**own.exponent, VISCOUS**own.exponent * height / VISCOUS)


@dataclass(frozen=True, eq=False)
class Logarithmic(Profile):
    """ln(1 + z/z₀)/ln(1 + bottom/z₀), z the height above the bottom: the law of the wall, u = (u*/κ) ln(1 + z/z₀).

    bottom: its depth, m. roughness: z₀, m, as 0.0002 for mud and 0.006 for rippled sand (Soulsby 1997).
    """

    bottom: Any
    roughness: Any

    def __post_init__(self) -> None:
        object.__setattr__(self, "bottom", positive(self.bottom, "bottom"))
        object.__setattr__(self, "roughness", positive(self.roughness, "roughness"))

    def part(self, depth: Array, own: Named) -> Array:
        height = jnp.clip(own.bottom - depth, 0.0, own.bottom)
        return jnp.log1p(height / own.roughness) / jnp.log1p(own.bottom / own.roughness)


class Sheared(Water):
    """A current that changes with depth: c = c_surface(t)·profile(depth).

    surface: (3,) m/s, or a current that is the same everywhere, such as a TidalCurrent. profile: a Profile, such as
    PowerLaw(bottom=40.0). Raises ArgumentError for anything else.
    """

    uniform = False

    def __init__(self, surface: object, profile: Profile):
        surface = surface if isinstance(surface, Water) else UniformWater(vector(surface, "surface"))
        checks.expect(surface.uniform, surface, "surface", "a current that is the same everywhere")
        if surface.stratified:
            raise ArgumentError(
                "Argument `surface` has a density, but a profile of currents has none: give both to a Sea."
            )
        checks.instance(profile, "profile", Profile, "a Profile such as PowerLaw(40.0)")
        object.__setattr__(self, "surface", surface)
        object.__setattr__(self, "profile", profile)

    surface: Water
    profile: Profile

    @property
    def steady(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.surface.steady

    @property
    def timed(self) -> bool:
        return self.surface.timed

    def parameters(self) -> dict[str, PyTree]:
        return {"surface": self.surface.parameters(), "profile": self.profile.parameters()}

    def start(self) -> dict[str, PyTree]:
        return self.surface.start()

    def advance(self, internal: Named, h: Scalar, own: Named) -> dict[str, PyTree]:
        return self.surface.advance(internal, h, own.surface)

    def current(self, position: Array, t: Scalar, internal: PyTree, own: PyTree) -> Array:
        above = self.surface.current(position, t, internal, own.surface)
        return above * self.profile.part(position[2], own.profile)

    def __repr__(self) -> str:
        return f"Sheared({self.surface!r}, {self.profile!r})"
