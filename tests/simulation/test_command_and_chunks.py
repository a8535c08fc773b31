"""Commands given to the pure functions of a stepper, the status of its calls, and the chunks of a stored run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.program import StatusFlag
from coadjoint.mechanics.inputs import Command, inputs_from
from coadjoint.simulation import store
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


def test_a_chunk_holds_no_more_records_than_a_run_has_or_a_flush_takes():
    def blocks(size: int, nodes: int, members: int | None = None) -> tuple[int, int]:
        run = SimpleNamespace(members=members, plan=SimpleNamespace(nodes=nodes))
        return store.Store._blocks(cast(Any, run), size)

    rows, block, flush = store.BLOCK_ROWS, store.BLOCK_BYTES, store.FLUSH_BYTES
    assert blocks(8, 5) == (5, 1) and blocks(8, 10**9) == (min(rows, block // 8), 1)
    assert blocks(2 * block, 5) == (1, 1) and blocks(block // 2, 5) == (2, 1)
    assert blocks(8, 5, members=3) == (5, 3) and blocks(8, 10**9, members=1)[0] == min(rows, flush // 8)
    assert blocks(8, 10**9, members=flush // 80) == (10, block // 80) and blocks(flush, 5, members=7) == (1, 1)
