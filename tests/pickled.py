"""Objects of public classes, with functions of this module: what can leave the process."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.audit.shipped import SHIPPED
from coadjoint.manifest import Manifest
from coadjoint.models import catalogue
from coadjoint.models.hopf import fibration
from coadjoint.spaces.named import Named
from coadjoint_vehicles import controllers, environments, parts, sensors, serving, water
from coadjoint_vehicles.missions.example import example
from systems import GROUPS, MAPS, WORLDS

PACKAGES = (
    "", "control", "difference_maps", "errors", "estimation", "groups", "identification", "mechanics", "methods",
    "models", "simulation", "spaces", "stability", "sweeps", "theory", "vehicles",
    *(f"vehicles.{name}" for name in (
        "controllers", "environments", "importing", "missions", "model", "parts", "readings", "sensors", "serving",
        "trim", "water",
    )),
)  # fmt: skip


def public() -> dict[str, type]:
    """All public classes that are no abstract bases, by their names."""
    found: dict[str, type] = {}
    for package in PACKAGES:
        name = f"coadjoint.{package}".rstrip(".")
        module = importlib.import_module(name)
        for word in module.__all__:
            one = getattr(module, word)
            if inspect.isclass(one) and one.__module__.startswith("coadjoint") and one not in found.values():
                found[f"{name}.{word}"] = one
    return {name: one for name, one in found.items() if not inspect.isabstract(one)}


def lagrangian(xi, p):
    return 0.5 * xi @ p.inertia @ xi


def drag(motion, p):
    return co.Force(torque=-0.1 * motion.xi)


def turned(g, x):
    return g @ x


def spin(state):
    return state.mu[2]


def one_of(state, p):
    return state.mu[2]


def sine(t):
    return jnp.sin(t)


def flow(position, t):
    return jnp.zeros(3)


def form(a):
    return jnp.zeros((3, 2))


def increment(a, b):
    return jnp.eye(3)


def hover(feedback, p):
    return {}


def system() -> co.System:
    return co.System(
        co.SO3(), lagrangian, parameters={"inertia": np.diag([1.0, 2.0, 3.0])}, forces=drag, quantities={"spin": spin}
    )


def cheap() -> dict[str, Callable[[], Any]]:
    """How objects are made that need no step."""
    remus = vehicles.load("remus_100")
    top = system()
    start = top.state(xi=[0.1, 1.0, 0.1])
    return {
        "systems": lambda: [GROUPS, MAPS, WORLDS, dict(catalogue), top, start],
        "methods": lambda: [one.make(co.Cayley()) for one in SHIPPED],
        "motions": lambda: [top.motion_at(start), top.motion(start.xi, start.n, start.nu, start.a, 0.0)],
        "signals": lambda: [co.Held([0, 1], [1, 2]), co.Linear([0, 1], [1, 2]), co.mechanics.Signal(sine),
            co.Event(spin), co.Output(every=1, what=spin)],
        "values": lambda: [co.Parameters(a=1.0), co.Force(np.zeros(3), np.zeros(0)), co.mechanics.Course(1.0)],
        "groups": lambda: [co.Power(co.SO3(), 3), co.spaces.RelativePoses(((0, 1),)), co.spaces.GroupItself()],
        "spaces": lambda: [co.spaces.ByInverse(co.Defining()), co.spaces.Links(co.Defining())],
        "spline": lambda: co.groups.Spline(co.SO3(), np.arange(3.0), np.stack([np.eye(3)] * 3)),
        "claims": lambda: co.Midpoint().claims,
        "constraints": lambda: [co.Holonomic(spin), co.Nonholonomic(form)],
        "bundles": lambda: [co.mechanics.Connection(co.SO3(), 2, form), co.mechanics.DiscreteConnection(co.SO3(), 2,
            increment), fibration(), fibration().sections],
        "noether": lambda: co.mechanics.KelvinNoether(np.eye(3)),
        "vehicles": lambda: [(one, one.parts, one.sensors, one.controller) for one in map(vehicles.load, LOADED)],
        "craft": lambda: [craft_of(remus), vehicles.Craft(remus, controller=hover)],
        "fault": lambda: vehicles.model.Fault("rudder", 0.0, time=1.0),
        "tasks": lambda: [getattr(environments, name)() for name in TASKS],
        "ends": lambda: environments.End(spin),
        "ship": lambda: list(vehicles.load("kvlcc2").parts),
        "payload": lambda: parts.Payload("load", mass=1.0, position=(0, 0, 0)),
        "function": lambda: controllers.FunctionController(function=hover),
        "controllers": lambda: [
            getattr(controllers, name)() for name in ("Attitude", "Cruise", "Hover", "Pose", "Trial")
        ],
        "manoeuvre": lambda: controllers.Manoeuvre(),
        "line": lambda: controllers.LineOfSight(way_points=[[0, 0, 1], [9, 9, 1]]),
        "sawtooth": lambda: controllers.Sawtooth(volume=1e-4, pitch=0.3),
        "sensors": lambda: [getattr(sensors, name)(name=name.lower(), rate=1.0) for name in SENSORS],
        "beacon": lambda: sensors.Usbl(name="usbl", rate=1.0, beacon=(0, 0, 0)),
        "noise": lambda: sensors.Noise(sensors.Depth(name="depth", rate=1.0), seed=1),
        "kinematics": lambda: sensors.Kinematics((0, 0, 0), np.eye(3)),
        **{f"water {name}": made for name, made in WATER.items()},
        **{f"{package}.{name}": partial(_filled, package, name) for package, names in PLAIN.items() for name in names},
        "drifts": lambda: [co.estimation.GaussMarkov(0.1, 9.0), co.estimation.RandomWalk(0.1)],
        "measurement": lambda: co.estimation.Measurement(spin, 1.0),
        "strapdown": lambda: co.estimation.StrapdownProcess(),
        "log": lambda: co.identification.Log(np.arange(3.0), {"a": np.arange(3.0)}),
        "equations": lambda: co.theory.Equations((_filled("theory", "Residual"),)),
        "shadow": lambda: co.theory.ShadowEnergy(np.zeros(3), np.ones(3)),
        "action": lambda: co.spaces.Action(turned, dim=3),
        "theory": lambda: [
            co.theory.ContinuousLagrangian(co.SO3(), kinetic), co.theory.UnreducedLagrangian(co.SO3(), unreduced),
            co.theory.SemidirectLagrangian(top), co.theory.PoissonLagrangian(co.SO3(), co.Defining(), kinetic),
        ],
        "errors": lambda: [getattr(co.errors, name)("It is wrong.") for name in co.errors.__all__],
        "sweep": lambda: co.sweeps.SweepResults(Manifest(Path("nowhere")), {"members": 3}),
        "motor": lambda: serving.Motor(1, 1),
        "lockstep": lambda: serving.Lockstep(made_for, vehicles.load(LOADED[1]).parts[-1], ()),
        "search": lambda: co.stability.Search(top, start),
        "flight": lambda: vehicles.trim.SteadyFlight(remus),
        "problem": lambda: problem(),
        "bounds": lambda: co.control.Bounds(one_of, 0.0, soft=co.control.Penalty(1.0)),
        "phases": lambda: co.control.Phases({"a": problem(), "b": problem()}, keep="momentum"),
        "composition": lambda: co.methods.Composition(co.Midpoint(), (1.0,)),
        "wing": lambda: parts.Airfoil("wing", (0, 0, 0), (1, 0, 0), (0, 0, -1), area=0.1, lift_slope=3.0, stall=0.3),
        "masses": lambda: [
            parts.Ballast("b", position=(0, 0, 0), low=0.0, high=1.0, rate=0.1),
            parts.MovingMass("m", mass=1.0, position=(0, 0, 0), axis=(1, 0, 0), low=-1.0, high=1.0, rate=0.1),
        ],
        "imported": lambda: vehicles.importing.Imported(remus, "", vehicles.importing.Report()),
    }  # fmt: skip


LOADED = ("remus_100", "bluerov2_heavy_von_benzon", "lrauv_raanan", "ellipsoid", "rexrov", "slocum_graver")
TASKS = ("HoldStation", "FollowPath", "Dock", "CrossCurrent")
SENSORS = ("Ahrs", "Altimeter", "Compass", "Depth", "Dvl", "Gps", "Imu")
WATER: dict[str, Callable[[], Any]] = {
    "uniform": lambda: water.UniformWater((0.1, 0, 0)),
    "density": lambda: [water.LinearDensity(1020, 0.1), water.ExponentialDensity(1020, 1030, 100)],
    "densities": lambda: water.DensityTable([0, 1], [1020, 1021]),
    "field": lambda: water.CurrentField(flow),
    "time": lambda: water.TimeCurrent(flow_of_time),
    "profiles": lambda: [water.LinearProfile(), water.PowerLaw(50.0), water.Logarithmic(50.0, 0.01)],
    "bottom": lambda: water.Bottom([0, 1], [0, 1], np.ones((2, 2))),
    "shear": lambda: water.LinearShear((1, 0, 0), (0.1, 0, 0)),
    "sheared": lambda: water.Sheared((1, 0, 0), water.LinearProfile()),
    "random": lambda: water.GaussMarkovCurrent((0.1, 0.1, 0.0), 9.0),
    "sea": lambda: water.Sea(a=water.UniformWater((0.1, 0, 0))),
    "table": lambda: water.CurrentTable(np.zeros((2, 3)), times=[0, 1]),
    "tide": lambda: water.TidalCurrent(["M2"], [[0.1, 0, 0]]),
}
PLAIN = {
    "estimation": ("Consistency", "InertialState", "Innovation", "Filtered"),
    "theory": ("BundleCurve", "Configuration", "Instant", "Link", "Momenta", "MomentumEquation", "MomentumMaps",
               "PhaseVariation", "PoissonLink", "Residual", "SemidirectLink", "Transforms", "Variation"),
    "stability": ("Mode", "StepModes", "EnergyCasimir", "Linearisation"),
    "identification": ("Estimate",),
    "vehicles": ("Command", "Feedback", "Flow"),
    "vehicles.model": ("Quantity",),
    "vehicles.parts": ("Passing",),
    "vehicles.sensors": ("Channel", "Errors"),
    "vehicles.serving": ("Inertial", "Reading"),
    "vehicles.importing": ("Report",),
    "vehicles.trim": ("Trim",),
    "control": ("MpcSolution", "End", "Input", "Measured", "Profile", "Sensitivity", "StateEstimate"),
}  # fmt: skip


def kinetic(*arguments):
    return 0.5 * arguments[0] @ arguments[0]


def unreduced(*arguments):
    return 0.0


def flow_of_time(t):
    return jnp.zeros(3)


def made_for(rate):
    return None


def torque(motion, p):
    return co.Force(torque=motion.inputs.torque)


def problem(**more: Any) -> Any:
    """Turn a body by half a radian with little torque."""
    top = co.System(co.SO3(), lagrangian, parameters={"inertia": np.diag([1.0, 2.0, 3.0])}, forces=torque)
    start = top.state(xi=[0.0, 0.0, 0.0])
    return co.control.Problem(
        top,
        start,
        dt=0.1,
        steps=10,
        inputs={"torque": co.control.Input((3,))},
        cost=effort,
        **{"end": co.control.End(xi=[0, 0, 1.0]), **more},
    )


def effort(motion, p):
    return motion.inputs.torque @ motion.inputs.torque


def craft_of(vehicle: Any) -> Any:
    craft = vehicles.Craft(vehicle, controller=vehicle.controller)
    return [craft, craft.system, craft.start(speed=1.0)]


def _filled(package: str, name: str) -> Any:
    """One with a function where one is called for, and with ones elsewhere."""
    kind = getattr(importlib.import_module(f"coadjoint.{package}"), name)
    special: dict[str, Any] = {"function": one_of, "name": "name", "unit": "m", "values": np.ones(3)}
    needed = [
        word
        for word, one in inspect.signature(kind).parameters.items()
        if one.default is one.empty and one.kind is not one.VAR_KEYWORD
    ]
    return kind(**{word: special.get(word, 1.0) for word in needed})


def dear() -> dict[str, Callable[[], Any]]:
    """How objects of runs are made: what steps, simulates, estimates and optimises."""
    top, remus = system(), vehicles.load("remus_100")
    start = top.state(xi=[0.1, 1.0, 0.1])
    craft = vehicles.Craft(remus, controller=remus.controller)
    inputs = {"depth": 5.0, "heading": 0.0, "speed": 1.5}
    begun = craft.start(position=(0, 0, 5), speed=1.5)
    run = co.simulate(craft.system, begun, dt=0.05, duration=1, inputs=inputs, progress=False)
    served = serving.Served(craft, begun, 0.05)
    process = co.estimation.ModelProcess(top, start)
    return {
        "mission": mission,
        "run": lambda: co.simulate(top, start, dt=0.01, duration=0.1, progress=False),
        "ensemble": lambda: co.simulate(
            top, top.state(xi=co.each(np.ones((2, 3)))), dt=0.01, duration=0.1, progress=False
        ),
        "stepper": lambda: co.Stepper(top, start, dt=0.01, observe={"spin": spin}),
        "vehicle": lambda: [run, vehicles.readings.readings(run, seed=1)],
        "served": lambda: [served, serving.Service(served, craft.start)],
        "environment": environment,
        "trim": lambda: co.vehicles.trim.SteadyFlight(remus),
        "filter": lambda: [process, filtering(process, start), saved_filter(filtering(process, start))],
        "regulator": lambda: replace(problem(end=None), cost=co.control.squares(settling), steps=None).regulator(),
        "controller": lambda: problem().controller(period=0.1),
        "estimator": lambda: problem(end=None, measured=SEEN).estimator(0.5),
        "stability": lambda: co.stability.stability(co.stability.steady_motion(top, start)),
        "optimum": lambda: problem().solve(),
    }  # fmt: skip


def spin_of(motion, p):
    return motion.xi[2]


SEEN = {"spin": co.control.Measured(spin_of, np.zeros(11), 0.1)}


def filtering(process: Any, start: Any) -> Any:
    seen = {"spin": co.estimation.Measurement(spin_of, 0.1)}
    return co.estimation.Filter(process, start, measurements=seen, deviations={"g": 0.1, "xi": 0.1})


def saved_filter(one: Any) -> Any:
    with TemporaryDirectory() as folder:
        return co.estimation.load_filter(one.save(Path(folder) / "spin.filter"))


def settling(motion, p):
    return jnp.concatenate([motion.inputs.torque, motion.xi, jnp.ravel(motion.g - jnp.eye(3))])


def mission() -> Any:
    with TemporaryDirectory() as folder:
        file = Path(folder) / "dive.toml"
        file.write_text(example("remus_100"), encoding="utf-8")
        return vehicles.load_mission(file)


def environment() -> Any:
    env = vehicles.environment(LOADED[1], randomise={"mass": "5 %"}, reward=worth)
    env.reset(seed=1)
    return [env, env.simulated.uncertain]


def worth(feedback):
    return -feedback.depth


def instances(made: Iterator[Any]) -> dict[str, Any]:
    """The first object of each public class among these and what they hold, by the name of its class."""
    kinds = {kind: name for name, kind in public().items()}
    found: dict[str, Any] = {}
    pending, seen = [(one, 0) for one in made], []
    while pending:
        value, depth = pending.pop(0)
        if type(value) in kinds:
            found.setdefault(kinds[type(value)], value)
        if depth > 5 or any(value is other for other in seen[-50:]):
            continue
        seen.append(value)
        inner: list[Any] = []
        if isinstance(value, dict):
            inner = list(value.values())
        elif isinstance(value, (list, tuple)):
            inner = list(value)
        elif is_dataclass(value) and not isinstance(value, type):
            inner = [getattr(value, field.name, None) for field in fields(value)]
        elif isinstance(value, (Named, SimpleNamespace)):
            inner = list(value.asdict().values()) if isinstance(value, Named) else list(vars(value).values())
        pending += [(one, depth + 1) for one in inner]
    return found
