"""Commands given to the pure functions of a stepper, the status of its calls, and the chunks of a stored run."""

from __future__ import annotations

import ctypes
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.program import StatusFlag
from coadjoint.mechanics.inputs import Command, inputs_from
from coadjoint.simulation import execution, setup_cache, store
from coadjoint.simulation.steppers import building, engines
from coadjoint.simulation.steppers.building import commanded
from coadjoint.simulation.steppers.engines import _told
from coadjoint.simulation.steppers.interface import Buffers

SYSTEM = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi)
HELD = {"fin": 0.1, "thrust": np.array([1.0, 2.0])}


def after(inputs: Any, command: Any, held: Any = HELD) -> Any:
    kept = co.Parameters(**held) if isinstance(held, dict) else held
    return commanded(inputs, SYSTEM.state().replace(inputs=kept), command).inputs


def test_commands_that_are_not_named_keep_their_values():
    inputs = inputs_from({"fin": Command(), "thrust": Command((2,))})
    assert after(None, None).fin == 0.1 and after(inputs, None).fin == 0.1
    found = after(inputs, {"fin": 0.5})
    assert found.fin == 0.5 and np.array_equal(found.thrust, [1.0, 2.0])
    assert np.array_equal(after(inputs_from(Command((2,))), [3.0, 4.0], np.zeros(2)), [3.0, 4.0])
    for given, command, says in (
        (None, {"fin": 0.5}, "This stepper has no commands"),
        (inputs, 0.5, "`command` must be name → value, but is 0.5"),
        (inputs, {"rudder": 0.5}, "no command `rudder`: it knows fin, thrust"),
        (inputs, {"thrust": 0.5}, r"Command `thrust` must have shape \(2,\), but has shape \(\)"),
        (inputs, {"fin": [0.5]}, r"Command `fin` must be one number, but has shape \(1,\)"),
        (inputs_from(Command((2,))), [3.0], r"The command must have shape \(2,\)"),
    ):
        with pytest.raises(ArgumentError, match=says):
            after(given, command)


def status(steps: int, before: int = 0, code: int = 0, command: float = 0.0, seen: float = 0.0) -> StatusFlag:
    """Of the second of two members, with commands from −1 to 2."""
    limits = np.array([[[-1.0, -9.0]], [[2.0, 9.0]]])
    now = np.zeros((2, 4, 1), np.int64)
    now[1, :2, 0] = steps, code
    numbers = Buffers(*(np.zeros(0),) * 3, now, np.array([[0.0], [command]]), np.array([[0.0], [seen]]), limits)
    return StatusFlag(_told(numbers, np.array([[0, 0], [before, 0]])))


def test_a_call_says_what_stopped_what_is_not_finite_and_what_is_beyond_its_limits():
    assert status(1) == 0 and status(1, code=3) == StatusFlag.FAILED
    assert status(1, seen=np.nan) == status(1, seen=np.inf) == StatusFlag.NOT_FINITE
    assert status(1, command=2.0) == status(1, command=-1.0) == 0
    assert status(1, command=2.1) == status(1, command=-1.1) == StatusFlag.CLIPPED


@pytest.mark.parametrize(
    ("before", "steps", "due"),
    [(0, 8191, False), (8191, 8192, True), (8192, 8193, False), (16383, 16384, True), (3 * 8192 - 1, 3 * 8192, False),
     (2**18 - 1, 2**18, True), (3 * 2**18 - 1, 3 * 2**18, True), (2**18 + 1, 2**18 + 9000, False)],
)  # fmt: skip
def test_a_sample_of_steps_is_due_at_powers_of_two_and_then_at_multiples(before, steps, due):
    assert (status(steps, before=before) == StatusFlag.DUE) == due


def numbers_at(address: int, count: int, kind: Any = ctypes.c_double) -> np.ndarray:
    return np.ctypeslib.as_array((kind * count).from_address(address))


@pytest.mark.parametrize("threads", [1, 2])
def test_members_of_chains_step_one_after_the_other_by_their_own_numbers(threads):
    """Machine code that adds p·h to x at each step and fails where the command is 9; the second member has stopped."""

    def function(p: int, h: int, s: int, records: int, every: int, record: int, monitors: int, extrema: int, out: int):
        state, found = numbers_at(s, 2), numbers_at(out, 4, ctypes.c_int64)
        assert (records, every, monitors, extrema) == (1, 3, 0, 0) and len(numbers_at(record, 5)) == 5
        done = 1 if state[0] == 9.0 else every
        state[1] += done * numbers_at(p, 1)[0] * numbers_at(h, 1)[0]
        found[:] = done, 3 * (done < every), 4 * done, 6 - state[0]

    kernel: Any = SimpleNamespace(record=SimpleNamespace(size=5), function=function)
    watch: Any = SimpleNamespace(functions=(len,))
    engine = engines.LinkedEngine(kernel, cast(Any, None), watch, cast(Any, ()), cast(Any, (0,)))
    engine._observed = lambda p, s: 10 * p + s[:, 1:]
    numbers = Buffers(
        parameters=np.array([2.0, 3.0, 2.0, 3.0])[:, None, None], h=np.array([0.1]), state=np.zeros((4, 2, 1)),
        status=np.zeros((4, 4, 1), np.int64), commands=np.array([[[1.0]], [[1.0]], [[9.0]], [[3.0]]])[..., 0],
        observations=np.zeros((4, 1)), limits=np.array([[[-9.0]], [[9.0]]]),
    )  # fmt: skip
    numbers.status[1, :, 0], numbers.status[3, :, 0] = (5, 2, 9, 4), (1, 0, 2, 7)
    flags = StatusFlag(engine.advance(numbers, 0, 4, 3, threads))
    assert numbers.status[..., 0].tolist() == [[3, 0, 12, 5], [5, 2, 9, 4], [1, 3, 4, 0], [4, 0, 14, 7]]
    assert numbers.state[..., 0].ravel().tolist() == pytest.approx([1, 0.6, 0, 0, 9, 0.2, 3, 0.9])
    assert flags == StatusFlag.FAILED


