"""Whatever is handed in, and whatever a Lagrangian does: a result, or one sentence of this library; nothing else."""

from __future__ import annotations

import pathlib
import warnings
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.mechanics.internal_state import require_internal
from coadjoint.simulation.arguments import with_inputs
from coadjoint.simulation.events import Event, require_event
from coadjoint.simulation.problem import require_quantities
from coadjoint.simulation.trajectory import Trajectory
from paper_vehicle import PARAMETERS, lagrangian, start, system
from strange import RESULTS, VALUES
from systems import generator

VEHICLE = system()
START = start(VEHICLE)
LONGEST = 600
TURN = {"q": [0, 0, 1], "a0": [0, 0, 1], "xi": [0, 0.1, 1]}


def outcome(door: Callable[[Any], Any], value: Any) -> str | None:
    """What is wrong with what a door does with a value; None where it is a result or a sentence."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = door(value)
    except co.errors.CoadjointError as error:
        said = str(error)
        if "\n" in said or not said.endswith((".", "?")) or len(said) > LONGEST:
            return f"no sentence: {said[:300]!r}"
        return None
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:200]}"
    bad = [leaf for leaf in jax.tree.leaves(_numbers(found)) if not np.all(np.isfinite(leaf))]
    return f"a result that is not finite: {bad[0]}" if bad else None


def _numbers(found: Any) -> Any:
    """The numbers of a result."""
    if isinstance(found, (co.State, Trajectory)):
        return [leaf for leaf in jax.tree.leaves(found) if np.asarray(leaf).dtype == float]
    return found.records if hasattr(found, "good_steps") else ()


def mishaps(door: Callable[[Any], Any], values: dict[str, Any]) -> dict[str, str]:
    told = {name: outcome(door, value) for name, value in values.items()}
    return {name: said for name, said in told.items() if said is not None}


def simulated(name: str) -> Callable[[Any], Any]:
    def door(value: Any) -> Any:
        given = {"dt": 0.01, "steps": 2, name: value}
        if name == "duration":
            del given["steps"]
        return co.simulate(VEHICLE, START, **given)

    return door


def made(name: str) -> Callable[[Any], Any]:
    """A system with one strange argument, its start and what is checked before a run."""

    def door(value: Any) -> Any:
        given = {
            "group": co.SO3(),
            "lagrangian": lagrangian,
            "additional": co.Defining(),
            "advected": co.Defining(),
            "parameters": PARAMETERS,
            name: value,
        }
        if name == "hamiltonian":
            del given["lagrangian"]
        found = co.System(given.pop("group"), **given)
        begun = found.state(**TURN)
        found.check(begun)
        return begun

    return door


def on_sphere(value: Any) -> Any:
    flat = co.System(co.SO3(), lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.spaces.Submanifold(value))
    return flat.state(q=[0, 0, 1])


SIMULATED = [
    "dt",
    "duration",
    "steps",
    "method",
    "save_every",
    "monitors",
    "kelvin_noether",
    "inputs",
    "until",
    "events",
]
MADE = ["group", "lagrangian", "additional", "advected", "parameters", "forces", "discrete_lagrangian", "units", "name"]
MADE += ["group_lagrangian", "hamiltonian", "quantities", "internal", "verify"]
ARGUMENTS: dict[str, Callable[[Any], Any]] = {
    **{f"simulate {name}": simulated(name) for name in (*SIMULATED, "progress", "backend")},
    "simulate system": lambda v: co.simulate(v, START, dt=0.01, steps=2),
    "simulate start": lambda v: co.simulate(VEHICLE, v, dt=0.01, steps=2),
    **{
        f"trajectory {name}": lambda v, name=name: co.trajectory(VEHICLE, START, **{"dt": 0.01, "steps": 2, name: v})
        for name in ("dt", "steps", "method", "save_every", "inputs", "backend")
    },
    **{
        f"state {name}": lambda v, name=name: start(VEHICLE, **{name: v})
        for name in ("g", "q", "xi", "qdot", "a0", "t")
    },
    "state inputs": lambda v: VEHICLE.state(**TURN, inputs=v),
    "state internal": lambda v: VEHICLE.state(**TURN, internal=v),
    **{
        f"System {name}": made(name)
        for name in ("group", "lagrangian", "additional", "advected", "parameters", "forces")
    },
    **{
        f"System {name}": made(name)
        for name in ("discrete_lagrangian", "group_lagrangian", "hamiltonian", "quantities")
    },
    **{f"System {name}": made(name) for name in MADE},
    "Parameters": lambda v: co.Parameters(mass=v),
    "replace": lambda v: start(VEHICLE.replace(mass=v)),
    "each": co.each,
    "watching": lambda v: co.simulate(VEHICLE.watching({"x": v}), START, dt=0.01, steps=2),
    "watching all": VEHICLE.watching,
    "driven": VEHICLE.driven,
    **{f"attitude {n}": lambda v, n=n: getattr(co.attitude, n)(v, 0.1, 0.2) for n in ("zxz", "zyx")},
    **{
        f"attitude {n}": getattr(co.attitude, n)
        for n in ("zxz_angles", "zyx_angles", "from_quaternion", "to_quaternion", "from_rotation_vector")
    },
    **{
        f"attitude {n}": lambda v, n=n: getattr(co.attitude, n)(0.1, 0.2, 0.3, v)
        for n in ("zxz_rates", "zyx_rates", "zxz_angular_velocity", "zyx_angular_velocity")
    },
    "attitude quaternion_rates": lambda v: co.attitude.quaternion_rates([1, 0, 0, 0], v),
    "Linear values": lambda v: co.Linear([0.0, 1.0, 2.0], v),
    "Linear times": lambda v: co.Linear(v, [0.0, 1.0, 2.0]),
    "Held values": lambda v: co.Held([0.0, 1.0, 2.0], v),
    "Signal": co.mechanics.Signal,
    **{
        n: getattr(co.groups, n)
        for n in ("SOn", "SLn", "Sp", "Heisenberg", "Translation", "MatrixGroup", "DirectProduct")
    },
    "MatrixGroup constraint": lambda v: co.MatrixGroup(co.SO3().basis, v),
    "SemidirectProduct group": lambda v: co.SemidirectProduct(v, co.Defining()),
    "SemidirectProduct space": lambda v: co.SemidirectProduct(co.SO3(), v),
    **{n: getattr(co.spaces, n) for n in ("Trivial", "Sphere", "GroupItself", "Several")},
    **{n: getattr(co.difference_maps, n) for n in ("Pade", "Squared")},
    "Submanifold": on_sphere,
    "Submanifold inside": lambda v: co.spaces.Submanifold(lambda x: x @ x - 1, v),
    **{n: getattr(co.methods, n) for n in ("Midpoint", "Trapezoidal", "Variational", "GroupVariational")},
    "Midpoint start": lambda v: co.Midpoint(start=v),
    "KelvinNoether": lambda v: co.mechanics.KelvinNoether(v).require_equivariant(VEHICLE, START),
    "KelvinNoether K": lambda v: co.mechanics.KelvinNoether([0, 0, 1], K=v).require_equivariant(VEHICLE, START),
    "KelvinNoether space": lambda v: co.mechanics.KelvinNoether([0, 0, 1], space=v).require_equivariant(VEHICLE, START),
}


@pytest.mark.cases(2)
@pytest.mark.parametrize("door", ARGUMENTS)
def test_a_strange_argument_gives_a_result_or_one_sentence(door):
    assert not mishaps(ARGUMENTS[door], VALUES)


def test_a_strange_store_gives_one_sentence(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pathlib.Path("taken").write_text("a file")
    values = {name: value for name, value in VALUES.items() if not isinstance(value, (str, pathlib.Path))}
    assert not mishaps(simulated("store"), {**values, "a file": "taken", "a file as a path": pathlib.Path("taken")})


def test_masked_entries_are_read_as_values_nowhere():
    hidden = np.ma.masked_array([1.0, 2.0, 3.0], mask=[False, True, False])
    doors = [lambda v: co.Parameters(mass=v), co.each, *(ARGUMENTS[f"state {name}"] for name in ("q", "xi", "a0"))]
    doors += [ARGUMENTS["attitude from_rotation_vector"], lambda v: co.Linear([0.0, 1.0, 2.0], v)]
    for door in doors:
        for value in (hidden, [1.0, np.ma.masked, 3.0]):
            with pytest.raises(co.errors.ArgumentError):
                door(value)


def lagrangian_that(does) -> Any:
    given = co.System(
        co.SO3(),
        lambda xi, n, nu, a, p: does(lagrangian(xi, n, nu, a, p)),
        additional=co.Defining(),
        advected=co.Defining(),
        parameters=PARAMETERS,
    )
    begun = given.state(**TURN)
    given.check(begun)
    return begun


def hamiltonian_that(does) -> Any:
    given = co.System(co.SO3(), hamiltonian=lambda mu: does(0.5 * mu @ (np.array([1.0, 0.5, 0.25]) * mu)))
    begun = given.state(xi=[0.1, 0.2, 0.3])
    given.check(begun)
    return begun


def forces_that(does) -> Any:
    given = system(forces=lambda motion, p: co.Force(torque=does(-0.1 * motion.xi), force=-0.1 * motion.nu))
    given.check(start(given))


def discrete_lagrangian_that(does) -> Any:
    given = co.System(co.SO3(), discrete_lagrangian=lambda xi, h: does(0.5 * h * xi @ xi))
    given.check(given.state(xi=[0.1, 0.2, 0.3]))


def rule_that(does) -> Any:
    given = co.System(
        co.SO3(), lambda xi: 0.5 * xi @ xi, internal=lambda motion, h: {"x": does(motion.internal.x * (1 - h))}
    )
    require_internal(given, given.state(internal={"x": 1.0}), 0.01)


def inputs_that(do) -> Any:
    given = system(forces=lambda motion, p: co.Force(torque=0.0 * motion.xi))
    with_inputs(given, start(given), lambda motion: do(motion.xi))
    with_inputs(given, start(given), co.mechanics.Signal(lambda t: do(jnp.sin(t))))


def quantity_that(does) -> Any:
    watched = VEHICLE.watching({"spin": lambda state: does(state.xi[2])})
    require_quantities(watched, START)


def event_that(does) -> Any:
    require_event(Event(lambda state: does(state.q[2])), "until", START)


def pairing_that(does) -> Any:
    co.mechanics.KelvinNoether([0, 0, 1], K=lambda c, a: does(c)).require_equivariant(VEHICLE, START)


FUNCTIONS = [
    lagrangian_that, hamiltonian_that, forces_that, discrete_lagrangian_that, rule_that, inputs_that, quantity_that,
    event_that, pairing_that,
]  # fmt: skip


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("door", FUNCTIONS, ids=lambda door: door.__name__)
def test_a_strange_function_gives_a_result_or_one_sentence(door):
    assert not mishaps(door, RESULTS)


METHODS = [co.Midpoint(), co.LeftRectangle(co.Exponential()), co.Midpoint(start="velocity")]
RUNS = 300


def random_run(draw: np.random.Generator) -> Callable[[Any], Any]:
    """A run with numbers of all sizes."""

    def wild(*shape: int) -> Any:
        return draw.normal(size=shape) * 10.0 ** draw.uniform(-6, draw.choice([0, 2, 6, 12]))

    given = {"q": wild(3), "xi": wild(3), "qdot": wild(3), "a0": wild(3), "t": float(wild())}
    given = {name: value for name, value in given.items() if name in ("q", "a0") or draw.random() < 0.7}
    changes = {"mass": abs(float(wild())), "buoyancy": float(wild())} if draw.random() < 0.5 else {}
    dt, steps, method = 10.0 ** draw.uniform(-6, 1), int(draw.integers(1, 6)), METHODS[draw.integers(len(METHODS))]

    def door(_: Any) -> Any:
        vehicle = VEHICLE.replace(**changes) if changes else VEHICLE
        return co.simulate(vehicle, vehicle.state(**given), dt=dt, steps=steps, method=method)

    return door


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("part", range(3))
def test_a_run_of_any_numbers_is_finite_or_one_sentence(part):
    told = [outcome(random_run(generator("fuzzed run", part, i)), None) for i in range(RUNS // 3)]
    assert not [said for said in told if said is not None]


def test_there_are_enough_of_them():
    assert len(ARGUMENTS) * len(VALUES) + len(FUNCTIONS) * len(RESULTS) + RUNS >= 2000


def test_a_stepper_needs_no_parameters():
    given = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi)
    stepper = co.Stepper(given, given.state(xi=[0, 0, 1.0]), dt=0.01)
    assert stepper is not None
