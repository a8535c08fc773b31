"""What cannot be stepped, and what cannot be asked of a stepper, is refused with a sentence and changes nothing."""

from __future__ import annotations

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, LagrangianError, StepError
from driven_body import BODY, OBSERVE, REST, START, H, same, stepper

HUGE = 10**400


@pytest.fixture(scope="module")
def single() -> co.Stepper:
    return stepper()


@pytest.fixture(scope="module")
def many() -> co.Stepper:
    return stepper(members=11)


@pytest.fixture(scope="module")
def wheel() -> co.Stepper:
    """With two commands that are numbers, which go into their memory on the fastest way."""
    body = co.System(
        co.SO2(),
        lambda xi, p: 0.5 * p.inertia * xi[0] ** 2,
        parameters=co.Parameters(inertia=2.0),
        forces=lambda motion, p: co.Force(torque=(motion.inputs.left + motion.inputs.right)[None]),
    )
    return co.Stepper(body, body.state(xi=[1.0]), dt=0.1, inputs=("left", "right"))


MADE = [
    ({"dt": -0.1}, "Argument `dt` must be positive"),
    ({"dt": np.nan}, "Argument `dt` must be"),
    ({"inputs": ("spin", "spin")}, "name each command once"),
    ({"inputs": {"spin": "fast"}}, "`spin` is 'fast'"),
    ({"inputs": {"spin": np.nan}}, "must be finite"),
    ({"inputs": {"spin": 1j}}, "command `spin`"),
    ({"inputs": {"spin": HUGE}}, "command `spin`"),
    ({"observe": {"xi": 3}}, "must be a function of the state"),
    ({"observe": ["xi"]}, "must be a dictionary of names"),
    ({"observe": {"bad name": lambda s: s.t}}, "must have a name"),
    ({"observe": {"x": lambda s: s.t / (s.t - s.t)}}, "must be finite at the start"),
    ({"members": 0}, "whole number from 1"),
    ({"threads": 0}, "whole number from 1"),
    ({"backend": "gpu"}, "Argument `backend`"),
    ({"until": 3.0}, "must be a function of the state"),
    ({"method": co.methods.VariableStep()}, "takes steps of dt"),
    ({"method": "rk4"}, "must be a method"),
    ({"changing": "weight"}, "There is no parameter `weight`"),
    ({"changing": 3}, "Argument `changing` must be names of parameters"),
]


@pytest.mark.parametrize(("options", "sentence"), MADE, ids=[sentence for _, sentence in MADE])
def test_what_cannot_be_stepped_is_refused_with_a_sentence(options, sentence):
    with pytest.raises((ArgumentError, LagrangianError), match=sentence):
        stepper(**options)


def test_wrong_calls_get_a_sentence_and_change_nothing(single, many):
    for body in (single, many):
        body.reset()
        body.step()
    kept, kept_many = single.state, many.state
    command = {name: value.copy() for name, value in single.command.items()}
    wrong = [
        (lambda: single.step({"spni": 1.0}), "There is no command `spni`; there is: spin, torque"),
        (lambda: single.step({1: 1.0}), "There is no command `1`"),
        (lambda: single.step({"torque": 1.0}), r"Command `torque` must have shape \(3,\)"),
        (lambda: single.step([1.0, 2.0]), r"must have shape \(4,\), but has shape \(2,\)"),
        (lambda: single.step([[1.0], [2.0, 3.0]]), "The command must be a number or an array of numbers"),
        (lambda: single.step({"spin": 0.7, "torque": "full"}), "must be a number"),
        (lambda: single.step({"spin": 0.7, "torque": [1.0, True, 0.0]}), "must be a number"),
        (lambda: single.step({"spin": 1j}), "must be a number"),
        (lambda: single.step({"spin": True}), "must be a number"),
        (lambda: single.step({"spin": None}), "must be a number"),
        (lambda: single.step({"spin": HUGE}), "must be a number or an array of numbers, but is 1000"),
        (lambda: single.step({"torque": [HUGE, 0, 0]}), "must be a number"),
        (lambda: single.step("full"), "must be a number"),
        (lambda: single.step({"spin": 0.7}, n=0), "Argument `n` must be a whole number"),
        (lambda: single.step(n=1.5), "Argument `n` must be a whole number"),
        (lambda: single.step(n=True), "Argument `n` must be a whole number"),
        (lambda: single.step(n=HUGE), "Argument `n` must be a whole number"),
        (lambda: single.reset(mask=[True]), "single one: leave it out"),
        (lambda: single.reset(seed=3), "Nothing in this system is random"),
        (lambda: single.restore(3.0), "must be what `stepper.state` showed"),
        (lambda: single.restore({"speed": 3.0}), "There is no state `speed`"),
        (lambda: single.restore({"mu": [1.0, np.nan, 0.0]}), "must be finite"),
        (lambda: single.restore(many.state), "must be of 1 members"),
        (lambda: single.restore(many), "clone of it"),
        (lambda: single.change(), "Give at least one parameter"),
        (lambda: single.change(3.0), "Give parameters by their names"),
        (lambda: single.change(mass=3.0), "There is no parameter `mass`"),
        (lambda: single.change(lag=HUGE), "must be a number"),
        (lambda: single.change(lag=np.nan), "must be finite"),
        (lambda: single.change(lag=0.1, keep=np.ones(2)), "Argument `keep`"),
        (lambda: single.save(3), "Argument `path` must be the name of a file"),
        (lambda: co.load_stepper(3), "Argument `path` must be the name of a file"),  # pyright: ignore[reportArgumentType]
        (lambda: many.reset(mask=[1, 0]), "must be truth values"),
        (lambda: many.reset(mask=[[True], [False, True]]), "must be truth values"),
        (lambda: many.reset(seed=[[1], [2, 3]]), "Argument `seed` must be whole numbers"),
        (lambda: many.restore(jax.tree.map(lambda leaf: leaf[:3], many.state)), "must be of 11 members, but is of 3"),
        (lambda: many.step({"spin": np.zeros(3)}), r"must have shape \(11,\)"),
        (lambda: many.step({"spin": ["full"] * 11}), "must be a number"),
        (lambda: many.change(lag=np.ones(3)), "or one for each of 11 members"),
    ]
    for call, sentence in wrong:
        with pytest.raises(ArgumentError, match=sentence) as told:
            call()
        assert len(str(told.value)) < 400
    assert same(single.state, kept)
    assert single.parameters.lag == 0.3
    assert all(np.array_equal(single.command[name], value) for name, value in command.items())
    for ours, theirs in zip(jax.tree.leaves(many.state), jax.tree.leaves(kept_many), strict=True):
        assert np.array_equal(ours, theirs)


