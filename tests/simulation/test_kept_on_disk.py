"""Plans, checks and gains kept on disk: to the bit what is worked out anew, and never those of another system."""

from __future__ import annotations

import dataclasses
import functools
import subprocess
import sys
import types

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.run import native
from coadjoint.mechanics.traced_once import Traced
from coadjoint.models import catalogue
from coadjoint.simulation import setup_cache
from coadjoint.simulation.configuration import fingerprint
from coadjoint.simulation.problem import SimulationProblem
from coadjoint.simulation.steppers import engines
from coadjoint_vehicles.controllers.attitude import Attitude
from coadjoint_vehicles.files.registry import load_vehicle
from coadjoint_vehicles.remus import remus_100, remus_start

DRAG, TABLE = 0.1, np.full(3, 0.1)
library = types.SimpleNamespace(drag=lambda xi: -0.1 * xi)


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setenv("COADJOINT_CACHE", str(folder))
    return folder


def forget():
    """Be like another process."""
    for memory in (setup_cache._known, setup_cache._verdicts, native._kernels, engines._engines):
        memory.clear()


def found_in(folder, starts=False):
    """The names of what is kept of systems, beside machine code, the key, and facts on groups, maps and spaces.

    starts: with the numbers of states, and checks that an energy is a number.
    """
    others = ("outside", "misfit", "bend", "rows", *(() if starts else ("start", "momenta", "numbers")))
    begins = {path.name: path.read_bytes()[32:48] for path in folder.glob("*.code")}
    aside = tuple(f'{{"{name}"'.encode() for name in others)
    return {name for name, text in begins.items() if text.startswith(b"{") and not text.startswith(aside)}


def again(run, folder):
    """What `run` returns in a process that finds everything."""
    before = found_in(folder)
    forget()
    found = run()
    assert found_in(folder) == before
    return found


def anew(run, monkeypatch):
    """What `run` returns where nothing is kept."""
    with monkeypatch.context() as patch:
        patch.setenv("COADJOINT_CACHE", "")
        forget()
        return run()


def same(one, other):
    leaves, others = jax.tree.leaves(one), jax.tree.leaves(other)
    return len(leaves) == len(others) and all(map(np.array_equal, leaves, others))


remus = functools.cache(lambda: remus_100(current=(0.0, 0.2, 0.0)))


def swum():
    legs, vehicle = [0.0, 1.0], remus()
    wanted = {"depth": co.Held(legs, [0.5, 2.0]), "heading": 0.3, "speed": 1.5}
    start = remus_start(vehicle, speed=1.5, revolutions=15.0)
    run = co.simulate(vehicle, start, dt=0.05, duration=3.0, inputs=wanted, accuracy=False)
    return run.records, run.monitors, run.extrema


def spun(events=None):
    top = catalogue["heavy_top"].make()
    run = co.simulate(top, catalogue["heavy_top"].start(top), dt=0.01, steps=40, events=events, accuracy=False)
    return run.records, run.monitors, run.extrema


def many():
    top = catalogue["heavy_top"].make()
    start = catalogue["heavy_top"].start(top)
    fleet = co.simulate(top.replace(mass=co.each([1.0, 2.0, 3.0])), start, dt=0.01, steps=40, accuracy=False)
    return fleet.records, fleet.monitors, fleet.extrema


def stepped():
    top = catalogue["heavy_top"].make()
    start = catalogue["heavy_top"].start(top)
    stepper = co.Stepper(top, start, dt=0.01, observe={"mu": lambda state: state.mu})
    stepper.step(n=40)
    pair = co.Stepper(top, start, dt=0.01, members=2)
    pair.step(n=40)
    return stepper.state, stepper.observed, pair.state


@pytest.mark.long
@pytest.mark.parametrize("run", [spun, *(pytest.param(run, marks=pytest.mark.long) for run in (swum, many, stepped))])
def test_what_is_found_gives_the_same_to_the_bit(run, cache, monkeypatch):
    plain = anew(run, monkeypatch)
    forget()
    first = run()
    assert found_in(cache)
    assert same(first, plain)
    assert same(again(run, cache), plain)


def test_functions_of_states_of_somebody_else_are_not_kept(cache):
    forget()
    spun({"level": lambda state: state.a[2]})
    assert not found_in(cache)


# Functions of somebody else.


def helper(xi):
    return -DRAG * xi


def by_helper(motion):
    return co.Force(torque=helper(motion.xi))


def by_global(motion):
    return co.Force(torque=-DRAG * motion.xi)


def by_table(motion):
    return co.Force(torque=-TABLE * motion.xi)


def by_library(motion):
    return co.Force(torque=library.drag(motion.xi))


def by_default(motion, *, strength=0.1):
    return co.Force(torque=-strength * motion.xi)


def by_closure():
    strength = 0.1

    def forces(motion):
        return co.Force(torque=-strength * motion.xi)

    return forces


CLOSURE = by_closure()


def body(motion):
    return co.Force(torque=-0.1 * motion.xi)


def other_body(motion):
    return co.Force(torque=-0.7 * motion.xi)


