"""The section [mission]: set points by time, or way points, and its end."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.checks import all_known, number, unknown
from coadjoint.errors import ArgumentError
from coadjoint.sections import key, keys
from coadjoint.texts import Table
from coadjoint.units import LENGTH, TIME, dimension_of, factor_to
from coadjoint_vehicles.logs.headers import loose

if TYPE_CHECKING:
    from coadjoint_vehicles.water.bottom import Bottom

SCALARS = ("depth", "altitude", "heading", "pitch", "roll", "speed")
"""Set points of one number."""
ENDS = ("surface", "bottom", "last way point")


def _numbers(value: object, name: str) -> Array:
    found = np.asarray(np.nan)
    with suppress(TypeError, ValueError):
        found = np.asarray(value, dtype=float)
    if not np.all(np.isfinite(found)) or isinstance(value, (bool, str)):
        raise ArgumentError(f"{name} must hold finite numbers, but is {value!r}.")
    return found


def _ends(value: Any, name: str) -> tuple[str, ...]:
    ends = value if isinstance(value, list) else [value] if value else []
    all_known(ends, ENDS, "end", "Section [mission]")
    return tuple(ends)


class SetPoint(NamedTuple):
    """A set point or a command of [mission]: the key, the SI unit that it ends in ("" without), numbers in SI units."""

    key: str
    unit: str
    values: np.ndarray


@dataclass(frozen=True, eq=False)
class MissionSection:
    """The task of a vehicle; `axes`: those of its vectors and angles in the file."""

    time: np.ndarray | None = key("when each value begins", TIME, check=_numbers, default=None)
    between: str = key("what holds between two times", words=("held", "linear"), default="held")
    file: str = key("CSV file with set points over `time_s`", default="")
    ends: tuple[str, ...] = key("what ends the run before its `duration`", check=_ends, default=())
    bottom: float | None = key("depth of the bottom", LENGTH, check=number, default=None)
    clearance: float | None = key("distance from the bottom where the run ends", LENGTH, check=number, default=None)
    way_points: np.ndarray | None = key("points that the vehicle passes", LENGTH, check=_numbers, default=None)
    acceptance: float | None = key(
        "distance from a way point at which the next leg begins",
        LENGTH,
        check=number,
        others=("acceptance_radius",),
        default=None,
    )
    look_ahead: float | None = key("distance ahead on a leg at which it aims", LENGTH, check=number, default=None)
    given: Mapping[str, Any] = key("set points of the controller, or commands of actuators", rest=True, factory=dict)
    axes: str = "NED/FRD"

    def __post_init__(self) -> None:
        if "axes" in self.given:
            raise ArgumentError("Section [mission] has no key `axes`: put `axes` above all sections of the file.")
        if self.time is not None and np.any(np.diff(np.atleast_1d(self.time)) <= 0):
            raise ArgumentError(
                f"[mission] time must grow from each value to the next, but is {np.asarray(self.time).tolist()} s."
            )
        for name in ("bottom", "clearance"):
            if getattr(self, name) is not None and "bottom" not in self.ends:
                raise ArgumentError(f'[mission] {name} belongs to ends = "bottom": add it, or leave {name} out.')
        if self.way_points is not None:
            return
        for name in ("acceptance", "look_ahead"):
            if getattr(self, name) is not None:
                raise ArgumentError(f"[mission] {name} belongs to `way_points_m`, which are not given.")
        if "last way point" in self.ends:
            raise ArgumentError('[mission] ends = "last way point" needs `way_points`.')

    @cached_property
    def set_points(self) -> dict[str, SetPoint]:
        """The set points and commands by name, in NED/FRD; raises ArgumentError.

        Depths, altitudes, `north` and `east` have the same meaning in either axes.
        """
        found: dict[str, SetPoint] = {}
        for name_in_file, value in self.given.items():
            _, name, unit, factor = loose(name_in_file)
            if name in found:
                raise ArgumentError(
                    f"Section [mission] gives `{name}` twice: once as `{name_in_file}`, once in another unit."
                )
            numbers = _numbers(value, f"[mission] {name_in_file}")
            found[name] = SetPoint(name_in_file, unit, np.asarray(factor * numbers))
        return found if self.axes == "NED/FRD" else _turned(found)

    @cached_property
    def points(self) -> Array:
        """The way points (k, 3): north, east, depth, m; empty without way points."""
        given = np.zeros((0, 3)) if self.way_points is None else self.way_points
        if given.ndim != 2 or given.shape[1] != 3:
            names = "[north, east, depth]" if self.axes == "NED/FRD" else "[east, north, up]"
            raise ArgumentError(f"[mission] way_points_m must hold {names} of each point, but is {given.tolist()!r}.")
        if self.axes == "NED/FRD":
            return given
        from coadjoint_vehicles.axes import space_vector

        return space_vector(given, "ENU/FLU")

    def inputs(self, units: Mapping[str, str], located: Callable[[str], Path]) -> Table:
        """The set points and commands by name: co.Held or co.Linear over `time`, or numbers that stay.

        units: of the inputs of controller and actuators, by name. located: where `file` is. Raises ArgumentError for
        other names.
        """
        import coadjoint as co

        found: Table = {}
        if self.file:
            from coadjoint_vehicles.logs.inputs import inputs_from_csv

            found |= inputs_from_csv(located(self.file), between=cast(Any, self.between))
        time = None if self.time is None else np.atleast_1d(self.time)
        signal = co.Held if self.between == "held" else co.Linear
        for name, point in self.set_points.items():
            values = point.values
            if np.ndim(values) == 0 or (time is None and name not in SCALARS):
                found[name] = values
            elif time is None:
                raise ArgumentError(
                    f"[mission] {name} has {len(values)} values, so that it needs `time_s`, when each begins."
                )
            elif len(values) != len(time):
                raise ArgumentError(
                    f"[mission] {name} must be one number, or a value for each of {len(time)} times, but has "
                    f"{len(values)}."
                )
            else:
                found[name] = signal(time, values)
            if units.get(name) == "rad":
                _require_angles(name, values)
        for name in found:
            if name not in units:
                if name in ("altitude", "pitch") and "depth" in units:
                    bottom = " and bottom_m, the depth of the bottom" if name == "altitude" else ""
                    raise ArgumentError(
                        f"Section [mission] gives `{name}`, which the controller takes in place of `depth` with "
                        f'[controller] vertical = "{name}"{bottom}.'
                    )
                known = [*units, *(name for name, one in keys(self).items() if not one.rest)]
                raise ArgumentError(unknown(f"set point `{name}`", "Section [mission]", name, known))
        for name, point in self.set_points.items():
            if point.unit:
                require_unit("[mission]", point.key, name, point.unit, units[name])
        return found

    def following(self, controller: Any, start: PyTree) -> Any:
        """The controller as the helm of one that follows the way points, from where the vehicle starts.

        start: (3,) m, north, east, depth. Without way points, returns `controller`. Raises ArgumentError for way points
        without a controller.
        """
        if self.way_points is None:
            return controller
        if controller is None:
            raise ArgumentError(
                '[mission] way_points_m need a controller at the helm, but [controller] has kind = "none".'
            )
        from coadjoint_vehicles.controllers.line_of_sight import LineOfSight

        points = self.points
        if np.linalg.norm(points[0, :2] - np.asarray(start)[:2]) > 0:
            points = np.concatenate([np.asarray(start, dtype=float)[None], points])
        more = {name: getattr(self, name) for name in ("acceptance", "look_ahead")}
        more = {name: value for name, value in more.items() if value is not None}
        return LineOfSight(way_points=points, helm=controller, period=controller.period, delay=controller.delay, **more)

    def require_start_before_end(self, start: PyTree, members: int) -> None:
        """Raise ArgumentError where a mission that ends at the surface or the bottom starts beyond it.

        start: (3,) m, or one for each member.
        """
        if self.ends and members > 1:
            raise ArgumentError("[mission] ends would end each of the members at its own time: leave it out.")
        depth = np.atleast_2d(np.asarray(getattr(start, "values", start), dtype=float))[:, 2]
        if "surface" in self.ends and np.min(depth) < 0:
            raise ArgumentError(f'[mission] ends at the "surface", but [initial] is {-np.min(depth):g} m above it.')
        if self.bottom is not None and np.max(depth) >= self._lowest:
            raise ArgumentError(
                f'[mission] ends at the "bottom", at a depth of {self._lowest:g} m, but [initial] is at '
                f"{np.max(depth):g} m."
            )

    def reached(self, final: PyTree) -> str:
        """Which of the ends ended it. final: (3,) m, where it ended."""
        gaps = {"surface": abs(final[2])}
        if self.bottom is not None:
            gaps["bottom"] = abs(self._lowest - final[2])
        near = {end: float(gaps[end]) if end in gaps else 1e-3 for end in self.ends}
        return min(near, key=near.__getitem__)

    def until(self, grid: Bottom | None, arrived: object = None) -> Any:
        """The event that ends the mission before its time, None without one; raises ArgumentError.

        grid: that of [water.bottom]. arrived: the event that the last way point is reached, where there are way points.
        """
        if not self.ends:
            return None
        from coadjoint_vehicles.water import surface_bottom

        events = []
        for end in self.ends:
            if end == "surface":
                events.append(surface_bottom.at_surface())
            elif end == "bottom":
                events.append(surface_bottom.at_bottom(self._bottom(grid), self.clearance or 0.0))
            else:
                events.append(arrived)
        return events[0] if len(events) == 1 else surface_bottom.first_of(*events)

    @property
    def _lowest(self) -> float:
        """The depth at which it ends, m."""
        return (self.bottom or 0.0) - (self.clearance or 0.0)

    def _bottom(self, grid: Bottom | None) -> Bottom | float:
        """The bottom that it ends at: a depth in m, or a grid; raises ArgumentError."""
        if grid is None and self.bottom is not None:
            return self.bottom
        if grid is not None and self.bottom is None:
            return grid
        what = "both have one" if grid is not None else "there is none"
        raise ArgumentError(f'[mission] ends = "bottom" needs `bottom`, its depth in m, or [water.bottom], but {what}.')


def _turned(given: dict[str, SetPoint]) -> dict[str, SetPoint]:
    """Set points of a file in ENU/FLU in NED/FRD: heading = π/2 − yaw, and the pitch has the other sign."""
    from coadjoint_vehicles.axes import rotation

    if "heading" in given:
        raise ArgumentError("[mission] heading belongs to NED/FRD: give `yaw`, from east to the left, in ENU/FLU.")
    found = dict(given)
    if "yaw" in found:
        yaw = found.pop("yaw")
        found["heading"] = yaw._replace(values=np.asarray(np.pi / 2 - yaw.values))
    if "pitch" in found:
        found["pitch"] = found["pitch"]._replace(values=np.asarray(-found["pitch"].values))
    if "attitude" in found:
        found["attitude"] = found["attitude"]._replace(values=rotation(found["attitude"].values, "ENU/FLU"))
    return found


def require_unit(where: str, name_in_file: str, name: str, unit: str, wanted: str) -> None:
    """Raise ArgumentError unless the dimension of `unit`, as of `inside`, is that of `wanted`."""
    try:
        if unit != wanted:
            factor_to(dimension_of(wanted), unit, name_in_file)
    except ArgumentError:
        raise ArgumentError(f"{where} `{name}` measures {wanted}, but `{name_in_file}` is in {unit}.") from None


def _require_angles(name: str, values: np.ndarray) -> None:
    from coadjoint.models.quantities import angles

    try:
        angles(values, name)
    except ArgumentError as error:
        raise ArgumentError(f"[mission] {str(error).removeprefix('Argument ')}") from error


def arrival(controller: Any) -> Any:
    """The event that a way-point controller reaches the last way point, within its acceptance or abreast of it."""
    import jax.numpy as jnp

    from coadjoint_vehicles.controllers.line_of_sight import leg

    points, acceptance = np.asarray(controller.way_points), float(controller.acceptance)
    last = len(points) - 2

    def last_way_point(state: PyTree) -> Array:
        here = leg(state.q, jnp.asarray(points[-2]), jnp.asarray(points[-1]))
        off = state.q[:2] - points[-1, :2]
        left = jnp.minimum(jnp.sqrt(off @ off + 1e-300) - acceptance, here.length - here.along)
        return jnp.where(state.internal.controller.value.memory.leg < last, acceptance + 1.0, left)

    return last_way_point


def require_to_go(controller: Any, start: PyTree) -> None:
    """Raise ArgumentError where a way-point controller takes all way points as reached from its start, (3,) m."""
    from coadjoint.extending import tabulate
    from coadjoint_vehicles.controllers.line_of_sight import arrived, leg

    def passed(here: PyTree, a: PyTree, b: PyTree) -> PyTree:
        return arrived(here, leg(here, a, b), b, controller.acceptance)

    here, points = np.asarray(start), np.asarray(controller.way_points)
    reached = tabulate(passed, here, *points[:2])  # XLA would compile each operation
    if all(reached(here, a, b) for a, b in pairwise(points)):
        raise ArgumentError(
            f'[mission] ends at the "last way point", but each way point counts as reached from [initial], within '
            f"{float(controller.acceptance):g} m: give a smaller acceptance_radius_m, or way points further off."
        )
