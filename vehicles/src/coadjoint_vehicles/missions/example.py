"""A mission file to start from, for any vehicle."""

from __future__ import annotations

import math
from typing import Any

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import to_toml
from coadjoint.units import ending
from coadjoint_vehicles.model.vehicle import Vehicle

_SET_POINTS: dict[str, object] = {
    "depth": [0.5, 5.0, 0.5],
    "heading": [0, 90, 90],
    "pitch": [0, -10, 10],
    "altitude": [10.0, 5.0, 10.0],
    "shallow": 2.0,
    "deep": 10.0,
}


TRIALS: dict[str, tuple[str, float | None, float]] = {
    "turning_circle": ("turning_circle", None, 60),
    "zigzag_10": ("zigzag", 10, 100),
    "zigzag_20": ("zigzag", 20, 100),
    "spiral": ("spiral", None, 350),
    "stop": ("stop", None, 60),
    "pull_out": ("pull_out", None, 50),
}
"""Standard manoeuvres: the word of the controller, the rudder order (°) and the duration after the execute (L/U)."""


def standard_manoeuvre(name: str, manoeuvre: str) -> str:
    """The mission of a standard manoeuvre, of `TRIALS`, for a vehicle; raises as `load_vehicle`, and ArgumentError."""
    from coadjoint.checks import choice
    from coadjoint_vehicles.files.registry import load_vehicle

    kind, order, duration = TRIALS[choice(manoeuvre, "manoeuvre", tuple(TRIALS))]
    vehicle = load_vehicle(name)
    speed = float(getattr(vehicle.controller, "speed", None) or 1.5)
    length = float(vehicle.length or 10 * vehicle.volume ** (1 / 3))
    begin, end = (float(f"{lengths * length / speed:.2g}") for lengths in (10, 10 + duration))
    angles = [part for part in vehicle.commanded if part.command is not None and part.command.unit == "rad"]
    limits = [float(limit) for part in angles if (limit := getattr(part, "limit", None)) is not None]
    if not limits:
        raise ArgumentError(
            f"The vehicle `{vehicle.name}` has no fins with a limit: standard manoeuvres are steered by fins."
        )
    limit = math.degrees(min(limits))
    rudder = (
        "" if order is None else f"rudder_deg = {min(order, math.floor(limit + 1e-9)):g}\ndeviation_deg = {order:g}\n"
    )
    key = "file" if name.endswith(".toml") else "name"
    return f"""# {" ".join(vehicle.name.split())}: {kind.replace("_", " ")}, a standard manoeuvre for `coadjoint run`.
{to_toml({"vehicle": {key: name}}).strip()}

[controller]
kind = "trial"
manoeuvre = "{kind}"
speed_m_s = {speed}
begin_s = {begin:g}  # first execute
{rudder}
[mission]
depth_m = 20
heading_deg = 0
speed_m_s = {speed}  # until the execute

[initial]
position_m = [0, 0, 20]
speed_m_s = {speed}

[run]
dt = 0.05
duration = {end:g}
"""


def example(name: str) -> str:
    """A commented mission for a vehicle, by its name or the path of its file; raises as `load_vehicle`."""
    from coadjoint_vehicles.files.registry import load_vehicle

    vehicle = load_vehicle(name)
    own = vehicle.controller
    speed = float(getattr(own, "speed", 0.0) or 0.0) if own is not None else 0.0
    key = "file" if name.endswith(".toml") else "name"
    parts = [
        f"# {' '.join(vehicle.name.split())}: a mission for `coadjoint run`. Every key but those of [vehicle] and "
        "[run] can be left out.",
        "# Units stand at the end of a key (m, m_s, deg, min, …); without one, numbers are SI.",
        'axes = "NED/FRD"  # of all sections; or "ENU/FLU": east, north, up; forward, port, up; yaw for heading\n',
        to_toml({"vehicle": {key: name}}),
        _water(),
        _controller(own),
        _mission(vehicle, own, speed),
        _initial(vehicle, speed),
        _RUN,
    ]
    return "\n".join(part.rstrip() + "\n" for part in parts)


def _water() -> str:
    return """# Kinds are uniform, shear, sheared, tidal, gauss_markov, table. Several add up, each under [water.NAME].
[water]
kind = "uniform"
velocity_m_s = [0.0, 0.1, 0.0]  # north, east, down"""


def _controller(own: PyTree) -> str:
    if own is None:
        return '# The vehicle has no controller: [mission] commands its actuators.\n[controller]\nkind = "none"'
    return f"""# The controller is the vehicle's own, a {type(own).__name__}; its kind, gains and period can be changed.
[controller]
period = {float(own.period)}"""


def _mission(vehicle: Any, own: PyTree, speed: float) -> str:
    lines = ["[mission]", "time_s = [0, 20, 80]"]
    if own is None:
        wanted = {part.name: part.command.unit for part in vehicle.commanded if part.command.shape == ()}
    else:
        wanted = dict(own.inputs)
    for name, unit in wanted.items():
        values = _SET_POINTS.get(name, [0.0, 0.0, 0.0] if name != "speed" else speed or 0.5)
        lines.append(f"{name}{ending(unit)} = {values}")
    if own is None:
        lines.append('ends = "surface"  # or ["surface", "bottom"] with bottom_m = 40')
    else:
        lines.append('# ends = ["surface", "bottom"]  # whichever comes first')
        lines.append("# bottom_m = 40")
    return "\n".join(lines)


def _initial(vehicle: Vehicle, speed: float) -> str:
    return f"""[initial]
position_m = [0, 0, {0.5 if vehicle.controller is not None else 20}]
speed_m_s = {speed if vehicle.controller is not None else 0.5}  # through the water
heading_deg = 0"""


_RUN = """[method]
name = "Midpoint"

[run]
dt = 0.05
duration_min = 2
save_every = 2
# members = 100  # that many missions, with [perturb]

# [perturb]  # standard deviations of parameters
# seed = 1
# mass = "2 %"

[output]
figures = ["mission"]  # or true, all of them
csv = true
# mcap = true  # trajectory.mcap for Foxglove, Lichtblick, Rerun and rosbags
animation = "html"  # or "gif" """
