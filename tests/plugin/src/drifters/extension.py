"""The tables of this package, which the library reads by its entry point."""

from __future__ import annotations

from coadjoint.models import CatalogueEntry

MODELS = {
    "swinging_float": CatalogueEntry(
        "swinging_float",
        "A bottom-heavy float that swings about its centre of buoyancy.",
        "drifters.model:make",
        "drifters.model:start",
        {"inertia": (2.0, 2.0, 1.0), "weight": 50.0, "center": (0.0, 0.0, 0.1)},
        {"roll": 0.2, "roll_rate": 0.0},
        dt=0.05,
        duration=20.0,
    )
}
METHODS = {"Ends": "drifters.method:Ends"}
SENSORS = {"thermometer": "drifters.sensor:Thermometer"}
LOG_FORMATS = {".drift": "drifters.log:read_drift"}
