"""Commands beyond the range of an actuator are clipped, which a run says."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint_vehicles.model.command_limits import clipped, values_of

ROV = vehicles.load("bluerov2_heavy_von_benzon")
CRAFT = vehicles.Craft(ROV)


def told(source, begin: float = 0.0, end: float = 20.0) -> list[str]:
    return list(clipped(ROV, {"thrusters": source}, begin, end, CRAFT.parameters))


def eight(value: float) -> np.ndarray:
    return np.full(8, value)


@pytest.mark.parametrize(
    ("source", "sentence"),
    [
        (
            co.Held([0], [eight(800.0)]),
            "is clipped to its limits, 1100 to 1900 us: it is 800 us at t = 0 s, the first time beyond them",
        ),
        (co.Held([0, 5, 9], [eight(1500), eight(2500), eight(800)]), "it is 2500 us at t = 5 s"),
        (co.mechanics.Signal(lambda t: jnp.full(8, 1500.0) + 50 * t), "it is 1901 us at t = 8.02 s"),
        (co.Linear([0, 10], [eight(1500), eight(1000)]), "it is 1000 us at t = 10 s"),
    ],
)
def test_a_command_beyond_the_limits_is_named_with_its_first_time_value_and_limits(source, sentence):
    (found,) = told(source)
    assert sentence in found and "`thrusters`" in found and found.endswith("at rest it is 1500 us.")


def test_no_pulse_is_named_and_not_clipped():
    (found,) = told(co.Held([0, 5], [eight(1500), eight(0)]))
    assert found == "The command of `thrusters` is 0 us at t = 5 s, no pulse: the motor stops, as at 1500 us."


def test_no_pulse_stops_a_motor():
    thrusters, own = ROV.part("thrusters"), CRAFT.parameters.thrusters
    after = thrusters.advance(eight(1700.0), np.array([0.0, 1500.0, 1100, 1, 0, 1900, 2500, 0]), 0.1, own)
    long = thrusters.advance(eight(1700.0), np.array([1500.0, 1500.0, 1100, 1100, 1500, 1900, 1900, 1500]), 0.1, own)
    assert np.array_equal(after, long)


@pytest.mark.parametrize("source", [eight(1500.0), eight(1900.0), co.Held([0, 30], [eight(1500), eight(0)])])
def test_commands_within_the_limits_while_a_run_lasts_say_nothing(source):
    assert told(source) == []


@pytest.mark.long
def test_a_run_warns_of_clipped_commands():
    start = CRAFT.start(position=(0, 0, 9.0))
    for value, warns in ((800.0, True), (1500.0, False)):
        run = co.simulate(
            CRAFT.system, start, dt=0.05, duration=0.5, inputs={"thrusters": eight(value)}, progress=False
        )
        assert any("is clipped to its limits" in sentence for sentence in run.warnings) is warns


@pytest.mark.long
def test_a_stepper_of_a_vehicle_warns_of_a_clipped_command():
    start = CRAFT.start(position=(0, 0, 9.0))
    made = co.Stepper(CRAFT.system, start, dt=0.05, inputs={"thrusters": eight(1500.0)}, accuracy=False)
    with pytest.warns(
        UserWarning, match="`thrusters` is beyond its limits, 1100 to 1900: it is 0 at t = 0.1 s.* none stops it"
    ):
        made.step({"thrusters": eight(1900.0)}, n=2)
        made.step({"thrusters": eight(0.0)})


def test_held_values_of_a_run_are_those_from_its_start_to_its_end():
    held = co.Held([0.0, 1.0, 2.0, 3.0], [5.0, 6.0, 7.0, 8.0])
    for begin, ahead, times, values in ((1.5, 3.0, [1.5, 2], [6, 7]), (0.0, 9.0, [0, 1, 2, 3], [5, 6, 7, 8])):
        np.testing.assert_array_equal(values_of(held, begin, ahead), (times, values))
