"""Any Python function flies, traced where it can be, else from outside; digital effects are what they should be."""

from __future__ import annotations

import math
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.mechanics.internal_state import require_internal
from coadjoint.simulation import driver
from coadjoint.simulation import store as streaming
from coadjoint.simulation.arguments import with_inputs
from coadjoint.simulation.progress import Progress
from coadjoint.spaces.named import Named
from coadjoint_vehicles import Controller, Craft
from coadjoint_vehicles.controllers import Cruise, FunctionController
from coadjoint_vehicles.model.actuators import seen
from remus import remus

DT, VEHICLE = 0.05, remus()


PLAIN = remus(parts=[part for part in VEHICLE.parts if part.name in ("damping", "rudder")])


def fly(controller, duration=10.0, **inputs):
    craft = Craft(PLAIN, controller=controller)
    return co.simulate(craft.system, craft.start(speed=1.5), dt=DT, duration=duration, inputs=inputs or None)


def traceable(feedback, p):
    return {"rudder": jnp.clip(1.2 * (feedback.inputs.heading - feedback.heading) - feedback.omega[2], -0.2, 0.2)}


def with_numpy(feedback, p):
    """The same law as only Python can read it."""
    rudder = 1.2 * float(feedback.inputs.heading - feedback.heading) - float(np.asarray(feedback.omega)[2])
    if abs(rudder) > 0.2:
        rudder = math.copysign(0.2, rudder)
    return {"rudder": rudder}


@pytest.mark.long
def test_a_plain_python_function_with_numpy_flies_as_the_same_law_in_the_native_kernel():
    inside = fly(traceable, heading=0.5)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        outside = fly(with_numpy, heading=0.5)
    assert (inside.plan.backend, outside.plan.backend) == ("native", "xla")
    said = [str(warning.message) for warning in told]
    assert any("The controller `with_numpy` has Python `if`" in sentence and "XLA" in sentence for sentence in said)
    assert not any("primitive" in sentence for sentence in said)
    np.testing.assert_allclose(outside.dataset.q, inside.dataset.q, atol=1e-10)
    np.testing.assert_allclose(outside.dataset.internal_rudder, inside.dataset.internal_rudder, atol=1e-10)


@pytest.mark.long
def test_a_function_may_remember():
    """∫ of the heading error by the controller itself, against the sum over its samples."""

    def steer(feedback, memory, p):
        error = feedback.inputs.heading - feedback.heading
        total = memory.total + 0.1 * error
        return {"rudder": 0.5 * error + 0.1 * total - feedback.omega[2]}, {"total": total}

    run = fly(FunctionController(function=steer, remembers={"total": 0.0}), heading=0.3)
    heading = run.dataset.euler_angles.values[:, 0]
    samples = np.r_[0 : len(heading) : 2]  # At multiples of the period.
    total = run.dataset.internal_controller_value_memory_total.values
    assert run.plan.backend == "native"
    np.testing.assert_allclose(total[samples], np.cumsum(0.1 * (0.3 - heading[samples])), atol=1e-12)


@pytest.mark.long
def test_a_command_is_in_force_the_delay_after_its_sample_and_held_between_samples():
    """The command is the time of the sample: it stays as it is for a period, and begins `delay` after."""
    craft = Craft(
        PLAIN, controller=FunctionController(function=lambda feedback, p: {"rudder": 1e-3 * feedback.t}, period=0.2)
    )
    start = craft.start(speed=1.5)
    for delay in (0.0, 0.15):
        made = co.simulate(craft.system.replace(controller={"delay": delay}), start, dt=DT, duration=4.0).dataset
        t, command = made.time.values, made.internal_controller_value_rudder.values / 1e-3
        sampled = np.unique(np.round(command[command > 0], 9))[1:]  # The first is at the node after the start.
        np.testing.assert_allclose(np.diff(sampled), 0.2, atol=1e-9)
        for moment in sampled[:-1]:
            held = t[np.abs(command - moment) < 1e-9]
            assert held[0] == pytest.approx(moment + delay, abs=1e-9)
            assert held[-1] == pytest.approx(held[0] + 0.2 - DT, abs=1e-9)


