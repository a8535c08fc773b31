"""A stepper as a C library takes the stepper's steps, bitwise, and knows their derivatives."""

from __future__ import annotations

import ctypes
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_saved_stepper import made

import coadjoint as co
from c_library import built, needs_compiler, structure, written_while_it_runs
from coadjoint.errors import ArgumentError
from coadjoint.kernels.lanes import of_lanes
from coadjoint.simulation.steppers.c_library import sources

YOSHIDA = co.methods.Yoshida4(co.Midpoint(), negative_substeps="allow")


@pytest.fixture(
    scope="module", params=[co.Midpoint(), pytest.param(YOSHIDA, marks=pytest.mark.long)], ids=["midpoint", "yoshida"]
)
def exported(tmp_path_factory, request):
    top = made(method=request.param)
    top.step({"torque": [0.1, 0.0, -0.2]}, n=3)
    return top.export_c(tmp_path_factory.mktemp("c") / "top", units={"mu": "N m s"}), top


@pytest.mark.parametrize(("members", "says"), [(3, "has 3 members"), (None, "runs by XLA")])
def test_a_stepper_that_is_no_library_is_told_why(members, says):
    stepper: Any = SimpleNamespace(face=SimpleNamespace(members=members), _engine=None, _buffers=None)
    with pytest.raises(ArgumentError, match=f"{says} is no C library"):
        sources(stepper, "top", {})


@pytest.mark.parametrize(("name", "says"), [(None, "`folder`"), ("9 lives", "`name`")])
def test_a_library_whose_name_c_does_not_allow_names_the_argument_that_gave_it(tmp_path, name, says):
    unused: Any = None
    with pytest.raises(ArgumentError, match=says):
        co.Stepper.export_c(unused, tmp_path / "9 lives", name=name)


@pytest.mark.long
def test_the_header_names_the_numbers_of_the_stepper(exported):
    text = (exported[0] / "top.h").read_text()
    for line in (
        "#define TOP_STATE 27", "#define TOP_DT 0.05", "TOP_STATE_INTERNAL_BRAKE = 22", "TOP_PARAMETER_GRIP = 4",
        "     0..2       mu                                   3        N m s", "TOP_NOT_CONVERGED = 1",
        "int top_step_jacobian(top *self, double *jacobian);",
    ):  # fmt: skip
        assert line in text, text
    with pytest.raises(ArgumentError, match="has 2 members is no C library"):
        made(members=2).export_c(exported[0], overwrite=True)


@pytest.mark.long
def test_another_processor_gets_its_own_object_file(exported, tmp_path):
    folder = exported[1].export_c(tmp_path / "arm", target="aarch64-linux-gnu")
    head = (folder / "arm_code.o").read_bytes()[:20]
    assert head[:4] == b"\x7fELF" and head[18:20] == b"\xb7\x00"  # EM_AARCH64


@needs_compiler
def test_steps_in_c_are_those_of_the_stepper_and_their_slopes_those_of_differences(exported):
    library, top = built(exported[0], "top"), exported[1]
    assert written_while_it_runs(exported[0]) == []  # so each thread may have its own vehicle
    face, double = top.face, ctypes.c_double
    sizes = {"state": face.state, "commands": face.commands, "observations": face.observations}
    fields = {name: (double, one.size) for name, one in {**sizes, "parameters": face.parameters}.items()}
    one = structure(**fields, status=(ctypes.c_int64, 4))()
    at, n = ctypes.byref(one), face.state.size
    assert library.top_reset(at) == 0 and bytes(one.observations) == top.observed.tobytes()
    for k in range(5):
        one.commands[:] = [0.3, -0.1 * k, 0.2]
        assert library.top_step(at, ctypes.c_int64(5)) == 0
        top.step(list(one.commands), n=5)
        assert bytes(one.observations) == top.observed.tobytes()
    jacobian, before = (double * (n * n))(), top.clone()
    assert library.top_step_jacobian(at, jacobian) == 0
    top.step()
    assert bytes(one.observations) == top.observed.tobytes() and one.status[0] == 26
    found, places = np.reshape(jacobian, (n, n)), (ctypes.c_int * 3).in_dll(library, "top_command_places")
    assert tuple(places) == face.commanded
    random = np.random.default_rng(1)
    for _ in range(3):
        moved = random.normal(size=n)
        ends = [_stepped(before, sign * 1e-6 * moved) for sign in (1, -1)]
        assert np.allclose(found @ moved, (ends[0] - ends[1]) / 2e-6, rtol=0, atol=1e-7)
    one.commands[0] = np.nan
    assert library.top_step(at, ctypes.c_int64(1)) == 17
    one.commands[:] = [1e300, 0.0, 0.0]
    assert library.top_step(at, ctypes.c_int64(1)) in (1, 2, 3) and one.status[0] == 26


def _stepped(top, change):
    """The state after a step from a changed state, with its commands."""
    one = top.clone()
    one._buffers.state[0, :, 0] += change
    one._commands[:] += change[list(one.face.commanded)]
    one._engine.advance(one._buffers, one._address, 1, 1, 1)
    return of_lanes(one._buffers.state)[0]
