"""Native code takes the steps of the reference on Lagrangians that nobody chose."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from test_backends import STEPS, H, assert_same, by_numpy

import coadjoint as co
from coadjoint.kernels.run import native
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods.program import Constants, StepProgram
from systems import MAPS, RULES, WORLDS, system_on


@pytest.mark.long
@settings(max_examples=8, deadline=None, derandomize=True)
@given(
    world=some.sampled_from(["SO3 alone", "SO3", "SE2", "SO2", "R3"]),
    tau=some.sampled_from(["cayley", "exponential"]),
    rule=some.sampled_from(list(RULES)),
    forced=some.booleans(),
    number=some.integers(min_value=0, max_value=10**6),
)
def test_native_steps_are_the_reference_steps_of_random_lagrangians(world, tau, rule, forced, number):
    """The coefficients of ℓ, the forces and the start follow from `number`; a failing case prints it."""
    place = WORLDS[world]
    system, start = system_on(place.group, place.additional, place.advected, forced, f"{world} {number}")
    method: co.methods.Method = RULES[rule](MAPS[tau])
    program = StepProgram(replace_parameters(system, None), method)
    constants, state = Constants(system.parameters, None), method.begin(system, start, H)
    chunk = native.run(program, constants, state, H, STEPS, 1, monitors=False)
    records, final, iterations = by_numpy(program, constants, state)
    assert_same(chunk.records, records)
    assert_same(chunk.final, final)
    assert chunk.iterations <= 2 * iterations
