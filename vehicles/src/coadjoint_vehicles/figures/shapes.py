"""How a vehicle looks: its hull and its parts as shapes of a scene, from the numbers of its file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from coadjoint.texts import Table
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.airfoil import Airfoil
from coadjoint_vehicles.parts.fin import Fin
from coadjoint_vehicles.parts.hull import Hull
from coadjoint_vehicles.parts.moving_mass import MovingMass
from coadjoint_vehicles.parts.part import AHEAD
from coadjoint_vehicles.parts.propeller import Propeller
from coadjoint_vehicles.parts.thrusters import Thrusters

GEOMETRY, BOTTOM = "vehicle_geometry", "bottom_depth"
"""Attributes of a dataset: the shapes of its vehicle as JSON, and the depth of the bottom, m."""

SLENDER = 0.12
"""Diameter by length where neither is given."""


def geometry(vehicle: Vehicle) -> Table:
    """The shapes of a vehicle as plain data, for the attributes of its runs.

    size: its length, m. shapes: the fixed parts, as `coadjoint.plotting.scene.Shape`. moving: the parts that do,
    with the variable, and of several its column, whose values, times `factor`, move them.
    """
    size, hull = _hull(vehicle)
    width = float(hull.get("diameter", size * SLENDER))
    found: Table = {"size": size, "shapes": [hull], "moving": []}
    for part in vehicle.parts:
        for item in _part(part, size, width):
            found["moving" if "motion" in item else "shapes"].append(item)
    return found


def _hull(vehicle: Vehicle) -> tuple[float, Table]:
    """The length, m, and the shape of the hull: a box, a torpedo with a diameter, else an ellipsoid of its inertia."""
    middle = _list(vehicle.center_of_buoyancy)
    sides = (vehicle.length, vehicle.width, vehicle.height)
    if vehicle.diameter is None and None not in sides:
        return float(max(sides)), {"kind": "box", "size": _list(sides), "at": middle}
    sizes: tuple[Any, Any] = (vehicle.length, vehicle.diameter)
    for part in vehicle.parts:
        if isinstance(part, Hull):
            sizes = sizes[0] or part.length, sizes[1] or max(float(part.width), float(part.height))
    axes = _semi_axes(vehicle)
    length = float(sizes[0] or 2 * axes[0])
    if sizes[1]:
        return length, {"kind": "torpedo", "length": length, "diameter": float(sizes[1]), "at": middle}
    if sizes[0]:
        axes = np.array([length / 2, *(axes[1:] * np.sqrt(2 * axes[0] / length))])
    return float(2 * max(axes)), {"kind": "ellipsoid", "axes": _list(axes), "at": middle}


def _semi_axes(vehicle: Vehicle) -> np.ndarray:
    """Those of the ellipsoid of the vehicle's volume whose second moments are in the proportions of its inertia."""
    moments = np.diag(np.asarray(vehicle.inertia, dtype=float)) if np.ndim(vehicle.inertia) == 2 else vehicle.inertia
    squares = np.clip(0.5 * np.sum(moments) - np.asarray(moments), 1e-3 * float(np.max(moments)), None)
    axes = np.sqrt(squares)
    return axes * np.cbrt(3 * float(vehicle.volume) / (4 * np.pi) / np.prod(axes))


def _part(part: Any, size: float, width: float) -> Iterator[Table]:
    if isinstance(part, (Fin, Airfoil)):
        yield from _fin(part, size, width)
    elif isinstance(part, Propeller):
        at = np.asarray(part.position, dtype=float)
        at = at if np.any(at) else -(0.5 * size + 0.02 * size) * np.asarray(AHEAD)
        yield {
            "shape": {"kind": "blades", "diameter": float(part.diameter)},
            "at": _list(at),
            "axis": _list(part.axis),
            "motion": "spin",
            "variable": f"internal_{part.name}",
        }
    elif isinstance(part, Thrusters):
        yield from _thrusters(part, size)
    elif isinstance(part, MovingMass):
        yield {
            "shape": {"kind": "box", "size": [0.06 * size] * 3},
            "at": _list(part.position),
            "axis": _list(part.axis),
            "motion": "slide",
            "variable": f"internal_{part.name}_position",
        }


def _fin(part: Fin | Airfoil, size: float, width: float) -> Iterator[Table]:
    """One plate, or a pair on both sides of the hull where the fin's place is on the middle line."""
    place, normal = np.asarray(part.position, dtype=float), np.asarray(part.normal, dtype=float)
    span = np.cross(normal, AHEAD)
    span /= np.linalg.norm(span)
    pair = float(np.linalg.norm(place[1:])) < 0.25 * width
    area = min(float(part.area), 0.05 * size**2) / (2 if pair else 1)
    chord = np.sqrt(area / 1.3)
    wide = 1.3 * chord
    place = place + max(0.0, -0.5 * size + chord - place[0]) * np.asarray(AHEAD)
    for side in (-1, 1) if pair else (0,):
        at = place + side * (0.3 * width + wide / 2) * span
        shape = {"kind": "plate", "chord": float(chord), "span": float(wide)}
        look = {"at": _list(at), "axis": _list(AHEAD), "span_axis": _list(span)}
        if part.limit is None:
            yield {**shape, **look, "dim": True}
        else:
            yield {"shape": shape, **look, "motion": "hinge", "variable": f"internal_{part.name}"}


def _thrusters(part: Thrusters, size: float) -> Iterator[Table]:
    """A duct and a jet each; of an allocation matrix on the lines of its thrusts, nearest to the origin."""
    if part.allocation is None:
        places, ways = np.asarray(part.positions), np.asarray(part.directions)
    else:
        force, torque = np.asarray(part.allocation)[:3].T, np.asarray(part.allocation)[3:].T
        lengths = np.linalg.norm(force, axis=1, keepdims=True)
        ways = force / np.where(lengths > 0, lengths, 1.0)
        places = np.cross(ways, torque / np.where(lengths > 0, lengths, 1.0))
    neutral = float(part.curve.neutral)
    largest = 1.0 if part.limit is None else float(np.max(np.abs(np.asarray(part.limit) - neutral)))
    for number, (at, way) in enumerate(zip(places, ways, strict=True)):
        if not np.any(way):
            continue
        look = {"at": _list(at), "axis": _list(way)}
        yield {"kind": "duct", "diameter": 0.1 * size, **look, "dim": True}
        yield {
            "shape": {"kind": "jet", "diameter": 0.1 * size},
            **look,
            "motion": "push",
            "reach": 0.6 * size,
            "variable": f"internal_{part.name}",
            "column": number,
            "offset": -neutral,
            "factor": 1 / largest,
        }


def _list(values: object) -> list[float]:
    return [float(value) for value in np.asarray(values)]
