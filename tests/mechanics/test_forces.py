"""Forces that are none are refused in one sentence."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co

GOOD = co.Force(torque=np.zeros(3), force=np.zeros(3))


def body(forces, **more) -> co.System:
    spaces = {"additional": co.Defining(), **more}
    if spaces["additional"] is None:
        return co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, forces=forces)
    return co.System(co.SO3(), lambda xi, n, nu: 0.5 * (xi @ xi + nu @ nu), additional=co.Defining(), forces=forces)


def run(forces, **more) -> None:
    system = body(forces, **more)
    place = {"q": [0, 0, 0]} if more.get("additional", 0) is not None else {}
    co.simulate(system, system.state(**place), dt=0.1, steps=1)


WRONG = {
    "no function": (3.0, "must be a Python function"),
    "a force instead of a function": (GOOD, "must be a Python function"),
    "two arguments": (lambda motion, p: GOOD, "must take (motion)"),
    "no arguments": (lambda: GOOD, "must take (motion)"),
    "an empty dictionary": ({}, "is empty"),
    "a number as a name": ({1: lambda motion: GOOD}, "must be a word"),
    "a name with a blank": ({"bow thruster": lambda motion: GOOD}, "must be a word"),
    "the name of a line of the budget": ({"time": lambda motion: GOOD}, "must be a word"),
    "a dictionary of numbers": ({"drag": 3.0}, "The force `drag` must be a Python function"),
    "nothing": (lambda motion: None, "must return co.Force(torque=…, force=…), but returned None"),
    "an array": (lambda motion: motion.nu, "but returned an array of shape (3,)"),
    "a dictionary": (lambda motion: {"torque": motion.nu}, "but returned a dict."),
    "a number as a torque": (lambda motion: co.Force(torque=1.0), "torque of co.Force must have shape (3,)"),
    "a short torque": (lambda motion: co.Force(torque=[0, 0]), "torque of co.Force must have shape (3,)"),
    "a column": (lambda motion: co.Force(force=jnp.zeros((3, 1))), "force of co.Force must have shape (3,)"),
    "an empty list": (lambda motion: co.Force(force=[]), "force of co.Force must have shape (3,)"),
    "text": (lambda motion: co.Force(force="north"), "must be an array of numbers, but is 'north'"),
    "a list of arrays of several lengths": (
        lambda motion: co.Force(force=[jnp.zeros(2), 1.0, 2.0]), "must be an array of numbers",
    ),
    "complex numbers": (lambda motion: co.Force(force=1j * jnp.ones(3)), "real numbers, but is one of complex"),
    "truth values": (lambda motion: co.Force(force=motion.nu > 0), "real numbers, but is one of bool"),
    "parts where there are none": (lambda motion: co.Force(force={"a": jnp.zeros(3)}), "one array of shape (3,)"),
    "the wrong one of two": (
        {"drag": lambda motion: GOOD, "jet": lambda motion: co.Force(force=[1.0])},
        "force of co.Force of `jet` must have shape (3,)",
    ),
    "a norm at rest": (
        lambda motion: co.Force(force=-motion.nu * jnp.linalg.norm(motion.nu)),
        "derivative of the function `forces` in the velocities must be finite at the start",
    ),
    "a question about values": (
        lambda motion: co.Force(force=motion.nu if motion.t > 1 else -motion.nu), "write it with jax.numpy",
    ),
    "an error of its own": (lambda motion: co.Force(force=motion.speed), "raised AttributeError"),
}  # fmt: skip


@pytest.mark.parametrize(("forces", "words"), WRONG.values(), ids=WRONG)
def test_what_is_no_force_is_refused_in_one_sentence(forces, words):
    with pytest.raises(co.errors.LagrangianError) as caught:
        run(forces)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_force_on_a_system_without_additional_dynamics_is_refused():
    with pytest.raises(co.errors.LagrangianError, match="this system has no additional dynamics"):
        run(lambda motion: co.Force(force=jnp.zeros(3)), additional=None)


@pytest.mark.cases(1)
@pytest.mark.parametrize("torque", [[0, 0, 1], np.array([0, 0, 1])], ids=["list", "array"])
def test_whole_numbers_are_forces_too(torque):
    system = body(lambda motion: co.Force(torque=torque))
    start = system.state(q=[0, 0, 0])
    found = co.simulate(system, start, dt=0.1, steps=10, monitors=False).final
    assert found.mu == pytest.approx([0, 0, 1], abs=1e-14)


def test_a_force_that_misses_its_inputs_is_named():
    system = body({"drag": lambda motion: GOOD, "jet": lambda motion: co.Force(torque=motion.inputs.jet)})
    by_brackets = body({"jet": lambda motion: co.Force(torque=motion.inputs["jet"])})
    start = system.state(q=[0, 0, 0])
    for integrate, moved, read in (
        (co.simulate, system, "`jet`"),
        (co.trajectory, system, "`jet`"),
        (co.simulate, by_brackets, "an entry"),
    ):
        with pytest.raises(co.errors.LagrangianError, match=f"`jet` reads {read} of None, and the run has no inputs"):
            integrate(moved, start, dt=0.1, steps=1)