@pytest.mark.long
def test_a_flight_that_is_interrupted_goes_on_to_the_same_bits(tmp_path, monkeypatch):
    craft = Craft(VEHICLE, controller=Cruise(delay=0.07, period=0.15))
    start = craft.start(speed=1.5, actuators={"propeller": 12.0})
    given = {"dt": DT, "steps": 10_000, "save_every": 25, "inputs": {"depth": 4.0, "heading": 0.5, "speed": 1.5}}
    whole = co.simulate(craft.system, start, **given)
    monkeypatch.setattr(streaming, "PERIOD", 0.0)
    monkeypatch.setattr(streaming, "BURDEN", 0.0)
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        looks = iter(range(3))

        def advance(self, steps, seconds):
            if next(looks, None) is None:
                raise KeyboardInterrupt

        patched.setattr(Progress, "advance", advance)
        patched.setattr(driver, "PATIENCE", 1e-3)  # short chunks on any machine
        co.simulate(craft.system, start, **given, store=tmp_path / "run")
    assert 0 < len(co.load(tmp_path / "run").dataset.time) < whole.count
    resumed = co.resume(tmp_path / "run", craft.system, inputs=given["inputs"]).dataset
    for name in ("R", "q", "xi", "internal_rudder", "internal_controller_value_memory_depth"):
        np.testing.assert_array_equal(resumed[name].values, whole.dataset[name].values)


class Confused(Controller):
    def steer(self, feedback, memory, own, vehicle):
        return {"rudder": 0.1 if feedback.depth > 2 else 0.0}, {}


@pytest.mark.long
def test_inputs_of_a_wrong_shape_are_told_by_name():
    craft = Craft(VEHICLE, controller=Cruise())
    with pytest.raises(
        ArgumentError, match=r"^The controller `Cruise` failed where of its inputs `depth` has shape \(2,\)"
    ):
        co.simulate(
            craft.system,
            craft.start(speed=1.5),
            dt=DT,
            steps=1,
            inputs={"depth": np.array([1.0, 2.0]), "heading": 0.0, "speed": 1.5},
        )


@pytest.mark.long
def test_a_step_longer_than_the_period_of_the_controller_is_warned_of_on_the_card():
    craft = Craft(PLAIN, controller=FunctionController(function=traceable, period=0.1))
    given = {"start": craft.start(speed=1.5), "steps": 1, "inputs": {"heading": 0.1}}
    slow, fast = (co.simulate(craft.system, dt=dt, **given) for dt in (0.2, 0.1))
    said = "The controller `traceable` looks every 0.1 s, but a step takes 0.2 s: it acts once a step."
    assert any(sentence.startswith(said) for sentence in slow.warnings)
    assert "acts once a step" in " ".join(str(slow).split())
    assert not any("acts once" in sentence for sentence in fast.warnings)


def test_a_controller_that_divides_by_zero_is_named():
    def sinking(feedback, p):
        return {"rudder": feedback.depth / feedback.sink}

    with pytest.raises(
        LagrangianError, match=r"^The controller `sinking`, an actuator or the water of .* finite numbers"
    ):
        fly(sinking, duration=1.0)


