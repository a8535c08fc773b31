"""Ideal fluids on the sphere by Zeitlin's matrices."""

from coadjoint.models.fluids.euler import euler, random_vorticity, rossby_haurwitz, start, vorticity
from coadjoint.models.fluids.harmonics import coefficients_of, from_coefficients, on_grid, power

__all__ = [
    "coefficients_of",
    "euler",
    "from_coefficients",
    "on_grid",
    "power",
    "random_vorticity",
    "rossby_haurwitz",
    "start",
    "vorticity",
]
