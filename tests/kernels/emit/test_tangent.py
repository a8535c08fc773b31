"""Forward sensitivities of driven runs by native code, against differences and against the adjoint."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest
from tests.torpedo import start, torpedo

import coadjoint as co
from coadjoint.identification.channels import VEHICLE, Channels
from coadjoint.identification.problem import Observed
from coadjoint.kernels.emit.adjoint import adjoint
from coadjoint.kernels.emit.tangent import tangent
from coadjoint.kernels.packing import pack
from coadjoint.kernels.run import batch, gradient
from coadjoint.kernels.run.function import NativeFunction
from coadjoint.kernels.untraceable import Untraceable
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.identity import version
from coadjoint.methods.program import Constants, StepProgram

SYSTEM = torpedo()
STATE = start(SYSTEM)
H, RUNS, STEPS = 0.05, 11, 40


def prepared(method) -> tuple[Any, ...]:
    """(program, plain program, constants, state, active parameters, places of the inputs)."""
    state = method.begin(SYSTEM, STATE, H)
    plain = StepProgram(replace_parameters(SYSTEM, None), method, version=version(SYSTEM, state))
    shape, numbers = pack(state)
    places = np.concatenate([np.ravel(x) for x in jax.tree.leaves(shape.unpack(np.arange(len(numbers))).inputs)])
    p = pack(SYSTEM.parameters)[1]
    active = tuple(i for i in range(len(p)) if p[i] not in (0.0, 1.0))[::3]
    constants = Constants(SYSTEM.parameters, None)
    return Observed(plain, Channels(VEHICLE)), plain, constants, state, active, places.astype(int)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "method",
    [co.Midpoint(), pytest.param(co.methods.LeftRight(co.Cayley()), marks=pytest.mark.long)],
    ids=["one stage", "two stages"],
)
def test_tangents_of_driven_runs_are_those_of_differences(method):
    program, _, constants, state, active, places = prepared(method)
    random = np.random.default_rng(1752)
    p, s = pack(constants)[1], pack(state)[1]
    code = batch.driven(program, constants, state, active)
    starts = np.repeat(s[None], RUNS, axis=0)
    starts[:, places] = 0.0
    table = random.normal(size=(STEPS, RUNS, len(places))) * [10.0, 0.3, 0.3]
    columns = len(active) + 4
    p_dot = np.zeros((columns, len(active)))
    p_dot[: len(active)] = np.eye(len(active)) * np.abs(p[list(active)])[:, None]
    s_dot = np.zeros((RUNS, columns, len(s)))
    s_dot[:, len(active) :] = random.normal(size=(RUNS, 4, len(s)))
    s_dot[:, :, places] = 0.0
    path = batch.run(code, p, H, starts, places, batch.grouped(table))
    assert not path.codes.any()
    found = batch.push(code, p, H, path, p_dot, s_dot)
    assert found.shape == (RUNS, STEPS, columns, len(VEHICLE))
    for column in range(columns):
        ends = []
        for e in (1e-6, -1e-6):
            moved = p.copy()
            moved[list(active)] += e * p_dot[column]
            ends.append(batch.run(code, moved, H, starts + e * s_dot[:, column], places, batch.grouped(table)).records)
        difference = (ends[0] - ends[1]) / 2e-6
        scale = max(1.0, np.abs(difference).max())
        np.testing.assert_allclose(found[:, :, column], difference, atol=2e-7 * scale)


@pytest.mark.long
def test_tangents_of_a_run_and_its_adjoint_are_transposes():
    """⟨ȳ, dy⟩ = ⟨p̄, dp⟩ for a run with constant inputs."""
    program, plain, constants, state, active, _ = prepared(co.Midpoint())
    p, s = pack(constants)[1], pack(state)[1]
    code = batch.driven(program, constants, state, active)
    nothing = np.zeros(0, int)
    path = batch.run(code, p, H, s[None], nothing, batch.grouped(np.zeros((STEPS, 1, 0))))
    dot = batch.push(code, p, H, path, np.eye(len(active)), np.zeros((1, len(active), len(s))))
    east = dot[0, -1, :, VEHICLE.index("east")]

    def final_east(state):
        return state.places.additional.act(state.places.group, state.g, state.n)[1]

    chunk, pull = gradient.vjp(plain, constants, state, H, STEPS - 1, 1)
    with jax.enable_x64(True):
        bar = jax.grad(final_east, allow_int=True)(jax.tree.map(np.asarray, chunk.final))
    bars = pack(pull(None, bar).parameters)[1][list(active)]
    np.testing.assert_allclose(east, bars, rtol=1e-9, atol=1e-12)


@pytest.mark.long
def test_runs_follow_the_table_that_drives_them():
    """A run with inputs in a table is the run of co.simulate with the same held inputs."""
    program, _, constants, state, active, places = prepared(co.Midpoint())
    random = np.random.default_rng(1687)
    table = random.normal(size=(STEPS, 1, 3)) * [10.0, 0.3, 0.3]
    code = batch.driven(program, constants, state, active)
    path = batch.run(code, pack(constants)[1], H, pack(state)[1][None], places, batch.grouped(table))
    names = list(STATE.inputs)
    inputs = {name: co.Held(H * np.arange(STEPS), table[:, 0, i]) for i, name in enumerate(names)}
    run = co.simulate(SYSTEM, STATE, dt=H, steps=STEPS - 1, inputs=inputs, monitors=False)
    np.testing.assert_allclose(path.records[0, :, :3], run.records.q, atol=1e-12)


def test_a_native_function_and_its_jacobian():
    def function(x, y):
        return jax.numpy.stack([x[0] * jax.numpy.sin(x[1]) + y[0], x[1] / y[1], y[0]])

    made = NativeFunction(function, np.zeros(2), np.zeros(2))
    x, y = np.array([[2.0, 0.5], [1.0, -1.0]]), np.array([[3.0, 4.0], [5.0, 6.0]])
    value, slopes = made(x, y)
    np.testing.assert_allclose(value, np.stack([x[:, 0] * np.sin(x[:, 1]) + y[:, 0], x[:, 1] / y[:, 1], y[:, 0]], 1))
    expected = np.zeros((2, 3, 2))
    expected[:, 0, 0], expected[:, 0, 1], expected[:, 1, 1] = np.sin(x[:, 1]), x[:, 0] * np.cos(x[:, 1]), 1 / y[:, 1]
    np.testing.assert_allclose(slopes, expected)


@pytest.mark.parametrize("derivative", [tangent, adjoint])
def test_a_step_one_of_whose_stages_may_fail_has_no_derivative(derivative):
    stages = SimpleNamespace(sound=None), SimpleNamespace(sound="symbol")
    with pytest.raises(Untraceable, match="a stage that may fail has no derivative in native code"):
        derivative(SimpleNamespace(stages=stages), ())