@pytest.mark.cases(4)
@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        (lambda feedback, p: {"tail": 0.0}, "has no actuator `tail`"),
        (lambda feedback, p: {"rudder": np.asarray(feedback.omega)}, "takes one number"),
        (lambda feedback, p: {"rudder": float(feedback.heading) / float(feedback.depth)}, "failed for a craft at rest"),
        (lambda feedback, p: 0.3, "must return a dictionary"),
        (lambda feedback: {"rudder": 0.1}, r"must be a function of \(feedback, p\), but takes \(feedback\)"),
        (lambda feedback, p: {"rudder": 1 / 0}, "^The controller failed: ZeroDivisionError"),
        (lambda feedback, p: {"rudder": feedback.headin}, "asks its feedback for `headin`.*did you mean `heading`"),
        (lambda feedback, p: {"rudder": p.rudder.are}, "asks what it is given for `are`.*`area`"),
        (lambda feedback, p: {"rudder": "hard over"}, "commands `rudder` by 'hard over', which is not a number"),
        (Cruise, r"is the class Cruise: give one of them, Cruise\(…\)"),
        (Confused(), "^The controller `Confused` has Python `if`.* jnp.where"),
    ],
)
def test_functions_that_cannot_steer_are_refused_with_a_sentence(function, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        fly(function, duration=1.0)


@pytest.mark.long
@pytest.mark.parametrize("derivative", [jax.grad, lambda f: lambda x: jax.jvp(f, (x,), (1.0,))])
def test_a_run_through_a_controller_in_numpy_has_no_derivative_and_says_so(derivative):
    craft = Craft(PLAIN, controller=with_numpy)
    start = craft.start(speed=1.5)

    def east(area):
        changed = craft.system.replace(rudder={"area": area})
        return co.trajectory(changed, start, dt=DT, steps=2, inputs={"heading": 0.5}).final.q[1]

    with co.float64(), pytest.raises(ArgumentError, match="`with_numpy` is called from outside JAX and has no deriv"):
        derivative(east)(0.02)


@pytest.mark.long
def test_a_controller_in_numpy_that_fails_on_the_way_is_named_and_what_was_computed_is_kept():
    def lost(feedback, p):
        if float(feedback.t) > 0.22:
            raise KeyError("lost")
        return {"rudder": float(feedback.t)}

    with pytest.raises(
        co.errors.StepError, match=r"t = 0\.3 s\): The controller `lost` failed: KeyError: 'lost'"
    ) as caught:
        fly(lost, duration=1.0)
    assert caught.value.run is not None and caught.value.run.count == 6


def test_a_controller_in_numpy_that_returns_no_number_or_other_shapes_is_named():
    craft = Craft(PLAIN)
    start = craft.start(speed=1.5)
    motion = craft.system.motion(start.xi, start.n, start.nu, start.a, start.t, None, start.internal)
    feedback = seen(craft.water, PLAIN, motion, craft.parameters, Named())

    def law(feedback, p):
        turns = {0: 0.1, 1: np.nan, 2: [0.1, 0.2]}
        return {"rudder": turns[int(feedback.t)]}

    controller = FunctionController(function=law)
    with jax.enable_x64(True):
        steer = jax.jit(lambda t: controller.steer(feedback._replace(t=t), {}, {}, PLAIN)[0]["rudder"])
        assert steer(0.0) == 0.1 and controller.failure(0.0, DT) is None
        assert np.isnan(steer(1.0)) and "`law` returned numbers that are not finite" in str(controller.failure(1.0, DT))
        assert np.isnan(steer(2.0)) and "`law` returned other names or shapes" in str(controller.failure(2.0, DT))
        assert controller.failure(3.0, DT) is None


def prepare(controller, **inputs):
    """The checks of co.simulate before the first step; nothing is compiled."""
    craft = Craft(PLAIN, controller=controller)
    require_internal(*with_inputs(craft.system, craft.start(speed=1.5), inputs or None), DT)


@pytest.mark.cases(1)
@pytest.mark.parametrize("law", [traceable, with_numpy])
def test_an_input_that_a_controller_never_reads_is_refused(law):
    prepare(law, heading=0.5)
    with pytest.raises(ArgumentError, match=r"never reads the input `dpeth` \(it reads heading\)"):
        prepare(law, heading=0.5, dpeth=3.0)


def test_an_input_that_a_controller_reads_later_or_with_all_others_is_taken():
    def later(feedback, p):
        return {"rudder": float(feedback.inputs.heading) if float(feedback.t) > 5 else 0.0}

    prepare(later, heading=0.5)
    prepare(lambda feedback, p: {"rudder": sum(feedback.inputs.asdict().values())}, heading=0.1, more=0.2)


@pytest.mark.parametrize(
    ("remembered", "what"), [({"total": 0.0, "x": 1.0}, "returned `x`"), ({}, "not return `total`")]
)
def test_a_memory_of_other_names_than_it_began_with_is_refused(remembered, what):
    def law(feedback, memory, p):
        return {"rudder": 0.1}, remembered

    with pytest.raises(ArgumentError, match=f"The controller `law` .*{what} in its memory"):
        prepare(FunctionController(function=law, remembers={"total": 0.0}))


class Helm(Controller):
    def steer(self, feedback, memory, own, vehicle):
        return {"rudder": 0.1}, {}


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("inputs", ("heading",), "`inputs` of the controller `Wrong` must be a dictionary of units by name"),
        ("memory", {"total": 0.0}, "`memory` of the controller `Wrong` must be a method"),
        ("steer", lambda *given: {"rudder": 0.1}, r"`Wrong` must return \(commands, memory\), but returned dict"),
    ],
)
def test_a_class_of_controllers_that_is_none_is_told_in_one_sentence(name, value, sentence):
    prepare(Helm())
    with pytest.raises(ArgumentError, match=sentence):
        prepare(type("Wrong", (Helm,), {name: value})())
