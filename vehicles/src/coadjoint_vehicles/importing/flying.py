"""Whether an imported vehicle flies: its actuators, the controllers that fit, and a mission to begin with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coadjoint.extending import to_toml
from coadjoint_vehicles.controllers.hover import Hover, Manoeuvre, Pose
from coadjoint_vehicles.controllers.thrusting import accelerations, lacking
from coadjoint_vehicles.importing.report import Report
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.airfoil import Airfoil
from coadjoint_vehicles.parts.allocator import LEAST_AUTHORITY
from coadjoint_vehicles.parts.ballast import Ballast
from coadjoint_vehicles.parts.fin import Fin
from coadjoint_vehicles.parts.moving_mass import MovingMass
from coadjoint_vehicles.parts.propeller import Propeller
from coadjoint_vehicles.parts.thrusters import Thrusters

NEEDED = {one.kind: one.NEEDS for one in (Manoeuvre, Hover, Pose)}
"""The axes that controllers of thrusters push along."""
SPEEDS = {"manoeuvre": 0.3, "cruise": 1.0}
"""m/s, of a first mission."""


def fitting(vehicle: Vehicle, unlimited: bool = False) -> list[str]:
    """The kinds of the controllers that a vehicle has actuators for; `unlimited`: if its thrusters had limits."""
    jets = [part for part in vehicle.parts if isinstance(part, Thrusters)]
    found = []
    if len(jets) == 1:
        found = [kind for kind, axes in NEEDED.items() if not _lacking(vehicle, jets[0], axes)]
    turning = np.zeros(2)
    for part in vehicle.parts:
        if isinstance(part, (Fin, Airfoil)) and part.limit is not None:
            turning += np.abs(np.asarray(part.normal, dtype=float)[1:])
    pushes = [part for part in vehicle.parts if isinstance(part, Propeller)]
    limited = [part for part in jets if unlimited or part.limit is not None]
    ahead = any(np.max(np.abs(part.nominal_matrix[0])) > LEAST_AUTHORITY for part in limited) or bool(pushes)
    if ahead and np.all(turning > 0.1):
        found += ["cruise", "attitude"]
    if any(isinstance(part, Ballast) for part in vehicle.parts) and any(
        isinstance(part, MovingMass) for part in vehicle.parts
    ):
        found.append("sawtooth")
    return found


def _lacking(vehicle: Vehicle, jets: Thrusters, needed: Sequence[str]) -> str:
    """How thrusters fail to push along axes that are needed, by the mass that they move; "" where they do not."""
    arm = vehicle.mass * np.cross(np.eye(3), vehicle.center_of_mass)
    inertia = np.asarray(vehicle.inertia, dtype=float)
    about = (np.diag(inertia) if inertia.ndim == 1 else inertia) + arm.T @ arm / vehicle.mass
    body = np.block([[vehicle.mass * np.eye(3), arm.T], [arm, about]])
    added = np.asarray(vehicle.added_mass, dtype=float)
    M = body + (np.diag(added) if added.ndim == 1 else added)
    return lacking(jets, accelerations(jets, M), needed)


def flies(vehicle: Vehicle) -> str:
    """A line on the actuators and the controllers that fit."""
    thrusters = sum(part.count for part in vehicle.parts if isinstance(part, Thrusters))
    counts = {
        "thruster": thrusters,
        "propeller": sum(isinstance(part, Propeller) for part in vehicle.parts),
        "fin": sum(isinstance(part, (Fin, Airfoil)) and part.limit is not None for part in vehicle.parts),
        "ballast": sum(isinstance(part, Ballast) for part in vehicle.parts),
    }
    said = [
        f"{count} {word}{'s' if count != 1 and word != 'ballast' else ''}"
        for word, count in counts.items()
        if count or word in ("thruster", "fin")
    ]
    fit = fitting(vehicle)
    return f"{', '.join(said)}; controllers that fit: {', '.join(fit) or 'none'}"


def doubts(vehicle: Vehicle) -> list[str]:
    """Sentences on a vehicle that cannot be steered."""
    if not vehicle.commanded:
        return [
            "NOTHING PUSHES THIS VEHICLE: the files have no thruster, propeller, fin or ballast that is read. Look "
            "whether they are in another file, or behind an argument (--set NAME=VALUE)."
        ]
    jets = [part for part in vehicle.parts if isinstance(part, Thrusters)]
    endless = ", ".join(f"`{part.name}`" for part in jets if part.limit is None)
    more = [kind for kind in fitting(vehicle, unlimited=True) if kind not in fitting(vehicle)]
    if endless and (more or fitting(vehicle)):
        fit = f"then {', '.join(more)} can fly it" if more else "without it they push with any force that is asked for"
        return [f"The files give {endless} no limit: add `limit` in the vehicle file, {fit}."]
    if fitting(vehicle):
        return []
    if len(jets) == 1 and (said := _lacking(vehicle, jets[0], NEEDED["manoeuvre"])):
        return [f"No controller fits: its thrusters {said}."]
    if any(part.limit is None for part in jets):
        return ["No controller fits: its thrusters have no limit; give them one, `limit` in the vehicle file."]
    return ["No controller fits: write one, or command the actuators by inputs."]


def first_mission(vehicle: Vehicle, file: str, report: Report) -> str:
    """A mission file of a minute: down by 3 m and a quarter turn, with a controller that fits; raises StopIteration."""
    kind = next(kind for kind in fitting(vehicle) if kind in SPEEDS)
    speed = SPEEDS[kind]
    ballast = {f"{name}_m3": float(f"{volume:.6g}") for name, volume in report.starts.items()}
    begun = {"actuators": ballast} if ballast else {}
    tables: dict[str, object] = {
        "vehicle": {"file": file},
        "controller": {"kind": kind, **({"speed_m_s": speed} if kind == "cruise" else {})},
        "mission": {"time_s": [0, 5], "depth_m": [2, 5], "heading_deg": [0, 90], "speed_m_s": speed, **ballast},
        "initial": {"position_m": [0, 0, 2], "speed_m_s": speed if kind == "cruise" else 0.0, **begun},
        "run": {"dt": 0.05, "duration_s": 60},
    }
    if any(report.current):
        tables["water"] = {"velocity_m_s": list(report.current)}
    return f"# {vehicle.name}, imported: `coadjoint run` of this file flies it.\n{to_toml(tables)}"
