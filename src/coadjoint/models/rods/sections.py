"""The sections of a rod: stiffness, inertia, the elements that join them, and the length that each carries."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import jax.numpy as jnp

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.groups import SE2, SE3, Power
from coadjoint.mechanics.members import Quantity
from coadjoint.models.quantities import positive
from coadjoint.spaces.relative_poses import GROUND

SHEAR = 0.9
"""The share of a round section that carries shear."""


def round_section(*, radius: Quantity, density: Quantity, young: Quantity, shear: Quantity) -> dict[str, object]:
    """EA, GA, GJ, EI, mass and inertia of a full round section, as `cosserat` takes them.

    A = πr², I = πr⁴/4, J = 2I; of A, 0.9 carries shear.

    radius: r, m. density: ρ, kg/m³. young, shear: the moduli E and G, N/m². Raises ArgumentError unless all are
    positive. Source: Cowper, The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33 (1966).
    """
    given = {"radius": radius, "density": density, "young": young, "shear": shear}
    r, rho, E, G = (float(positive(value, name)) for name, value in given.items())
    area, second = pi * r**2, pi * r**4 / 4
    return {
        "EA": E * area,
        "GA": SHEAR * G * area,
        "GJ": 2 * G * second,
        "EI": E * second,
        "mass": rho * area,
        "inertia": (2 * rho * second, rho * second, rho * second),
    }


ENDS = ("free", "clamped", "both clamped", "ring")
"""Both ends free; the first one clamped; both clamped; or the last joined to the first."""


@dataclass(frozen=True)
class RodLayout:
    """M elements between sections; clamped sections are not unknowns.

    elements: M. ends: one of `ENDS`. planar: whether sections move on SE(2).
    """

    elements: int
    ends: str
    planar: bool = False

    def __post_init__(self):
        checks.choice(self.ends, "ends", ENDS)
        least = {"free": 1, "clamped": 1, "both clamped": 2, "ring": 3}[self.ends]
        what = f"Argument `elements` of a rod with ends {self.ends!r}"
        object.__setattr__(self, "elements", checks.whole(self.elements, what, least))

    @property
    def sections(self) -> int:
        """N, how many sections move."""
        return self.elements + {"free": 1, "clamped": 0, "both clamped": -1, "ring": 0}[self.ends]

    @property
    def group(self) -> Power:
        """SE(3)ᴺ, or SE(2)ᴺ in the plane."""
        return Power(SE2() if self.planar else SE3(), self.sections, "ring" if self.ends == "ring" else "chain")

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """The sections that each element joins, in the order along the rod, −1 for one that is clamped."""
        N = self.sections
        inner = tuple((i, i + 1) for i in range(N - 1))
        if self.ends == "ring":
            return (*inner, (N - 1, 0))
        first = ((GROUND, 0),) if self.ends != "free" else ()
        return (*first, *inner, *(((N - 1, GROUND),) if self.ends == "both clamped" else ()))

    def shares(self, lengths: Array) -> Array:
        """The length that each section represents, half of the adjacent elements, (N,), from those of the elements
        (M,)."""
        half = 0.5 * lengths
        if self.ends == "ring":
            return half + jnp.roll(half, 1)
        nothing = jnp.zeros(1)
        all_shares = jnp.concatenate([half, nothing]) + jnp.concatenate([nothing, half])
        return all_shares[int(self.ends != "free") : len(all_shares) - int(self.ends == "both clamped")]
