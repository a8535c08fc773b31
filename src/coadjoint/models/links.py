"""The entries of rods and chains of links in the catalogue; their makers are loaded when first used."""

from __future__ import annotations

from coadjoint.models.entry import CatalogueEntry

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
