"""A system that was checked once is not checked again, but whatever changes what its functions do is seen."""

from __future__ import annotations

import contextlib
import types

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import CoadjointError
from coadjoint.mechanics import check, trace_checks
from coadjoint.simulation import setup_cache

INERTIA = np.diag([1.0, 2.0, 3.0])
GLOBAL = 0.1


class Drag:
    """A force with an attribute, a method and an array."""

    def __init__(self, strength):
        self.strength, self.table = strength, np.full(3, strength)

    def of(self, xi):
        return -self.strength * xi

    def by_method(self, motion):
        return co.Force(torque=self.of(motion.xi))

    def by_array(self, motion):
        return co.Force(torque=-self.table * motion.xi)


def by_closure(strength):
    def forces(motion):
        return co.Force(torque=-strength * motion.xi)

    return forces


def by_global(motion):
    return co.Force(torque=-GLOBAL * motion.xi)


library = types.SimpleNamespace(drag=lambda xi: -0.1 * xi)


def by_library(motion):
    return co.Force(torque=library.drag(motion.xi))


def top(forces):
    system = co.System(co.SO3(), lambda xi: 0.5 * xi @ INERTIA @ xi, forces=forces)
    return system, system.state(xi=[0.3, 1.0, -0.2])


def ended(system, start):
    return co.simulate(system, start, dt=0.05, steps=20, progress=False).final.mu


def cell(forces, monkeypatch, value):
    forces.__closure__[0].cell_contents = value


def the_global(forces, monkeypatch, value):
    monkeypatch.setitem(globals(), "GLOBAL", value)


def array(forces, monkeypatch, value):
    forces.__self__.table[:] = value


def attribute(forces, monkeypatch, value):
    forces.__self__.strength = value


def method(forces, monkeypatch, value):
    monkeypatch.setattr(Drag, "of", lambda self, xi: -value * xi)


def library_function(forces, monkeypatch, value):
    monkeypatch.setattr(library, "drag", lambda xi: -value * xi)


CHANGES = {
    "closure": (lambda: by_closure(0.1), cell),
    "global": (lambda: by_global, the_global),
    "array in place": (lambda: Drag(0.1).by_array, array),
    "attribute": (lambda: Drag(0.1).by_method, attribute),
    "method": (lambda: Drag(0.1).by_method, method),
    "library": (lambda: by_library, library_function),
}


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("change", CHANGES)
def test_what_changes_a_force_changes_the_next_run(change, monkeypatch):
    make, mutate = CHANGES[change]
    forces = make()
    system, start = top(forces)
    before = ended(system, start)
    mutate(forces, monkeypatch, 0.7)
    after = ended(system, start)
    assert np.array_equal(after, ended(*top(by_closure(0.7))))
    assert not np.array_equal(after, before)
    mutate(forces, monkeypatch, float("nan"))
    with pytest.raises(CoadjointError):
        ended(system, start)
    mutate(forces, monkeypatch, 0.1)
    assert np.array_equal(ended(system, start), before)


def test_numbers_of_parameters_and_start_count_even_where_arrays_change_in_place():
    inertia, turn = INERTIA.copy(), np.array([0.3, 1.0, -0.2])

    def lagrangian(xi, p):
        return 0.5 * xi @ p.inertia @ xi

    def ran():
        system = co.System(co.SO3(), lagrangian, parameters={"inertia": inertia})
        return co.simulate(system, system.state(xi=turn), dt=0.05, steps=20, progress=False)

    first = ran()
    first.start.mu[:] = 7.0
    inertia[0, 0], turn[0] = 1.5, 0.4
    second = ran()
    assert not np.array_equal(second.final.mu, first.final.mu)
    inertia[0, 0] = 0.0
    with pytest.raises(CoadjointError, match="regular"):
        ran()
    inertia[0, 0], turn[0] = 1.0, 0.3
    again = ran()
    assert np.array_equal(again.records.mu, first.records.mu)
    assert np.array_equal(again.plan.constants.system.inertia, inertia)


