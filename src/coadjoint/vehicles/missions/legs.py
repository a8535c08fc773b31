"""The section [mission]: set points by time, or way points, and what ends it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.runs.units import unknown
from coadjoint.units import dimension_of, factor_to, split_name
from coadjoint.vehicles.logs.headers import inside, loose

if TYPE_CHECKING:
    from coadjoint.vehicles.missions.file import MissionFile

OTHERS = ("time", "between", "file", "ends", "bottom", "clearance", "way_points", "acceptance", "look_ahead")
"""The keys of [mission] that are no set points."""
MEASURED = {"time": "s", **dict.fromkeys(("bottom", "clearance", "way_points", "acceptance", "look_ahead"), "m")}
"""What those of them that are numbers measure."""
SCALARS = ("depth", "altitude", "heading", "pitch", "roll", "speed")
"""Set points of one number."""
ENDS = ("surface", "bottom", "last way point")


def inputs(file: MissionFile, units: Mapping[str, str]) -> dict[str, Any]:
    """The set points and commands of [mission] by name: co.Held or co.Linear over `time`, or numbers that stay.

    units: what the controller and the actuators take, with the unit of each. Raises ArgumentError for what nobody
    takes.
    """
    import coadjoint as co

    given = _plain(file)
    between = given.get("between", "held")
    if between not in ("held", "linear"):
        raise ArgumentError(f'[mission] between must be "held" or "linear", but is {between!r}.')
    found: dict[str, Any] = {}
    if "file" in given:
        from coadjoint.vehicles.logs.inputs import inputs_from_csv

        found |= inputs_from_csv(file.located(given["file"]), between=between)
    time = np.atleast_1d(_numbers("time_s", given["time"])) if "time" in given else None
    for name, value in given.items():
        if name in OTHERS:
            continue
        values = _numbers(name, value)
        if np.ndim(values) == 0 or (time is None and name not in SCALARS):
            found[name] = values
        elif time is None:
            raise ArgumentError(
                f"[mission] {name} has {len(values)} values, so that it needs `time_s`, when each begins."
            )
        elif len(values) != len(time):
            raise ArgumentError(
                f"[mission] {name} must be one number, or a value for each of {len(time)} times, but has {len(values)}."
            )
        else:
            found[name] = (co.Held if between == "held" else co.Linear)(time, values)
        if units.get(name) == "rad":
            _require_angles(name, values)
    for name in found:
        if name not in units:
            raise ArgumentError(unknown(f"set point `{name}`", "Section [mission]", name, [*units, *OTHERS]))
    _require_units(file, units)
    return found


def _require_units(file: MissionFile, units: Mapping[str, str]) -> None:
    """Raise ArgumentError where the unit of a key is not one of what it measures."""
    wanted = {**units, **MEASURED}
    for key in file.mission:
        name, unit = (key, "") if key in OTHERS else split_name(key)
        if unit and name.removesuffix("_radius") in wanted:
            require_unit("[mission]", key, name, unit, wanted[name.removesuffix("_radius")])


def require_unit(where: str, key: str, name: str, unit: str, wanted: str) -> None:
    """Raise ArgumentError unless numbers in a unit are of what is wanted."""
    try:
        if inside(unit)[0] != wanted:
            factor_to(dimension_of(wanted), unit, key)
    except ArgumentError:
        raise ArgumentError(f"{where} `{name}` measures {wanted}, but `{key}` is in {inside(unit)[0]}.") from None


def _plain(file: MissionFile) -> dict[str, Any]:
    """[mission] under names without their units, in SI units and rad."""
    found: dict[str, Any] = {}
    for key, value in file.mission.items():
        _, name, _, factor = (key, key, "", 1.0) if key in OTHERS else loose(key)
        name = name.removesuffix("_radius")
        if name in found:
            raise ArgumentError(f"Section [mission] gives `{name}` twice: once as `{key}`, once in another unit.")
        found[name] = value if factor == 1.0 else (factor * _numbers(key, value)).tolist()
    if "axes" in found:
        raise ArgumentError("Section [mission] has no axes of its own: put `axes` above all sections of the file.")
    return found if file.axes == "NED/FRD" else _turned(found)


def _turned(given: dict[str, Any]) -> dict[str, Any]:
    """[mission] of a file in ENU/FLU in NED/FRD: heading = π/2 − yaw, and the pitch has the other sign.

    Depths, altitudes, `north` and `east` are what their names say in either.
    """
    from coadjoint.vehicles import axes as border

    if "heading" in given:
        raise ArgumentError("[mission] heading belongs to NED/FRD: give `yaw`, from east to the left, in ENU/FLU.")
    found = dict(given)
    if "yaw" in found:
        found["heading"] = (np.pi / 2 - _numbers("yaw", found.pop("yaw"))).tolist()
    if "pitch" in found:
        found["pitch"] = (-_numbers("pitch", found["pitch"])).tolist()
    if "attitude" in found:
        found["attitude"] = border.rotation(_numbers("attitude", found["attitude"]), "ENU/FLU").tolist()
    if "way_points" in found and np.ndim(points := _numbers("way_points_m", found["way_points"])) == 2:
        found["way_points"] = border.space_vector(points, "ENU/FLU").tolist() if points.shape[1] == 3 else points
    return found


def _require_angles(name: str, values: np.ndarray) -> None:
    from coadjoint.models.quantities import angles

    try:
        angles(values, name)
    except ArgumentError as error:
        raise ArgumentError(f"[mission] {str(error).removeprefix('Argument ')}") from error


def _numbers(name: str, value: Any) -> np.ndarray:
    try:
        found = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"[mission] {name} must hold numbers, but is {value!r}.") from error
    if not np.all(np.isfinite(found)) or isinstance(value, (bool, str)):
        raise ArgumentError(f"[mission] {name} must hold numbers, but is {value!r}.")
    return found


def following(file: MissionFile, controller: Any, start: Any) -> Any:
    """The controller as the helm of one that follows the way points of [mission], from where the vehicle starts.

    start: (3,) m, north, east, depth. Raises ArgumentError for points that are none, and for set points beside them
    that they decide. Without way points it is the controller itself.
    """
    given = _plain(file)
    if "way_points" not in given:
        for key in ("acceptance", "look_ahead"):
            if key in given:
                raise ArgumentError(f"[mission] {key} belongs to `way_points_m`, which are not given.")
        return controller
    if controller is None:
        raise ArgumentError('[mission] way_points_m need a controller at the helm, but [controller] has kind = "none".')
    from coadjoint.vehicles.controllers.line_of_sight import LineOfSight

    points = way_points(file)
    if np.linalg.norm(points[0, :2] - np.asarray(start)[:2]) > 0:
        points = np.concatenate([np.asarray(start, dtype=float)[None], points])
    more = {key: _numbers(key, given[key]) for key in ("acceptance", "look_ahead") if key in given}
    for key, value in more.items():
        if np.ndim(value):
            raise ArgumentError(f"[mission] {key} must be one number, but is {given[key]!r}.")
    return LineOfSight(way_points=points, helm=controller, period=controller.period, delay=controller.delay, **more)


def way_points(file: MissionFile) -> np.ndarray:
    """The way points of [mission], (k, 3): north, east, depth, m; none where it has none."""
    given = _plain(file).get("way_points")
    points = np.zeros((0, 3)) if given is None else _numbers("way_points_m", given)
    if points.ndim != 2 or points.shape[1] != 3:
        names = "[north, east, depth]" if file.axes == "NED/FRD" else "[east, north, up]"
        raise ArgumentError(f"[mission] way_points_m must hold {names} of each point, but is {given!r}.")
    return points


def arrival(controller: Any) -> Any:
    """The event that a controller who follows way points comes to the last one, within its acceptance or beside it."""
    import jax.numpy as jnp

    from coadjoint.vehicles.controllers.line_of_sight import leg

    points, acceptance = np.asarray(controller.way_points), float(controller.acceptance)
    last = len(points) - 2

    def gap(state: Any) -> Any:
        here = leg(state.q, jnp.asarray(points[-2]), jnp.asarray(points[-1]))
        off = state.q[:2] - points[-1, :2]
        left = jnp.minimum(jnp.sqrt(off @ off + 1e-300) - acceptance, here.length - here.along)
        return jnp.where(state.internal.controller.value.memory.leg < last, acceptance + 1.0, left)

    return gap


def require_room_to_end(file: MissionFile, start: Any) -> None:
    """Raise ArgumentError where a mission that ends at the surface or the bottom starts beyond it.

    start: (3,) m, or one for each member.
    """
    given = _plain(file)
    chosen = _ends(given)
    if chosen and file.run.members > 1:
        raise ArgumentError("[mission] ends would end each of the members at its own time: leave it out.")
    depth = np.atleast_2d(np.asarray(getattr(start, "values", start), dtype=float))[:, 2]
    if "surface" in chosen and np.min(depth) < 0:
        raise ArgumentError(f'[mission] ends at the "surface", but [initial] is {-np.min(depth):g} m above it.')
    if "bottom" not in chosen:
        for key in ("bottom", "clearance"):
            if key in given:
                raise ArgumentError(f'[mission] {key} belongs to ends = "bottom": add it, or leave {key} out.')
    elif "bottom" in given:
        bottom = float(_one(given, "bottom")) - float(_one(given, "clearance"))
        if np.max(depth) >= bottom:
            raise ArgumentError(
                f'[mission] ends at the "bottom", at a depth of {bottom:g} m, but [initial] is at {np.max(depth):g} m.'
            )


def reached(file: MissionFile, final: Any) -> str:
    """Which of the ends of [mission] ended it. final: (3,) m, where it ended."""
    given = _plain(file)
    gaps = {"surface": abs(final[2])}
    if "bottom" in given:
        gaps["bottom"] = abs(_one(given, "bottom") - _one(given, "clearance") - final[2])
    near = {end: float(gaps[end]) if end in gaps else 1e-3 for end in _ends(given)}
    return min(near, key=near.__getitem__)


def _ends(given: dict[str, Any]) -> list[Any]:
    ends = given.get("ends") or []
    return ends if isinstance(ends, list) else [ends]


def _one(given: dict[str, Any], key: str) -> Any:
    """One number of [mission], 0 where it is not given; raises ArgumentError."""
    found = _numbers(key, given.get(key, 0.0))
    if np.ndim(found):
        raise ArgumentError(f"[mission] {key} must be one number, but is {given[key]!r}.")
    return found


def bottom(file: MissionFile) -> float | None:
    """The depth of the bottom, m; None where the mission knows of none."""
    given = _plain(file)
    return float(_one(given, "bottom")) if "bottom" in given else None


def _bottom_of(file: MissionFile, given: dict[str, Any]) -> Any:
    """The bottom that a mission ends at: a depth in m, or the grid of [water.bottom]; raises ArgumentError."""
    from coadjoint.vehicles.missions.water import bottom

    grid = bottom(file)
    if (grid is None) == ("bottom" not in given):
        what = "both have one" if grid is not None else "there is none"
        raise ArgumentError(f'[mission] ends = "bottom" needs `bottom`, its depth in m, or [water.bottom], but {what}.')
    return given["bottom"] if grid is None else grid


def until(file: MissionFile, arrived: Any = None) -> Any:
    """The event that ends the mission before its time, None where nothing does; raises ArgumentError.

    arrived: the event that the last way point is reached, where there are way points.
    """
    given = _plain(file)
    if not given.get("ends"):
        return None
    from coadjoint.vehicles.water import borders

    events = []
    for end in _ends(given):
        if end not in ENDS:
            raise ArgumentError(unknown(f"end {end!r}", "Section [mission]", str(end), ENDS))
        if end == "surface":
            events.append(borders.at_surface())
        elif end == "bottom":
            events.append(borders.at_bottom(_bottom_of(file, given), given.get("clearance", 0.0)))
        elif arrived is None:
            raise ArgumentError('[mission] ends = "last way point" needs `way_points`.')
        else:
            events.append(arrived)
    return events[0] if len(events) == 1 else borders.first_of(*events)
