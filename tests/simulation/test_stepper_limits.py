"""Commands beyond the limits that a rule declares: a stepper warns of the first one."""

from __future__ import annotations

import warnings
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co


class Fin(co.mechanics.InternalRule):
    """A fin that is where its command is, within ±p.limit."""

    def __call__(self, motion, h, p: Any):
        return {"fin": jnp.clip(motion.inputs.fin, -p.limit, p.limit)}

    def command_limits(self, p: Any):
        return {"fin": (-p.limit, p.limit)} if np.ndim(p.limit) == 0 else {}


SYSTEM = co.System(
    co.SO3(), lambda xi, p: 0.5 * xi @ xi, internal=Fin(), parameters={"limit": 0.3},
    forces=lambda motion, p: co.Force(torque=jnp.array([0, 0, 1e-3]) * motion.internal.fin),
)  # fmt: skip


def fin(**more) -> co.Stepper:
    start = SYSTEM.state(xi=[0.1, 0.2, 0.3], internal={"fin": 0.0})
    return co.Stepper(SYSTEM, start, dt=0.05, inputs=("fin",), accuracy=False, **more)


def told(made, *calls) -> list[str]:
    """The warnings of calls: commands and how many steps."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for command, n in calls:
            made.step(command, n=n)
    return [str(one.message) for one in said]


def clipped(value: float, time: float, whose: str = "", limit: float = 0.3) -> str:
    return (
        f"Command `fin`{whose} is clipped to its limits, {-limit:g} to {limit:g}: it is {value:g} at t = {time:g} s, "
        "the first time beyond them."
    )


@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_the_first_command_beyond_its_limits_is_named_once(backend):
    made = fin(backend=backend)
    assert told(made, ([0.3], 2), ([-0.3], 40), (None, 1)) == []
    other = made.clone()
    assert told(made, ({"fin": 0.4}, 40), ({"fin": -3.0}, 1)) == [clipped(0.4, 2.15)]
    other.command["fin"][...] = -0.5
    assert told(other, (None, 1), ([0.4], 1)) == [clipped(-0.5, 2.15)]


def test_a_saved_stepper_knows_its_limits(tmp_path):
    fin().save(tmp_path / "fin.step")
    loaded = co.load_stepper(tmp_path / "fin.step")
    assert told(loaded, ([0.1], 1), ([0.5], 1), ([0.6], 1)) == [clipped(0.5, 0.05)]


def test_of_many_members_one_whose_command_is_clipped_is_named():
    assert told(fin(members=5), ({"fin": [0.0, 0.3, -0.3, 0.7, 0.0]}, 3)) == [clipped(0.7, 0.0, " of member 3")]


def test_limits_change_with_the_parameters():
    made = fin()
    made.change(limit=2.0)
    assert told(made, ([1.9], 1)) == []
    made.change(limit=0.5)
    assert told(made, (None, 1)) == [clipped(1.9, 0.05, limit=0.5)]


def test_a_clipped_command_that_is_not_finite_is_refused_before():
    made = fin()
    with pytest.raises(co.errors.ArgumentError, match="Command `fin` must be finite"):
        made.step([np.inf])
    assert told(made, ([0.1], 1)) == []