def test_an_interrupted_run_is_cut_at_its_position_and_says_how_it_goes_on():
    done: list[Any] = []
    outputs = SimpleNamespace(cut=lambda steps: done.append(steps))
    loop: Any = SimpleNamespace(outputs=outputs, undo=lambda at: done.append("undo"), append_last=done.append)
    position = SimpleNamespace(ended=False, steps=30)
    run: Any = SimpleNamespace(position=position, plan=SimpleNamespace(steps=100, h=0.25))
    assert execution._in_memory(run, loop).endswith("error.run.final, dt=0.25, steps=70) goes on")
    assert done == [30, "undo", position]
    position.ended = True
    assert execution._in_memory(run, loop) == "what was computed is in `.run` of this exception" and len(done) == 3


def test_a_chunk_holds_no_more_records_than_a_run_has_or_a_flush_takes():
    def blocks(size: int, nodes: int, members: int | None = None) -> tuple[int, int]:
        run = SimpleNamespace(members=members, plan=SimpleNamespace(nodes=nodes))
        return store.Store._blocks(cast(Any, run), size)

    rows, block, flush = store.BLOCK_ROWS, store.BLOCK_BYTES, store.FLUSH_BYTES
    assert blocks(8, 5) == (5, 1) and blocks(8, 10**9) == (min(rows, block // 8), 1)
    assert blocks(2 * block, 5) == (1, 1) and blocks(block // 2, 5) == (2, 1)
    assert blocks(8, 5, members=3) == (5, 3) and blocks(8, 10**9, members=1)[0] == min(rows, flush // 8)
    assert blocks(8, 10**9, members=flush // 80) == (10, block // 80) and blocks(flush, 5, members=7) == (1, 1)


@pytest.mark.parametrize("known", [None, {"warnings": ["an earlier one"]}])
@pytest.mark.parametrize("read", [None, SimpleNamespace(version="that was read")])
def test_a_start_is_checked_unless_its_verdict_is_known_and_its_version_is_read_or_made(monkeypatch, known, read):
    """In this order: the internal state, the system, the direction of time; what a method begins; chart and events."""
    done: list[Any] = []

    def said(name: str, found: Any) -> Any:
        return lambda *_: done.append(name) or found

    stand_ins = {"require_internal": ["internal"], "require_forward": ["forward"], "redundancy": ["redundant"],
                 "require_chart": None, "require_events": None, "version": "that was made"}  # fmt: skip
    for name, found in stand_ins.items():
        monkeypatch.setattr(building, name, said(name, found))
    monkeypatch.setattr(setup_cache, "read", lambda *_: read)
    monkeypatch.setattr(setup_cache, "verdict", lambda reading, kind: known)
    monkeypatch.setattr(setup_cache, "remember_verdict", said("remembered", None))
    system, method = (SimpleNamespace(inputs=None, check=said("check", ["checked"])), SimpleNamespace(regular=True))
    vars(method)["begin"] = said("begin", "begun")
    begun, version, warnings = building.checked(cast(Any, system), cast(Any, None), cast(Any, method), 0.1, None)
    new = ["internal", "checked", "forward", "redundant"]
    assert (begun, warnings) == ("begun", new if known is None else ["an earlier one"])
    assert version == ("that was made" if read is None else "that was read")
    checks = (
        ["require_internal", "check", "require_forward"],
        ["require_chart", "require_events", "redundancy", "remembered"],
    )
    first, then = checks if known is None else ([], [])
    assert done == [*first, "begin", *then, *(["version"] if read is None else [])]


def test_one_value_alone_is_a_command_or_an_input_without_a_name():
    found = building.commands_from([0.1, 0.2])
    assert np.array_equal(found[1], [0.1, 0.2]) and found[2].size == 2
    signal = building.commands_from(lambda motion: motion.t)
    assert signal[1] is None and signal[2].size == 0 and signal[0] is not None
    both = building.commands_from({"fin": 0.3, "push": lambda motion: motion.t})
    assert both[1].fin == 0.3 and both[2].names == ("fin",)
