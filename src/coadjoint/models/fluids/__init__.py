"""Ideal, magnetic and buoyant fluids on the sphere by Zeitlin's matrices."""

from coadjoint.models.fluids.carrying import boussinesq, carried, carrying_start, magnetohydrodynamics
from coadjoint.models.fluids.damping import DampedMidpoint
from coadjoint.models.fluids.euler import euler, start, vorticity
from coadjoint.models.fluids.fields import fields
from coadjoint.models.fluids.harmonics import coefficients_of, from_coefficients, on_grid, power_spectrum
from coadjoint.models.fluids.initial import random_vorticity, rossby_haurwitz, vortices

__all__ = [
    "DampedMidpoint",
    "boussinesq",
    "carried",
    "carrying_start",
    "coefficients_of",
    "euler",
    "fields",
    "from_coefficients",
    "magnetohydrodynamics",
    "on_grid",
    "power_spectrum",
    "random_vorticity",
    "rossby_haurwitz",
    "start",
    "vortices",
    "vorticity",
]
