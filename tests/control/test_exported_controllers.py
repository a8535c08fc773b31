"""A controller as a C library commands what the controller does after many iterations."""

from __future__ import annotations

import ctypes
import re

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from c_library import built, needs_compiler, structure, written_while_it_runs
from coadjoint.errors import ArgumentError

pytest.importorskip("casadi")

from coadjoint.control import c_library
from coadjoint.control.guess import Guesses
from coadjoint.kernels.packing import layout

BODY = co.System(
    co.SO3(),
    lambda xi, p: 0.5 * xi @ (p.inertia * xi),
    parameters={"inertia": [1.0, 2.0, 2.5]},
    forces=lambda motion, p: co.Force(torque=motion.inputs.torque - motion.internal.brake * motion.xi),
    internal=lambda motion, h, p: {"brake": 0.9 * motion.internal.brake},
)
START = BODY.state(xi=[0.4, -0.2, 0.3], internal={"brake": 0.3})


def problem(steps=6, **more):
    def cost(m, p):
        return m.xi @ m.xi + 0.1 * m.inputs.torque @ m.inputs.torque + 3.0 - jnp.trace(m.g)

    given = {"lower": -0.5, "upper": 0.5, "rate": 3.0, **more}
    inputs = {"torque": co.control.Input((3,), **given)}
    return co.control.Problem(BODY, START, dt=0.1, steps=steps, inputs=inputs, cost=cost, accuracy=False)


@pytest.fixture(scope="module")
def controller():
    return problem().controller()


def converged(controller, state, previous):
    for _ in range(60):
        found = controller(state, previous={"torque": previous})
    return found.command["torque"]


def test_the_solver_that_is_generated_finds_the_commands_of_the_controller(controller, monkeypatch):
    """Its texts have the sizes, places and names of the program."""
    kept = {}

    def keep(name):
        made = getattr(c_library, name)
        monkeypatch.setattr(c_library, name, lambda *given, **more: kept.setdefault(name, made(*given, **more)))

    keep("transcribe"), keep("nonlinear_program"), keep("solver")
    texts = c_library.sources(controller.problem, "control", 30, {"t": "s", "torque": "N m"})
    made, program, (code, function) = kept["transcribe"], kept["nonlinear_program"], kept["solver"]
    assert texts["control_solver.c"] == code and list(texts) == ["control.h", "control.c", "control_solver.c"]
    assert "Controller of " in texts["control.h"] and ", 6 steps of 0.1 s" in texts["control.h"]
    for line in (
        "CONTROL_STATE_MU_0 = 9", "CONTROL_GIVEN_PREVIOUS_TORQUE = 0", "#define CONTROL_STEPS 6",
        "     0..2       torque                               3        N m",
    ):  # fmt: skip
        assert line in texts["control.h"]
    (places,) = re.findall(r"control_places\[13\] = \{([^}]*)\}", texts["control.h"] + texts["control.c"])
    state = made.beginning.state
    packed = made.graph.numbers(layout(state).unpack(np.arange(layout(state).size)))[made.live]
    assert [int(one) for one in places.split(",")] == packed.tolist()
    x = made.graph.numbers(state)[made.live]
    guess, zeros = Guesses(made).variables(made.problem, None, x), np.zeros(program.g.numel())
    w, _, _, residuals = function(x, made.given, guess, 0.0 * guess, zeros)
    assert np.max(residuals.full()) < 1e-9
    found = made.split(w.full().ravel()).u[0]
    assert np.allclose(found, converged(controller, START, np.zeros(3)), rtol=0, atol=1e-6)
    assert np.allclose(np.abs(found), 0.3, rtol=0, atol=1e-9)  # the rate
    x[-2] += 0.1
    w = function(x, made.given, guess, 0.0 * guess, zeros)[0].full().ravel()
    assert np.allclose(made.split(w).x[0], x, rtol=0, atol=1e-9)


@pytest.mark.long
def test_the_header_names_state_commands_and_given_numbers(controller, tmp_path):
    text = (controller.export_c(tmp_path / "control", units={"torque": "N m"}) / "control.h").read_text()
    for line in (
        "CONTROL_STATE_MU_0 = 9", "control_places[13]", "CONTROL_GIVEN_PREVIOUS_TORQUE = 0", "#define CONTROL_STEPS 6",
        "     0..2       torque                               3        N m",
        "int control_command(control *self, const double state[13], int passed);",
    ):  # fmt: skip
        assert line in text, text
    places = re.search(r"control_places\[13\] = \{([\d, ]+)\}", (tmp_path / "control" / "control.c").read_text())
    state = co.Stepper(BODY, START, dt=0.1, inputs={"torque": np.zeros(3)}, accuracy=False)._buffers.state[0, :, 0]
    numbers = np.concatenate([START.g.ravel(), START.mu, [START.internal.brake]])
    assert np.array_equal(state[list(map(int, places.group(1).split(",")))], numbers)
    with pytest.raises(ArgumentError, match="with a delay has no C library"):
        problem().controller(delay=0.1).export_c(tmp_path / "other")


@pytest.mark.long
@needs_compiler
def test_a_loop_in_c_turns_the_body_as_the_controller_would(controller, tmp_path):
    folder = controller.export_c(tmp_path / "control")
    library, text = (
        built(folder, "control", sources=("control.c", "control_solver.c"), strict=False),
        (folder / "control.h").read_text(),
    )
    assert written_while_it_runs(folder, "control.c") == [] and "CasADi's code has static memory" in text
    assert written_while_it_runs(folder, "control_solver.c")
    names = ("commands", "given", "variables", "bound_multipliers", "multipliers", "residuals", "work")
    sizes = {name: int(re.search(rf"double {name}\[(\d+)\]", text).group(1)) for name in names}
    fields = {name: (ctypes.c_double, size) for name, size in sizes.items()}
    one = structure(**fields, integers=(ctypes.c_int, int(re.search(r"integers\[(\d+)\]", text).group(1))))()
    at, n = ctypes.byref(one), 13
    places = list((ctypes.c_int * n).in_dll(library, "control_places"))
    body = co.Stepper(BODY, START, dt=0.1, inputs={"torque": np.zeros(3)}, accuracy=False)
    library.control_reset(at)
    controller.reset()
    ipopt = problem(previous=0.0)
    before = np.zeros(3)
    for k in range(8):
        state = (ctypes.c_double * n)(*body._buffers.state[0, places, 0])
        assert library.control_command(at, state, ctypes.c_int(min(k, 1))) == 0
        assert max(one.residuals) < 1e-8
        found = np.array(one.commands)
        exact = ipopt.solve(start=body.state, previous={"torque": before}, tolerance=1e-10).inputs["torque"][0]
        assert np.allclose(found, exact, rtol=0, atol=1e-6)
        assert np.allclose(found, converged(controller, body.state, before), rtol=0, atol=1e-4)
        before = found
        body.step({"torque": found})
    state[0] = np.nan
    assert library.control_command(at, state, ctypes.c_int(1)) == 2
