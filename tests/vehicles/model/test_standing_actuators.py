"""Faults of actuators in closed form: when they are there, where the actuator stands, and what cannot stand so."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.internal_state import Course
from coadjoint_vehicles.model.faults import BARELY, Fault, latched, require_faults
from coadjoint_vehicles.model.start import through_water
from coadjoint_vehicles.parts import Fin, Thrusters
from coadjoint_vehicles.parts.force_curves import Linear

FIN = Fin("rudder", position=(-1, 0, 0), normal=(0, 1, 0), area=0.1, lift_slope=3.0, stall=0.3, limit=0.5)
MOTORS = Thrusters(
    "motors", curve=Linear(1.0), positions=[[0, 1, 0], [0, -1, 0]], directions=[[1, 0, 0], [1, 0, 0]], limit=(-3.0, 5.0)
)
GIVEN: dict[str, Any] = {"rudder": FIN, "motors": MOTORS}


def motion(t: float, depth: float = 0.0, **held: float) -> Any:
    internal = SimpleNamespace(faults=SimpleNamespace(**{name: np.array(value) for name, value in held.items()}))
    return SimpleNamespace(t=np.array(t), q=np.array([0.0, 0.0, depth]), internal=internal)


def refused(sentence: str, call: Any, *given: Any, **more: Any) -> None:
    with pytest.raises(ArgumentError, match=sentence):
        call(*given, **more)


def test_a_fault_is_there_from_its_time_on_or_from_its_event_on():
    late = Fault("rudder", time=3.0)
    assert [float(late.there(motion(t), None)) for t in (2.9, 3.0 - 0.5 * BARELY, 3.0, 4.0)] == [0.0, 1.0, 1.0, 1.0]
    assert float(late.there(motion(3.0 - 2 * BARELY), None)) == 0.0
    deep = Fault("rudder", when=lambda motion, p: motion.q[2] - p)
    assert [float(deep.there(motion(0.0, z), 5.0)) for z in (4.9, 5.0, 6.0)] == [0.0, 1.0, 1.0]


def test_a_fault_stays_once_it_was_there():
    faults = (Fault("rudder", time=3.0), Fault("motors", time=1.0))
    found = latched(faults, motion(2.0, rudder=1.0, motors=0.0), None)
    assert {name: float(value) for name, value in found.items()} == {"rudder": 1.0, "motors": 1.0}
    assert float(latched(faults[:1], motion(2.0, rudder=0.0), None)["rudder"]) == 0.0


def course(fault: Fault, now: Any, end: Any, there: float, mean: Any = None, begin: Any = None) -> list[Any]:
    given = [None if x is None else np.asarray(x, dtype=float) for x in (end, mean, begin)]
    found = evaluate(lambda: tuple(fault.stands(Course(*given), np.asarray(now, dtype=float), np.array(there))))
    return [np.asarray(part).tolist() for part in found]


def test_an_actuator_stands_over_the_whole_step_and_goes_its_way_otherwise():
    stuck = Fault("rudder", value=0.3, time=0.0)
    assert course(stuck, 0.1, 0.2, 1.0) == [0.3, 0.3, 0.3]
    assert course(stuck, 0.1, 0.2, 0.0) == [0.2, pytest.approx(0.15), 0.1]
    assert course(stuck, 0.1, 0.2, 0.0, mean=0.19, begin=0.12) == [0.2, 0.19, 0.12]
    assert course(Fault("rudder", time=0.0), 0.1, 0.2, 1.0) == [0.1, 0.1, 0.1]


def test_of_several_thrusters_those_that_are_named_stand():
    out = Fault("motors", value=0.0, which=(1,), time=0.0)
    assert course(out, [1.0, 2.0], [3.0, 4.0], 1.0) == [[3.0, 0.0], [2.0, 0.0], [1.0, 0.0]]
    assert course(out, [1.0, 2.0], [3.0, 4.0], 0.0)[0] == [3.0, 4.0]


def test_a_part_with_more_than_its_command_gets_the_value_as_its_command():
    dropped = Fault("payload", value=1.0, time=0.0)
    assert [float(dropped.command(0.25, np.array(there))) for there in (0.0, 0.5, 1.0)] == [0.25, 0.25, 1.0]


@pytest.mark.parametrize("value", [-0.5, 0.5, None])
def test_a_value_at_the_end_of_the_range_fits(value):
    Fault("rudder", value=value, time=0.0).fits(FIN)
    Fault("motors", value=(-3.0, 5.0), which=(0, 1), time=0.0).fits(MOTORS)


@pytest.mark.parametrize(
    ("part", "given", "sentence"),
    [
        ("rudder", {"value": 0.51}, "must be from -0.5 to 0.5, the range of the fin `rudder`, but is 0.51"),
        ("rudder", {"value": -0.51}, "must be from -0.5 to 0.5"),
        ("rudder", {"value": np.nan}, "`value` of the fault `rudder` must be a number"),
        ("rudder", {"value": [0.1, 0.1]}, "`value` of the fault `rudder` must be a number"),
        ("rudder", {"which": (0,)}, "`which` of the fault `rudder` must be from 0 to 0"),
        ("motors", {"which": (2,)}, "`which` of the fault `motors` must be from 0 to 1, but is"),
        ("motors", {"which": (-1,)}, "`which` of the fault `motors` must be from 0 to 1"),
        ("motors", {"value": 5.1}, "must be from -3 to 5"),
    ],
)
def test_what_a_part_cannot_be_is_no_fault_of_it(part, given, sentence):
    refused(sentence, Fault(part, time=0.0, **given).fits, GIVEN[part])


def test_a_fault_has_one_beginning_and_a_name():
    refused("needs either a time or `when`", Fault, "rudder")
    refused("needs either a time or `when`", Fault, "rudder", time=1.0, when=lambda motion, p: 0.0)
    refused("`when` of a fault must be a function", Fault, "rudder", when=3.0)
    refused("time` of a fault of `rudder", Fault, "rudder", time=np.inf)
    refused("must be a word such as 'rudder', but is 'a b'", Fault, "rudder", time=1.0, name="a b")
    assert Fault("rudder", time=1).name == "rudder" and Fault("rudder", time=1, name="stuck").time == 1.0


def test_faults_of_a_craft_are_of_its_actuators_and_have_names_of_their_own():
    one, two = Fault("rudder", time=1.0), Fault("motors", time=2.0)
    assert require_faults(one, GIVEN) == (one,) and require_faults([one, two], GIVEN) == (one, two)
    refused("must be a fault such as", require_faults, [3], GIVEN)
    refused("no actuator `fin`: it knows .*rudder", require_faults, Fault("fin", time=1.0), GIVEN)
    refused("Two faults are named `rudder`", require_faults, [one, cast(Any, one)], GIVEN)


def test_a_speed_is_one_ahead_of_each_member():
    found = through_water(co.each([1.5, 2.0]), None)
    assert np.asarray(found.values).tolist() == [[1.5, 0.0, 0.0], [2.0, 0.0, 0.0]]
    assert through_water(1.5, None).tolist() == [1.5, 0.0, 0.0]
