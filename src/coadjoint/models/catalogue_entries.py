"""Catalogue entries of integrable systems, systems given by ℋ, rods and chains of links.

Their makers are loaded when first used.
"""

from __future__ import annotations

from coadjoint.models.entry import TURNING, UP, CatalogueEntry

_PLACED = {"position": (0.0, 0.0, 0.0), "velocity": (0.0, 0.0, 0.0), **TURNING}

INTEGRABLE = (
    CatalogueEntry(
        "lagrange_top",
        "Lagrange's top, symmetric about the axis that holds its mass centre: axial momentum is conserved.",
        "coadjoint.models.integrable_tops:lagrange",
        "coadjoint.models.integrable_tops:start",
        {"mass": 1.0, "lever": 0.1, "transverse": 0.02, "axial": 0.01, "gravity": 9.81},
        {**UP, "euler_zxz": (0.0, 0.6, 0.0), "angular_velocity": (0.0, 0.0, 40.0)},
        dt=0.002,
        duration=20.0,
    ),
    CatalogueEntry(
        "kovalevskaya_top",
        "Kovalevskaya's top, J = diag(2C, 2C, C), mass centre in the equator: a fourth integral of degree 4.",
        "coadjoint.models.integrable_tops:kovalevskaya",
        "coadjoint.models.integrable_tops:start",
        {"mass": 1.0, "lever": 0.1, "axial": 0.1, "gravity": 10.0},
        {**UP, "euler_zxz": (0.0, 0.8, 0.3), "angular_velocity": (1.0, 0.5, 2.0)},
        dt=0.005,
        duration=100.0,
    ),
    CatalogueEntry(
        "goryachev_chaplygin_top",
        "The top of Goryachev and Chaplygin, J = diag(4C, 4C, C): integrable where the vertical momentum is zero.",
        "coadjoint.models.integrable_tops:goryachev_chaplygin",
        "coadjoint.models.integrable_tops:start",
        {"mass": 1.0, "lever": 0.1, "axial": 0.1, "gravity": 10.0},
        # a = e₂ and ω₂ = 0, so that μ·a = 0 exactly.
        {**UP, "angular_velocity": (1.0, 0.0, 2.5), "up": (0.0, 1.0, 0.0)},
        dt=0.005,
        duration=100.0,
    ),
    CatalogueEntry(
        "rigid_body_with_rotor",
        "A free rigid body turning about its middle axis, which a fast rotor on that axis makes stable.",
        "coadjoint.models.rotor:make",
        "coadjoint.models.rotor:start",
        {"inertia": (1.0, 2.0, 3.0), "rotor_inertia": 0.1, "axis": (0.0, 1.0, 0.0)},
        {**TURNING, "angular_velocity": (0.01, 1.0, 0.01), "rotor_angle": 0.0, "rotor_rate": 30.0},
        dt=0.02,
        duration=100.0,
    ),
    CatalogueEntry(
        "manakov_body",
        "A free rigid body in four dimensions, on SO(4): a Lax pair with a spectral parameter (Manakov 1976).",
        "coadjoint.models.manakov:body",
        "coadjoint.models.manakov:start",
        {"moments": (1.0, 2.0, 3.5, 5.0)},
        {"angular_velocity": (0.5, -0.3, 0.2, 0.4, 0.1, -0.6)},
        dt=0.05,
        duration=50.0,
    ),
    CatalogueEntry(
        "spherical_pendulum",
        "A spherical pendulum on the curved space S².",
        "coadjoint.models.spherical_pendulum:make",
        "coadjoint.models.spherical_pendulum:start",
        {"mass": 1.0, "length": 1.0, "gravity": 9.81, "inertia": (1.0, 1.0, 1.0)},
        {"bob": (0.6, 0.0, -0.8), "bob_velocity": (0.0, 2.0, 0.0), **UP},
        dt=0.01,
        duration=50.0,
    ),
    CatalogueEntry(
        "clebsch_body",
        "A body in an ideal fluid on SE(3), Kirchhoff's equations with Clebsch's fourth integral.",
        "coadjoint.models.kirchhoff:clebsch",
        "coadjoint.models.kirchhoff:start",
        {"inertia": (1.0, 2.0, 1.5), "mass": (1.0, 1.5)},
        {**_PLACED, "velocity": (0.6, 0.4, 0.5), "angular_velocity": (0.5, 0.8, -0.3)},
        dt=0.02,
        duration=100.0,
    ),
)
"""Systems with as many integrals as they need; each watches its own."""


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


_OUTSIDE = {"gravity": 0.0, "load": None, "moment": None, "motion": None}

LINKS = (
    CatalogueEntry(
        "cosserat_rod",
        "A free elastic rod in space that bends, twists, shears and stretches.",
        "coadjoint.models.rods:cosserat",
        "coadjoint.models.rods:start",
        {
            "elements": 2,
            "length": 1.0,
            "EI": 1.0,
            "GJ": 0.8,
            "EA": 400.0,
            "GA": 200.0,
            "mass": 1.0,
            "inertia": (0.02, 0.01, 0.01),
            "rest_curvature": (0.0, 0.0, 0.0),
            "ends": "free",
            **_OUTSIDE,
        },
        {
            "position": (0.0, 0.0, 0.0),
            "rotation": None,
            "euler_zxz": None,
            "euler_zyx": None,
            "curvature": (0.0, 0.0, 0.2),
            "velocity": (0.1, 0.2, 0.3),
            "angular_velocity": (1.0, 0.5, 0.2),
            "down": (0.0, 0.0, -1.0),
        },
        dt=0.002,
        duration=1.0,
    ),
    CatalogueEntry(
        "planar_rod",
        "An elastic rod in a plane, clamped at one end, which falls.",
        "coadjoint.models.rods:planar",
        "coadjoint.models.rods:planar_start",
        {
            "elements": 3,
            "length": 1.0,
            "EI": 1.0,
            "EA": 400.0,
            "GA": 200.0,
            "mass": 1.0,
            "inertia": 0.01,
            "rest_curvature": 0.0,
            "ends": "clamped",
            **_OUTSIDE,
            "gravity": 9.81,
        },
        {
            "position": (0.0, 1.0),
            "angle": 0.0,
            "curvature": None,
            "velocity": (0.0, 0.0),
            "angular_velocity": 0.0,
            "down": (0.0, -1.0),
        },
        dt=0.001,
        duration=1.0,
    ),
    CatalogueEntry(
        "pendulum_chain",
        "Two rigid bodies on ball joints, hung one from the other.",
        "coadjoint.models.rods:pendulums",
        "coadjoint.models.rods:pendulums_start",
        {
            "links": 2,
            "length": 0.5,
            "mass": 1.0,
            "inertia": (0.01, 0.02, 0.02),
            "center": None,
            "stiffness": 0.0,
            "gravity": 9.81,
        },
        {"rotation": None, "angular_velocity": (1.0, 2.0, 0.5), "down": (1.0, 0.0, 0.0)},
        dt=0.005,
        duration=5.0,
    ),
    CatalogueEntry(
        "point_chain",
        "Two points on massless rods, hung one from the other, on spheres.",
        "coadjoint.models.rods:points",
        "coadjoint.models.rods:points_start",
        {"links": 2, "length": 0.5, "mass": 1.0, "gravity": 9.81},
        {"directions": (0.6, 0.0, -0.8), "rates": (0.0, 1.0, 0.0)},
        dt=0.005,
        duration=5.0,
    ),
)
