"""The entries of the systems that are given by ℋ in the catalogue; their makers are loaded when first used."""

from __future__ import annotations

from coadjoint.models.entry import CatalogueEntry

HAMILTONIAN = (
    CatalogueEntry(
        "point_vortices",
        "Point vortices in the plane: three of different circulations.",
        "coadjoint.models.point_vortices:plane",
        "coadjoint.models.point_vortices:plane_start",
        {"circulations": (1.0, 0.8, -0.5)},
        {"positions": ((1.0, 0.0), (-0.5, 0.9), (-0.4, -0.8))},
        dt=0.05,
        duration=50.0,
        method="HamiltonianMidpoint",
    ),
    CatalogueEntry(
        "sphere_vortices",
        "Point vortices on a sphere: four of different circulations.",
        "coadjoint.models.point_vortices:sphere",
        "coadjoint.models.point_vortices:sphere_start",
        {"circulations": (1.0, 0.8, -0.5, 0.6), "radius": 1.0},
        {"positions": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (-0.6, 0.0, -0.8))},
        dt=0.05,
        duration=50.0,
        method="HamiltonianMidpoint",
    ),
    CatalogueEntry(
        "toda_lattice",
        "Toda's lattice of three particles that repel their neighbours: a matrix whose eigenvalues stay.",
        "coadjoint.models.toda:lattice",
        "coadjoint.models.toda:start",
        {"particles": 3},
        {"positions": (0.0, 0.5, 1.5), "momenta": (1.0, 0.2, -0.8)},
        dt=0.01,
        duration=5.0,
    ),
)
"""Their integrals are watched, too."""
