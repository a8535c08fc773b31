"""A vehicle as data: its body, its added mass and its parts, each number with where it is from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import wraps
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint import units as u
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import traced
from coadjoint.models.quantities import positive, positive_definite, positive_semidefinite
from coadjoint.overview import NumberRow, Overview, WithOverview, listed
from coadjoint.sections import keys
from coadjoint.spaces import Named
from coadjoint_vehicles.model.controller import Controller
from coadjoint_vehicles.parts.measured import Measured, check_fields, measured, not_negative, place
from coadjoint_vehicles.parts.part import Part
from coadjoint_vehicles.sensors.sensor import Sensor, different


class Quantity(NamedTuple):
    """A number with its unit, the key of its source, and a note.

    uncertainty: its standard deviation, a share such as "5 %" or numbers in SI units; None if unknown.
    """

    value: Any
    unit: str = ""
    source: str = ""
    note: str = ""
    uncertainty: Any = None


def _six_semidefinite(value: object, name: str) -> PyTree:
    return positive_semidefinite(value, name, size=6)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Vehicle(WithOverview):
    """An underwater vehicle about a body origin O fixed anywhere in it; body axes forward, starboard, down; SI units.

    mass: m, kg. inertia: I_c of the bare body about its mass centre, (3, 3) or its diagonal, kg m². added_mass: M_A
    about O, (6, 6) or its diagonal, order surge, sway, heave, roll, pitch, yaw. center_of_mass, center_of_buoyancy:
    from O, (3,) m. volume: m³, or in its place buoyancy: B, N; by default the volume of m in water of `fluid_density`
    (kg/m³): neutrally buoyant. length,
    diameter, or width and height of a hull that is not round: m. parts: their names are different. sensors: theirs,
    too. controller: the one that it is shipped with.
    provenance: Quantity by key, such as "body.mass" or "rudder.area". sources: a citation by the key of a source.
    licence: of the file, by its SPDX identifier; licences: that of each source. Raises ArgumentError for impossible
    values.
    """

    name: str
    description: str = ""
    note: str = ""
    mass: Measured = measured(u.MASS, positive)
    inertia: Measured = measured(u.INERTIA, positive_definite)
    added_mass: Measured = measured(None, _six_semidefinite)
    center_of_mass: Measured = place(default=(0.0, 0.0, 0.0))
    center_of_buoyancy: Measured = place(default=(0.0, 0.0, 0.0))
    volume: Measured = measured(u.VOLUME, not_negative, default=None)
    gravity: Measured = measured(u.ACCELERATION, not_negative, default=9.81)
    fluid_density: Measured = measured(u.DENSITY, positive, default=1026.0)
    length: Measured = measured(u.LENGTH, positive, default=None)
    diameter: Measured = measured(u.LENGTH, positive, default=None)
    width: Measured = measured(u.LENGTH, positive, default=None)
    height: Measured = measured(u.LENGTH, positive, default=None)
    parts: tuple[Part, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    controller: Controller | None = None
    provenance: Mapping[str, Quantity] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)
    licence: str = ""
    licences: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "parts", _different(self.parts))
        object.__setattr__(self, "sensors", different(self.sensors))
        if self.volume is None:
            object.__setattr__(self, "volume", self.mass / self.fluid_density)
        _require_inside(self)

    if TYPE_CHECKING:
        buoyancy: Measured = measured(u.FORCE, positive, default=None)
    else:

        @property
        def buoyancy(self) -> PyTree:
            """B = ρ V g, N."""
            return self.fluid_density * self.volume * self.gravity

    def _overview(self) -> Overview:
        facts = {
            "is": self.description,
            "parts": listed(part.name for part in self.parts),
            "commanded": listed(part.name for part in self.commanded),
            "sensors": listed(one.name for one in self.sensors),
            "controller": "" if self.controller is None else type(self.controller).__name__,
            "sources": len(self.sources) or "",
        }
        given = {name: one.dimension for name, one in keys(self).items() if getattr(self, name) is not None}
        units = {name: "" if kind is None else kind.si for name, kind in given.items()}
        numbers = tuple(NumberRow(name, getattr(self, name), unit) for name, unit in units.items())
        return Overview(f"Vehicle {self.name}", facts, numbers, "number")

    def part(self, name: str) -> Part:
        """The part of this name; raises ArgumentError."""
        parts = {part.name: part for part in self.parts}
        return parts[checks.known(name, parts, "part", f"The vehicle `{self.name}`")]

    def sensor(self, name: str) -> Sensor:
        """The sensor of this name; raises ArgumentError."""
        sensors = {one.name: one for one in self.sensors}
        return sensors[checks.known(name, sensors, "sensor", f"The vehicle `{self.name}`")]

    @property
    def commanded(self) -> tuple[Part, ...]:
        """The parts that a controller may set."""
        return tuple(part for part in self.parts if part.command is not None)


def _floated(init: Callable[..., None]) -> Callable[..., None]:
    """The constructor of a vehicle that takes `buoyancy` in the place of `volume`: V = B/(ρ g)."""
    usual = {one.name: one.default for one in fields(Vehicle)}

    @wraps(init)
    def made(self: Vehicle, *, buoyancy: object = None, **given: PyTree) -> None:
        if buoyancy is not None:
            if given.get("volume") is not None:
                raise ArgumentError("A vehicle takes `volume` or `buoyancy`: leave one of them out.")
            density, gravity = (given.get(name, usual[name]) for name in ("fluid_density", "gravity"))
            if not traced(gravity) and np.size(gravity) == 1 and gravity == 0:
                raise ArgumentError("Argument `buoyancy` is in N, but gravity is 0: give `volume`.")
            given["volume"] = positive(buoyancy, "buoyancy") / (density * gravity)
        init(self, **given)

    known = signature(init)
    extra = Parameter("buoyancy", Parameter.KEYWORD_ONLY, default=None)
    made.__signature__ = known.replace(parameters=[*known.parameters.values(), extra])  # pyright: ignore[reportAttributeAccessIssue, reportFunctionMemberAccess]
    return made


Vehicle.__init__ = _floated(Vehicle.__init__)

BODY = ("mass", "inertia", "center_of_mass", "center_of_buoyancy", "volume", "gravity", "fluid_density", "added_mass")
"""The numbers of the body, by their names among the parameters of a craft."""
FAR = 100.0
"""Sizes of a vehicle beyond which no point of it can be."""


def _require_inside(vehicle: Vehicle) -> None:
    """Raise ArgumentError for centres and parts that are far beyond the hull."""
    places = {name: getattr(vehicle, name) for name in ("center_of_mass", "center_of_buoyancy")}
    places |= {f"position` of the {part.title}": getattr(part, "position", None) for part in vehicle.parts}
    places |= {f"position` of the {one.title}": one.position for one in vehicle.sensors}
    if traced(places, vehicle.length, vehicle.volume):
        return
    size = float(2 * np.cbrt(vehicle.volume) if vehicle.length is None else vehicle.length)
    for name, where in places.items():
        distance = 0.0 if where is None else float(np.linalg.norm(where))
        if distance > FAR * size > 0:
            raise ArgumentError(
                f"Argument `{name}` must be a point of the vehicle, but is {distance:.3g} m from the origin of one of "
                f"{size:.3g} m: check its unit."
            )


RESERVED = (*BODY, "controller", "water", "shear", "memory", "time", "faults", "inputs", "sample", "release")
"""Words that are taken: no part may have them as its name."""


def _different(parts: PyTree) -> tuple[Part, ...]:
    found = tuple(parts)
    names = set()
    for part in found:
        checks.instance(part, "Each of `parts`", Part, "a part such as Fin or Damping")
        if part.name in RESERVED or hasattr(Named, part.name):
            raise ArgumentError(f"The name `{part.name}` is taken: call the part something else.")
        if part.name.startswith(("controller_", "water_")):
            raise ArgumentError(
                f"The name `{part.name}` begins like the records of controller and water: call the part something else."
            )
        if part.name in names:
            raise ArgumentError(f"Two parts are named `{part.name}`: give each its own name.")
        names.add(part.name)
    return found