CHANGES = {
    "body": (body, lambda patch: patch.setattr(body, "__code__", other_body.__code__)),
    "closure": (CLOSURE, lambda patch: patch.setattr(CLOSURE.__closure__[0], "cell_contents", 0.7)),
    "global": (by_global, lambda patch: patch.setitem(globals(), "DRAG", 0.7)),
    "global array": (by_table, lambda patch: patch.setitem(globals(), "TABLE", np.full(3, 0.7))),
    "global array in place": (by_table, lambda patch: TABLE.fill(0.7)),
    "default": (by_default, lambda patch: patch.setitem(by_default.__kwdefaults__, "strength", 0.7)),
    "global of a helper": (by_helper, lambda patch: patch.setitem(globals(), "DRAG", 0.7)),
    "helper": (by_helper, lambda patch: patch.setitem(globals(), "helper", lambda xi: -0.7 * xi)),
    "function of a library": (by_library, lambda patch: patch.setattr(library, "drag", lambda xi: -0.7 * xi)),
}


def driven(forces):
    def lagrangian(xi):
        return 0.5 * xi @ (jnp.array([1.0, 2.0, 3.0]) * xi)

    system = co.System(co.SO3(), lagrangian, forces=forces)
    start = system.state(xi=[0.3, 1.0, -0.2])
    return co.simulate(system, start, dt=0.05, steps=20, monitors=False, accuracy=False).records


@functools.cache
def expected(forces):
    with pytest.MonkeyPatch.context() as patch:
        return anew(lambda: driven(forces), patch)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("change", CHANGES)
def test_another_function_is_never_taken_for_what_was_kept(change, cache, monkeypatch):
    forces, mutate = CHANGES[change]
    forget()
    assert same(driven(forces), expected(CLOSURE))
    assert same(again(lambda: driven(forces), cache), expected(CLOSURE))
    before = found_in(cache)
    with monkeypatch.context() as patch:
        mutate(patch)
        forget()
        second = driven(forces)
    TABLE[:] = 0.1
    assert len(found_in(cache)) > len(before)
    assert same(second, expected(other_body))
    assert same(again(lambda: driven(forces), cache), expected(CLOSURE))


@pytest.mark.long
def test_a_fingerprint_that_is_found_is_that_which_is_traced(cache, monkeypatch):
    def marks():
        top = catalogue["heavy_top"].make()
        start = catalogue["heavy_top"].start(top)
        run = SimulationProblem(top, start, co.Midpoint(), 0.01, 10, monitors=True).set_up()
        return fingerprint(run.plan, run.position.state)

    forget()
    traced = marks()
    assert again(marks, cache) == traced == anew(marks, monkeypatch)


@pytest.mark.long
def test_the_fingerprint_does_not_depend_on_what_its_kernel_traced(cache, monkeypatch):
    monkeypatch.setenv("COADJOINT_CACHE", "")
    remus = co.vehicles.load("remus_100")
    craft = co.vehicles.Craft(remus, controller=remus.controller)
    start = craft.start(position=(0, 0, 2), speed=1.5)
    wanted = {"depth": 10.0, "heading": 0.0, "speed": 1.5}
    traces = Traced()
    run = SimulationProblem(craft.system, start, co.Midpoint(), 0.05, 10, monitors=True, inputs=wanted).set_up(traces)
    assert traces
    assert fingerprint(run.plan, run.position.state, known=traces) == fingerprint(run.plan, run.position.state)


@pytest.mark.long
def test_what_runs_load_leaves_scipy_out():
    code = "import sys, coadjoint.simulation.simulate, coadjoint.models.heavy_top; print('scipy.linalg' in sys.modules)"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told.strip() == "False"


def test_a_function_with_a_derivative_of_its_own_is_not_kept(cache):
    @jax.custom_jvp
    def square(x):
        return x @ x

    square.defjvp(lambda primals, tangents: (primals[0] @ primals[0], 2 * primals[0] @ tangents[0]))
    system = co.System(co.SO3(), lambda xi: 0.5 * square(xi))
    co.simulate(system, system.state(xi=[0.3, 1.0, -0.2]), dt=0.05, steps=2)
    assert not found_in(cache, starts=True)


@pytest.mark.long
def test_a_group_of_somebody_else_is_not_kept(cache):
    class Own(co.SO3):
        pass

    system = co.System(Own(), lambda xi: 0.5 * xi @ xi)
    co.simulate(system, system.state(xi=[0.3, 1.0, -0.2]), dt=0.05, steps=2)
    assert not found_in(cache, starts=True)


@pytest.mark.long
def test_a_vehicle_with_other_numbers_gets_gains_of_its_own(cache):
    vehicle = load_vehicle("remus_100")
    first = Attitude().fitted(vehicle).parameters()
    before = found_in(cache)
    assert len(before) == 1
    assert same(Attitude().fitted(vehicle).parameters(), first)
    assert found_in(cache) == before
    heavier = dataclasses.replace(vehicle, mass=1.1 * vehicle.mass)
    assert not same(Attitude().fitted(heavier).parameters(), first)
    assert len(found_in(cache)) == 2
