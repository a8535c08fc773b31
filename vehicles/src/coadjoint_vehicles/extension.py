"""Extensions by vehicles: models of the catalogue, figures, a format of files, a kind of run files.

Read by `coadjoint.extensions`; nothing is imported before it is used.
"""

from __future__ import annotations

from coadjoint.extending import MOVING
from coadjoint.models import CatalogueEntry
from coadjoint.plotting.registries import AddedScene
from coadjoint_vehicles.figures.declared import FIGURES as FIGURES
from coadjoint_vehicles.files.bodies import body_numbers

_CRUISE = {**MOVING, "velocity": (1.5, 0.0, 0.0), "angular_velocity": (0.0, 0.0, 0.01)}
_ENTRIES = (
    CatalogueEntry(
        "underwater_vehicle_general",
        "A vehicle about any body origin with a 6×6 added mass matrix, on SO(3) × ℝ³: REMUS 100 without damping.",
        "coadjoint.models.general_form:general_vehicle",
        "coadjoint.models.paper_form:start",
        body_numbers("remus_100"),
        _CRUISE,
        dt=0.01,
        duration=20.0,
    ),
    CatalogueEntry(
        "underwater_vehicle_se3",
        "The same vehicle on SE(3): horizontal momentum and the vertical moment are conserved.",
        "coadjoint.models.general_form:se3_vehicle",
        "coadjoint.models.general_form:se3_start",
        body_numbers("remus_100"),
        _CRUISE,
        dt=0.01,
        duration=20.0,
    ),
    CatalogueEntry(
        "remus_100",
        "REMUS 100 with hull drag, fins and propeller in a current, under way at a fixed number of revolutions.",
        "coadjoint_vehicles.remus:open_loop",
        "coadjoint_vehicles.remus:remus_start",
        {
            "fluid_density": 1026.0,
            "axial_drag": 0.42,
            "crossflow_drag": 1.1,
            "fin_lift_slope": 3.12,
            "current": (0.0, 0.0, 0.0),
        },
        {
            "position": (0.0, 0.0, 10.0),
            "speed": 1.5,
            "euler_zyx": (0.0, 0.0, 0.0),
            "stern_planes": 0.0,
            "rudder": 0.0,
            "revolutions": 14.94,
        },
        dt=0.05,
        duration=100.0,
    ),
    CatalogueEntry(
        "kirchhoff_ellipsoid",
        "A neutrally buoyant ellipsoid in an ideal fluid, with Lamb's added mass.",
        "coadjoint_vehicles.hydrodynamics.ellipsoids:ellipsoid",
        "coadjoint.models.paper_form:start",
        {
            "semi_axes": (0.5, 0.2, 0.3),
            "fluid_density": 1000.0,
            "gravity": 9.81,
            "center_of_mass": (0.0, 0.0, 0.0),
        },
        {**MOVING, "velocity": (0.5, 0.1, 0.2), "angular_velocity": (0.5, 1.0, -0.3)},
        dt=0.02,
        duration=100.0,
    ),
)
MODELS = {entry.name: entry for entry in _ENTRIES}
"""To `coadjoint.models.catalogue`."""

SCENES = {
    "vehicle": AddedScene(
        "coadjoint_vehicles.figures.scenes:scene",
        "coadjoint_vehicles.figures.fitting:of_vehicle",
        down=True,
        stage="coadjoint_vehicles.figures.animation:stage",
    )
}
"""To the player."""

NUMBERS = {"vehicle": "coadjoint_vehicles.missions.provenance:numbers"}
"""To reports."""

FORMATS = {
    ".csv": "coadjoint_vehicles.logs.columns:log_text",
    ".mcap": "coadjoint_vehicles.logs.bags.writing:mcap_bytes",
}
"""To `run.save`."""

LOG_FORMATS: dict[str, str] = {}
"""To `read_log`: readers of tables other than CSV, by the suffix of files."""

RUN_FILES = {"vehicle": "coadjoint_vehicles.missions.file:from_table"}
"""To `coadjoint.runs`: the reader of a run file with this section."""

KEYS = {
    "mission files": "coadjoint_vehicles.missions.file:declared",
    "vehicle files": "coadjoint_vehicles.files.file:declared",
}
"""To `coadjoint keys`: the sections of files, whose fields are their keys."""

COMMANDS = {
    "vehicles": "coadjoint_vehicles.commands.vehicles:Vehicles",
    "import": "coadjoint_vehicles.commands.importing:Import",
    "stability": "coadjoint_vehicles.commands.stability:Stability",
    "identify": "coadjoint_vehicles.commands.identify:Identify",
    "serve": "coadjoint_vehicles.commands.serving:Serve",
}
"""To the command line."""
