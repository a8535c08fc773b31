"""Models ready to use, and their catalogue: `catalogue["heavy_top"].make()`.

Listing the catalogue imports no model and no JAX; a model's module is loaded when first used.
"""

from __future__ import annotations

from math import radians
from typing import TYPE_CHECKING

from coadjoint.extensions import Registry
from coadjoint.lazy import lazy
from coadjoint.models.catalogue_entries import HAMILTONIAN, INTEGRABLE, LINKS
from coadjoint.models.entry import MOVING, TURNING, UP
from coadjoint.models.entry import CatalogueEntry as CatalogueEntry
from coadjoint.models.paper_tables import PAPER_DURATION as PAPER_DURATION
from coadjoint.models.paper_tables import PAPER_STEP as PAPER_STEP
from coadjoint.models.paper_tables import TABLE_1 as TABLE_1
from coadjoint.models.paper_tables import TABLE_2 as TABLE_2

if TYPE_CHECKING:
    from coadjoint.models import beanie as beanie
    from coadjoint.models import falling_cat as falling_cat
    from coadjoint.models import fluids as fluids
    from coadjoint.models import general_form as general_form
    from coadjoint.models import heavy_top as heavy_top
    from coadjoint.models import hopf as hopf
    from coadjoint.models import manakov as manakov
    from coadjoint.models import multibody as multibody
    from coadjoint.models import paper_form as paper_form
    from coadjoint.models import point_vortices as point_vortices
    from coadjoint.models import pseudo_rigid as pseudo_rigid
    from coadjoint.models import rigid_body as rigid_body
    from coadjoint.models import rods as rods
    from coadjoint.models import swimmer as swimmer
    from coadjoint.models import toda as toda
    from coadjoint.models.general_form import general_vehicle as general_vehicle
    from coadjoint.models.general_form import se3_start as se3_start
    from coadjoint.models.general_form import se3_vehicle as se3_vehicle
    from coadjoint.models.paper_tables import paper_start as paper_start
    from coadjoint.models.paper_tables import paper_vehicle as paper_vehicle


_ENTRIES = (
    CatalogueEntry(
        "free_rigid_body",
        "A rigid body that nothing acts on, turning about its unstable middle axis.",
        "coadjoint.models.rigid_body:make",
        "coadjoint.models.rigid_body:start",
        {"inertia": (1.0, 2.0, 3.0)},
        {**TURNING, "angular_velocity": (0.01, 1.0, 0.01)},
        dt=0.05,
        duration=100.0,
    ),
    CatalogueEntry(
        "heavy_top",
        "A rigid body with one point fixed, under gravity: the fast heavy top of Brüls, Cardona and Arnold (2012).",
        "coadjoint.models.heavy_top:make",
        "coadjoint.models.heavy_top:start",
        {
            "mass": 15.0,
            "center_of_mass": (0.0, 1.0, 0.0),
            "inertia": (0.234375, 0.46875, 0.234375),
            "gravity": 9.81,
            "inertia_about": "center_of_mass",
        },
        {**UP, "angular_velocity": (0.0, 150.0, -4.61538)},
        dt=1e-4,
        duration=2.0,
    ),
    CatalogueEntry(
        "simo_wong_top",
        "The symmetric heavy top of Simo and Wong (1991).",
        "coadjoint.models.heavy_top:make",
        "coadjoint.models.heavy_top:start",
        {
            "mass": 20.0,
            "center_of_mass": (0.0, 0.0, 1.0),
            "inertia": (5.0, 5.0, 1.0),
            "gravity": 1.0,
            "inertia_about": "pivot",
        },
        {**UP, "euler_zxz": (0.0, 0.05, 0.0), "angular_velocity": (0.0, 0.0, 50.0)},
        dt=0.005,
        duration=10.0,
    ),
    *INTEGRABLE,
    *HAMILTONIAN,
    *LINKS,
    CatalogueEntry(
        "underwater_vehicle",
        "The vehicle of Ono, Fiori and Peng (2025), Tables 1 and 2: added mass, off-centre buoyancy; z points down.",
        "coadjoint.models.paper_form:vehicle",
        "coadjoint.models.paper_form:start",
        TABLE_1,
        {
            **MOVING,
            "position": TABLE_2["position"],
            "velocity": TABLE_2["velocity"],
            "euler_zxz": TABLE_2["euler_zxz"],
            "angular_velocity": (radians(10), 0.0, radians(20)),
        },
        dt=PAPER_STEP,
        duration=PAPER_DURATION,
    ),
    CatalogueEntry(
        "pseudo_rigid_body",
        "An elastic body that stays an affine image of itself, on GL(3), stretched and turning.",
        "coadjoint.models.pseudo_rigid:elastic",
        "coadjoint.models.pseudo_rigid:start",
        {"moments": (0.4, 0.4, 0.4), "shear": 2.0, "lame": 3.0, "volume": 0.5},
        {
            "deformation": ((1.1, 0.1, 0.0), (0.0, 0.95, 0.05), (0.0, 0.0, 1.0)),
            "velocity": ((0.0, -0.5, 0.0), (0.6, 0.0, 0.1), (0.0, 0.0, 0.0)),
        },
        dt=0.01,
        duration=10.0,
    ),
    CatalogueEntry(
        "elroys_beanie",
        "Two bodies in the plane on one hinge, with a spring: the simplest bundle, with a flat connection.",
        "coadjoint.models.beanie:make",
        "coadjoint.models.beanie:start",
        {"body": 2.0, "cap": 1.0, "stiffness": 1.0},
        {"angle": 0.0, "angular_velocity": 0.5, "cap_angle": 1.0, "cap_rate": 0.0},
        dt=0.02,
        duration=50.0,
    ),
    CatalogueEntry(
        "falling_cat",
        "Two bodies of revolution on a joint that bends and does not twist, in free fall (Kane and Scher 1969).",
        "coadjoint.models.falling_cat:make",
        "coadjoint.models.falling_cat:start",
        {
            "mass": (1.5, 1.5),
            "axial": (0.0025, 0.0025),
            "transverse": (0.01, 0.01),
            "reach": (0.12, 0.12),
            "stiffness": 0.5,
        },
        {**TURNING, "angular_velocity": (1.0, 0.2, 0.0), "bend": (0.6, 0.0), "bend_rate": (0.0, 2.0)},
        dt=0.002,
        duration=5.0,
    ),
    CatalogueEntry(
        "three_link_swimmer",
        "Three hinged ellipses in an ideal fluid in the plane, on SE(2) with two joint angles.",
        "coadjoint.models.swimmer:make",
        "coadjoint.models.swimmer:start",
        {"semi_axes": (0.5, 0.1), "density": 1.0, "stiffness": 0.1},
        {
            "angle": 0.0,
            "position": (0.0, 0.0),
            "velocity": (0.1, 0.3, 0.0),
            "bend": (0.8, 0.4),
            "bend_rate": (0.0, 0.0),
        },
        dt=0.01,
        duration=20.0,
    ),
)

catalogue: Registry[CatalogueEntry] = Registry("MODELS", {entry.name: entry for entry in _ENTRIES})
"""Every model by its name; see `CatalogueEntry`."""


if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
    __all__ += ["PAPER_DURATION", "PAPER_STEP", "TABLE_1", "TABLE_2", "CatalogueEntry", "catalogue"]