@pytest.mark.parametrize("wrong", [1j, True, HUGE, "full", None, [1.0]], ids=lambda value: str(value)[:9])
def test_numbers_in_a_row_are_taken_all_or_none(wheel, wrong):
    wheel.reset()
    wheel.step([0.1, 0.2])
    for command in ([0.5, wrong], {"left": 0.5, "right": wrong}):
        with pytest.raises(ArgumentError):
            wheel.step(command)
        assert (float(wheel.command["left"]), float(wheel.command["right"])) == (0.1, 0.2)
    assert wheel.steps == 1


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_command_that_is_not_finite_is_refused_and_changes_none(wheel, wrong):
    wheel.reset()
    wheel.step([0.1, 0.2])
    for command in ([0.3, wrong], {"left": 0.3, "right": wrong}, {"right": np.array(wrong)}):
        with pytest.raises(ArgumentError, match="Command `right` must be finite, but is"):
            wheel.step(command)
        assert (float(wheel.command["left"]), float(wheel.command["right"])) == (0.1, 0.2)
    wheel.step()
    assert wheel.steps == 2 and wheel.failure is None
    with pytest.raises(StepError):  # finite, though their sum is not
        wheel.step([1e308, 1e308])


def test_whole_numbers_beyond_64_bits_are_numbers(wheel):
    wheel.reset()
    wheel.step({"left": 10**20, "right": -(10**20)})
    assert wheel.state.mu[0] == pytest.approx(2.0)


def test_one_number_for_all_members_may_be_in_brackets():
    body = co.System(
        co.SO2(),
        lambda xi, p: 0.5 * p.inertia * xi[0] ** 2,
        parameters=co.Parameters(inertia=2.0),
        forces=lambda motion, p: co.Force(torque=motion.inputs.torque),
    )
    three = co.Stepper(body, body.state(xi=[1.0]), dt=0.1, inputs={"torque": np.zeros(1)}, members=3)
    for command in (2.0, [2.0], [2.0, 2.0, 2.0], [[2.0], [2.0], [2.0]]):
        three.reset()
        three.step(command)
        np.testing.assert_allclose(three.state.mu, [[2.2]] * 3, rtol=1e-15)


def test_a_start_of_another_system_is_refused():
    other = co.System(co.SO2(), lambda xi, p: 0.5 * p.inertia * xi[0] ** 2, parameters=co.Parameters(inertia=2.0))
    for system, start in [(BODY, other.state(xi=[1.0])), (other, START), (BODY, None), ("body", START)]:
        with pytest.raises(ArgumentError):
            co.Stepper(system, start, dt=H, inputs=REST, observe=OBSERVE)  # pyright: ignore[reportArgumentType]