def test_an_event_that_changes_is_another_event():
    level = [0.5]
    system, start = top(by_closure(0.1))

    def crosses(state):
        return state.t - level[0]

    def event():
        return co.simulate(system, start, dt=0.05, steps=40, until=crosses, progress=False, monitors=False).event

    assert event() == pytest.approx(0.5)
    level[0] = 1.2
    assert event() == pytest.approx(1.2)


def test_a_second_run_of_unchanged_functions_reads_none():
    readings, factor = 0, np.array(0.1)

    def forces(motion):
        nonlocal readings
        readings += 1
        return co.Force(torque=-factor * motion.xi)

    system, start = top(forces)
    first = ended(system, start)
    assert readings > 0
    readings = 0  # the forces reach it, too
    assert np.array_equal(ended(system, start), first)
    assert readings == 0


def test_a_second_run_reads_every_function_once_that_reaches_unknown_values_and_checks_nothing(monkeypatch):
    readings = []
    seen = types.SimpleNamespace(append=readings.append)  # whose values are not compared

    def forces(motion):
        seen.append("force")
        return co.Force(torque=-0.1 * motion.xi)

    system, start = top(forces)
    first = ended(system, start)
    readings.clear()
    monkeypatch.setattr(check, "require_scalar", None)
    monkeypatch.setattr(trace_checks, "_again", None)
    assert np.array_equal(ended(system, start), first)
    assert readings == ["force"]


def together(system, start):
    fleet = system.replace(drag=co.each([0.1, 0.2, 0.3]))
    run = co.simulate(fleet, start, dt=0.05, steps=20, accuracy=False, progress=False)
    return run.records.mu


def stepped(system, start):
    stepper = co.Stepper(system, start, dt=0.05, observe={"mu": lambda state: state.mu})
    stepper.step(n=20)
    return stepper.state.mu


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("run", [together, stepped])
def test_a_second_ensemble_or_stepper_reads_every_function_once_and_checks_nothing(run, monkeypatch):
    readings, strength = [], [1.0]
    seen = types.SimpleNamespace(append=readings.append)  # whose values are not compared

    def forces(motion, p):
        seen.append("force")
        return co.Force(torque=-strength[0] * p.drag * motion.xi)

    system = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ INERTIA @ xi, forces=forces, parameters={"drag": 0.1})
    start = system.state(xi=[0.3, 1.0, -0.2])
    first = run(system, start)
    for kept in (
        setup_cache._known,
        setup_cache._verdicts,
    ):  # as in another process, which finds on the disk what this one checked
        kept.clear()
    run(system, start)
    readings.clear()
    with monkeypatch.context() as patch:
        patch.setattr(check, "require_scalar", None)
        assert np.array_equal(run(system, start), first)
    assert readings == ["force"]
    strength[0] = 2.0
    changed = run(system, start)
    assert not np.array_equal(changed, first)
    twice = co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ INERTIA @ xi,
        forces=lambda motion, p: co.Force(torque=-2.0 * p.drag * motion.xi),
        parameters={"drag": 0.1},
    )
    assert np.array_equal(changed, run(twice, twice.state(xi=[0.3, 1.0, -0.2])))


def test_a_function_that_is_not_pure_is_refused_however_often_it_is_tried():
    random = np.random.default_rng(0)
    system, start = top(lambda motion: co.Force(torque=-random.uniform() * motion.xi))
    for _ in range(3):
        with pytest.raises(CoadjointError, match="pure"):
            ended(system, start)


@pytest.mark.parametrize("forces", [None, by_closure(0.1)])
def test_only_where_all_functions_are_the_librarys_own_are_they_not_read_to_see_that_they_are_pure(forces):
    craft = co.vehicles.Craft(co.vehicles.load("remus_100"))
    system = craft.system if forces is None else co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, forces=forces)
    start = craft.start(speed=1.5) if forces is None else system.state(xi=np.ones(3))
    own = setup_cache.read(system, start, [], (), (), co.Midpoint(), 0.05).own
    assert own == (forces is None)
    random = np.random.default_rng(0)
    with (
        trace_checks.functions_known(own),
        contextlib.nullcontext() if own else pytest.raises(CoadjointError, match="pure"),
    ):
        trace_checks.require_float64(lambda x: random.uniform() * x, "It", (np.ones(2),))
