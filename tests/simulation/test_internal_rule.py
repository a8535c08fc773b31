"""What a rule of the internal state declares reaches warnings, datasets and errors; a plain function says nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import LagrangianError, StepError
from coadjoint.mechanics.identity import version


@dataclass(frozen=True)
class Winch(co.mechanics.InternalRule):
    """A cable that is paid out at a constant rate, and is torn at a length."""

    torn: float = np.inf

    def __call__(self, motion: Any, h: Any, p: Any) -> dict[str, Any]:
        length = motion.internal.cable + h * p.rate
        return {"cable": jnp.where(length > self.torn, jnp.nan, length)}

    @property
    def title(self) -> str:
        return "The winch"

    def warnings(self, h: Any, p: Any) -> list[str]:
        return ["The winch is slow."] if h > 0.05 else []

    def failure(self, t: float, h: float) -> str | None:
        return "the cable is torn."

    def report(self, motion: Any, p: Any) -> dict[str, Any]:
        return {"paid_out": 100.0 * motion.internal.cable}

    def limits(self, p: Any) -> dict[str, tuple[float | None, float | None]]:
        return {"cable": (0.0, float(p.length))}


def winch(rule: Any) -> co.System:
    def lagrangian(xi: Any, p: Any) -> Any:
        return 0.5 * p.mass * xi @ xi

    def pull(motion: Any, p: Any) -> co.Force:
        return co.Force(torque=-motion.internal.cable * motion.xi)

    parameters = co.Parameters(mass=1.0, rate=0.1, length=3.0)
    return co.System(co.Translation(2), lagrangian, forces=pull, internal=rule, parameters=parameters)


def ran(rule: Any, dt: float = 0.1) -> Any:
    system = winch(rule)
    return co.simulate(system, system.state(xi=[1.0, 0.0], internal={"cable": 0.2}), dt=dt, duration=1.0)


def test_a_rule_reports_to_datasets_and_warns_on_the_card():
    run = ran(Winch())
    cable = run.dataset.internal_cable
    assert np.allclose(cable, 0.2 + 0.1 * run.dataset.time, atol=1e-15)
    assert np.array_equal(run.dataset.paid_out, 100.0 * cable)
    assert (cable.attrs["low"], cable.attrs["high"]) == (0.0, 3.0)
    assert "The winch is slow." in str(run) and not ran(Winch(), dt=0.05).warnings


def test_a_plain_function_is_a_rule_that_declares_nothing():
    run, plain = ran(Winch()), ran(lambda motion, h, p: Winch()(motion, h, p))
    assert np.array_equal(plain.dataset.internal_cable, run.dataset.internal_cable)
    assert "paid_out" not in plain.dataset and "low" not in plain.dataset.internal_cable.attrs
    assert not plain.warnings


def test_a_rule_tells_why_a_step_failed_and_is_named_where_it_cannot_begin():
    with pytest.raises(StepError, match="the cable is torn"):
        ran(Winch(torn=0.25))
    with pytest.raises(LagrangianError, match="The winch must give finite"):
        ran(Winch(torn=0.1))


class Compass(co.mechanics.InternalRule):
    """What a compass shows: the first axis of the body in the space frame."""

    def __call__(self, motion: Any, h: Any, p: Any) -> dict[str, Any]:
        return {"first": p.gain * motion.g[:, 0]}

    def report(self, motion: Any, p: Any) -> dict[str, Any]:
        return {"second": motion.g[:, 1]}


def compass() -> tuple[co.System, co.State]:
    inertia = np.array([1.0, 2.0, 3.0])
    system = co.System(
        co.SO3(), lambda xi, p: 0.5 * xi @ (inertia * xi), internal=Compass(), parameters=co.Parameters(gain=1.0)
    )
    return system, system.state(xi=[0.3, 0.2, 0.1], internal={"first": [1.0, 0.0, 0.0]})


@pytest.mark.long
def test_what_a_rule_reports_may_read_the_attitude_as_the_rule_does() -> None:
    system, start = compass()
    run = co.simulate(system, start, dt=0.1, steps=3)
    np.testing.assert_allclose(run.dataset["second"], run.records.g[:, :, 1], rtol=1e-15)


@pytest.mark.long
def test_a_rule_that_reads_the_attitude_is_differentiated_by_it_and_its_version_knows_no_attitude() -> None:
    system, start = compass()

    def last(g: Any) -> Any:
        return co.trajectory(system, start.replace(g=g), dt=0.1, steps=2).final.internal.first.sum()

    with co.float64():
        slope = jax.grad(last)(jnp.asarray(start.g))
    turned = start.replace(g=start.g + 1e-6 * np.eye(3))
    difference = (last(turned.g) - last(start.g)) / 1e-6
    np.testing.assert_allclose(np.sum(slope * np.eye(3)), difference, rtol=1e-5)
    assert version(system, turned) == version(system, start)


def test_an_error_inside_a_space_is_not_told_as_a_missing_field_of_the_state(monkeypatch) -> None:
    def act(self: Any, group: Any, g: Any, n: Any) -> Any:
        return jnp.no_such_function(n)

    system = co.System(co.SO3(), lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.Trivial(1))
    start = system.state(xi=[0.1, 0.0, 0.0], q=[1.0], qdot=[0.0])
    monkeypatch.setattr(co.Trivial, "act", act)
    with pytest.raises(AttributeError, match="no_such_function"):
        _ = start.q


def test_rules_and_held_inputs_receive_a_node_motion_and_forces_a_motion() -> None:
    def rule(motion: co.mechanics.NodeMotion, h: Any, p: Any) -> dict[str, Any]:
        return {
            "cable": motion.internal.cable + h * (p.rate if isinstance(motion, co.mechanics.NodeMotion) else jnp.nan)
        }

    def pull(motion: co.mechanics.Motion, p: Any) -> co.Force:
        return co.Force(
            torque=-motion.inputs.brake * motion.xi if isinstance(motion, co.mechanics.Motion) else [jnp.nan, 0]
        )

    def brake(motion: co.mechanics.NodeMotion) -> Any:
        return motion.internal.cable if isinstance(motion, co.mechanics.NodeMotion) else jnp.nan

    system = co.System(
        co.Translation(2), lambda xi, p: 0.5 * xi @ xi, forces=pull, internal=rule, parameters=co.Parameters(rate=0.1)
    )
    start = system.state(xi=[1.0, 0.0], internal={"cable": 0.2}, inputs={"brake": 0.2})
    run = co.simulate(system, start, dt=0.1, steps=3, inputs={"brake": brake}, accuracy=False)
    assert float(run.final.internal.cable) == pytest.approx(0.23) and np.all(run.dataset.inputs_brake > 0.19)
