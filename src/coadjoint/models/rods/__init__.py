"""Rods that bend, twist, shear and stretch, and chains of rigid bodies."""

from coadjoint.models.rods.cosserat import cosserat, planar
from coadjoint.models.rods.pendulums import pendulums, pendulums_start, points, points_start
from coadjoint.models.rods.sections import round_section
from coadjoint.models.rods.shapes import centerline, planar_start, start
from coadjoint.models.rods.statics import equilibrium, modes

__all__ = [
    "centerline",
    "cosserat",
    "equilibrium",
    "modes",
    "pendulums",
    "pendulums_start",
    "planar",
    "planar_start",
    "points",
    "points_start",
    "round_section",
    "start",
]
