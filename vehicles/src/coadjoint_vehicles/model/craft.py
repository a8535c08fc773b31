"""A craft: a vehicle with its controller in its water, as a system on SO(3) × ℝ³."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.groups import SO3
from coadjoint.mechanics import Force, Parameters, State, System
from coadjoint.models.paper_form import UNITS
from coadjoint.overview import NumberRow, Overview, WithOverview, listed
from coadjoint.paths import paths
from coadjoint.spaces import Defining
from coadjoint_vehicles import axes as turned
from coadjoint_vehicles.model.actuators import Rule, starting_actuators
from coadjoint_vehicles.model.changed import require_possible
from coadjoint_vehicles.model.controller import Controller
from coadjoint_vehicles.model.faults import Fault, require_faults
from coadjoint_vehicles.model.function_controller import FunctionController
from coadjoint_vehicles.model.measures import parameter_units
from coadjoint_vehicles.model.start import starting_motion, through_water
from coadjoint_vehicles.model.terms import Lagrangian, Shear, push
from coadjoint_vehicles.model.vehicle import BODY, Vehicle
from coadjoint_vehicles.parts.part import Part
from coadjoint_vehicles.water.water import StillWater, Water


class Craft(WithOverview):
    """A vehicle, its controller and its water.

        craft = Craft(vehicle, controller=controller, water=UniformWater((0.0, 0.2, 0.0)))
        run = co.simulate(craft.system, craft.start(speed=1.5), dt=0.05, duration=300, inputs={"depth": …})

    controller: a Controller, or a function (feedback, p) → {part: command}; without one, inputs of the names of parts
    command them. water: by default still. faults: of actuators, from a time or an event on. Raises ArgumentError for
    anything else.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        controller: Controller | Callable[..., PyTree] | None = None,
        water: Water | None = None,
        faults: Sequence[Fault] = (),
    ):
        checks.instance(vehicle, "vehicle", Vehicle, "a Vehicle")
        if water is not None:
            checks.instance(water, "water", Water, "a Water such as UniformWater((0.0, 0.2, 0.0))")
        if isinstance(controller, type):
            raise ArgumentError(
                f"Argument `controller` is the class {controller.__name__}: give one of them, {controller.__name__}(…)."
            )
        if controller is not None and not isinstance(controller, Controller):
            checks.function(controller, "controller", "a Controller, or a function (feedback, p)")
            controller = FunctionController(function=controller)
        controller = None if controller is None else controller.fitted(vehicle)
        self.vehicle, self.controller, self.water = vehicle, controller, StillWater() if water is None else water
        commanded = {part.name: part for part in vehicle.commanded}
        self.faults = require_faults(faults, commanded)
        self.rule = Rule(vehicle, controller, self.water, self.faults)
        self.parameters = Parameters(**self._nominal)
        """All numbers: the body's own, `p.mass`, and those of each part, `p.rudder.area`, of `water`, `controller`."""

    def _overview(self) -> Overview:
        units = self._units()
        facts = {
            "controller": "" if self.controller is None else type(self.controller).__name__,
            "water": type(self.water).__name__,
            "commands": listed(
                f"{part.name} ({part.command.unit})" for part in self.vehicle.commanded if part.command is not None
            ),
            "faults": len(self.faults) or "",
        }
        given = paths(self.parameters).items()
        return Overview(
            f"Craft {self.vehicle.name}", facts, tuple(NumberRow(name, one, units.get(name, "")) for name, one in given)
        )

    def replace(self, **values: object) -> Craft:
        """A copy with some parameters replaced, each by one or by one of each member.

            craft.replace(mass=32.0, rudder={"area": co.each(areas)})

        Raises ArgumentError for an unknown parameter, and for values that the constructors of body, parts, controller
        or water reject; a lag of 0 means none.
        """
        made = Craft(self.vehicle, controller=self.controller, water=self.water, faults=self.faults)
        made.parameters = self.parameters.replace(**values)
        self._checked(made.parameters.asdict())
        return made

    def _checked(self, found: Mapping[str, PyTree]) -> Mapping[str, PyTree]:
        """Replaced parameters; raises ArgumentError for values that vehicle, parts, controller or water reject."""
        nominal, body = self._nominal, [name for name in BODY if name in found]
        require_possible(self.vehicle, {name: nominal[name] for name in body}, {name: found[name] for name in body})
        for name, owner in self.owners.items():
            if name in found:
                require_possible(owner, nominal[name], found[name], name)
        return found

    @cached_property
    def system(self) -> System:
        """ℓ with advected directions `down` and `north`, a force for each part, and the rule of the internal state."""
        return System(
            SO3(),
            Lagrangian(self.water, self.vehicle.parts),
            additional=Defining(),
            advected={"down": Defining(), "north": Defining()},
            parameters=self.parameters,
            forces=self._forces() or None,
            internal=self.rule if self._remembers else None,
            name=self.vehicle.name,
            units=self._units(),
            checks=self._checked,
        )

    @property
    def _nominal(self) -> dict[str, PyTree]:
        """The numbers that vehicle, water and controller were made with."""
        body = {name: getattr(self.vehicle, name) for name in BODY}
        return {**body, **{name: owner.parameters() for name, owner in self.owners.items()}}

    @property
    def owners(self) -> dict[str, Part | Controller | Water]:
        """The owners of parameters other than the body, by name."""
        controllers = {} if self.controller is None else {"controller": self.controller}
        return {**{part.name: part for part in self.vehicle.parts}, "water": self.water, **controllers}

    def start(
        self,
        *,
        position: PyTree = (0.0, 0.0, 0.0),
        speed: PyTree = None,
        velocity: PyTree = None,
        euler_zyx: PyTree = (0.0, 0.0, 0.0),
        angular_velocity: PyTree = (0.0, 0.0, 0.0),
        actuators: Mapping[str, PyTree] | None = None,
        axes: turned.Axes = "NED/FRD",
        t: float = 0.0,
    ) -> State:
        """The state at a position (3,) m, going ahead at `speed` m/s, or with a body `velocity`, through the water.

        velocity: of O, (3,) m/s, body axes. euler_zyx: yaw, pitch, roll, rad. angular_velocity: ω, (3,) rad/s, body
        axes. actuators: their starting values, by the names of their parts. axes: those of the vectors and angles
        given. Any argument except axes and t may be a co.each.
        Raises ArgumentError for wrong shapes, for actuators that the vehicle does not have, and out of their range.
        """
        p = self.parameters
        internal = self.rule.start(starting_actuators(self.vehicle, actuators, p), t)
        velocity = through_water(speed, velocity)
        begun = starting_motion(self.water, p.water, position, velocity, euler_zyx, angular_velocity, t, axes)
        a0 = {"down": [0, 0, 1], "north": [1, 0, 0]}
        return self.system.state(**begun, a0=a0, t=t, internal=internal or None)

    @property
    def _remembers(self) -> bool:
        return bool(self.vehicle.commanded or self.controller is not None or self.water.start())

    def _forces(self) -> dict[str, Callable[..., Force]]:
        rule = None if self._remembers else self.rule
        found: dict[str, Callable[..., Force]] = {
            part.name: push(part, self.water, rule) for part in self.vehicle.parts
        }
        if not self.water.uniform:
            found["shear"] = Shear(self.water, self.vehicle.parts)
        return found

    def _units(self) -> dict[str, str]:
        commands = {part.name: part.command.unit for part in self.vehicle.commanded if part.command is not None}
        wanted = {} if self.controller is None else self.controller.inputs
        return {
            **parameter_units(self.vehicle, self.parameters, self.owners),
            **UNITS,
            "current": "m/s",
            **{f"inputs_{name}": unit for name, unit in {**commands, **wanted}.items()},
            **{f"internal_{name}": unit for name, unit in commands.items()},
            **{
                f"internal_{part.name}_{k}": u for part in self.vehicle.commanded for k, u in (part.units or {}).items()
            },
            **{f"internal_controller_{name}": "s" for name in ("sample", "release")},
            **{
                f"internal_controller_{when}_{name}": u for when in ("value", "pending") for name, u in commands.items()
            },
        }


def craft_of(system: System) -> Craft:
    """The craft that a system was made by, with the parameters that the system has; raises ArgumentError.

    So `craft_of(vehicle.replace(rudder={"area": 0.02})).start(speed=1.5)` starts the changed vehicle.
    """
    rule = system.internal
    if not isinstance(rule, Rule) or system.parameters is None:
        raise ArgumentError(f"The system `{system.name}` was not made by a Craft with actuators: use system.state(…).")
    made = Craft(rule.vehicle, controller=rule.controller, water=rule.water)
    return made.replace(**system.parameters.asdict())
