"""The stiffness and the inertia of cross-sections."""

from __future__ import annotations

from math import pi
from typing import Any

from coadjoint.models.quantities import positive

SHEAR = 0.9
"""The share of a round section that carries shear."""


def round_section(*, radius: Any, density: Any, young: Any, shear: Any) -> dict[str, Any]:
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
