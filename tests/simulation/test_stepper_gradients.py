"""The differentiable twin of a stepper: an episode's return and its gradient by all parameters of a controller."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError

PERIODS = 12
SHIP = co.System(
    co.SE2(),
    lambda xi, p: 0.5 * (p.inertia * xi[0] ** 2 + p.mass * (xi[1] ** 2 + 1.6 * xi[2] ** 2)),
    parameters=co.Parameters(inertia=0.8, mass=2.0),
    forces=lambda motion, p: co.Force(
        torque=jnp.stack([motion.internal.rudder * motion.xi[1], motion.inputs.thrust, 0.0]) - 0.3 * motion.xi
    ),
    internal=lambda motion, h, p: {
        "rudder": motion.internal.rudder + 0.4 * (motion.inputs.rudder - motion.internal.rudder)
    },
    name="ship",
)
START = SHIP.state(xi=[0.0, 1.0, 0.1], internal={"rudder": 0.0})


@pytest.fixture(scope="module")
def ship() -> co.Stepper:
    observe = {"turn": lambda s: s.xi[0], "speed": lambda s: s.xi[1], "heading": lambda s: s.g[0][1, 0]}
    return co.Stepper(SHIP, START, dt=0.05, inputs=("rudder", "thrust"), observe=observe)


def control(gains, seen):
    return {
        "rudder": gains[0] * (0.5 - seen["heading"]) - gains[1] * seen["turn"],
        "thrust": gains[2] * (1.5 - seen["speed"]),
    }


def reward(seen):
    return -((seen["heading"] - 0.5) ** 2) - 0.1 * (seen["speed"] - 1.5) ** 2


def stepped(ship, gains) -> float:
    """The return by the stepper itself."""
    seen, total = ship.reset(), 0.0
    for _ in range(PERIODS):
        seen = ship.step({name: float(value) for name, value in control(gains, seen).items()}, n=2)
        total += float(reward(seen))
    return total


def episode(ship, gains, parameters=None):
    """The return by the twin, in a scan."""
    ship.reset()

    def period(state, _):
        state = ship.trajectory(state, control(gains, ship.observe(state, parameters)), 2, parameters=parameters).final
        return state, reward(ship.observe(state, parameters))

    return jnp.sum(jax.lax.scan(period, ship.state, None, PERIODS)[1])


GAINS = np.array([0.8, 0.3, 0.5])


@pytest.mark.long
def test_the_twin_computes_what_the_stepper_computes(ship):
    with co.float64():
        assert float(episode(ship, GAINS)) == pytest.approx(stepped(ship, GAINS), rel=1e-12)
    ship.reset()
    state = ship.state
    for _ in range(5):
        command = control(GAINS, ship.observe(state))
        state = ship.trajectory(state, command, 2).final
        ship.step({name: float(value) for name, value in command.items()}, 2)
    for ours, theirs in zip(jax.tree.leaves(state), jax.tree.leaves(ship.state), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-14)


@pytest.mark.long
def test_the_gradient_by_all_gains_is_that_of_differences_of_the_stepper(ship):
    with co.float64():
        slope = np.asarray(jax.grad(lambda gains: episode(ship, gains))(GAINS))
    step = 1e-5
    differences = [
        (stepped(ship, GAINS + step * e) - stepped(ship, GAINS - step * e)) / (2 * step) for e in np.eye(len(GAINS))
    ]
    np.testing.assert_allclose(slope, differences, rtol=1e-7, atol=1e-9)


@pytest.mark.long
def test_the_gradient_by_a_parameter_of_the_system_too(ship):
    p: Any = SHIP.parameters
    with co.float64():
        slope = float(jax.grad(lambda mass: episode(ship, GAINS, p.replace(mass=mass)))(p.mass))
    returns = []
    for mass in (p.mass - 1e-5, p.mass + 1e-5):
        body = ship.clone()
        body.reset()
        # The start's momenta stay, as in the twin.
        body.change(mass=mass, keep="momentum")
        returns.append(stepped(body, GAINS))
    assert slope == pytest.approx((returns[1] - returns[0]) / 2e-5, rel=1e-6)


def test_wrong_calls_of_the_twin_get_a_sentence(ship):
    ship.reset()
    state = ship.state
    wrong = [
        (lambda: ship.trajectory(START), "that of a single member"),
        (lambda: ship.trajectory(jax.tree.map(jnp.asarray, state)), "must be float64"),
        (lambda: ship.trajectory(state, {"ruder": 1.0}), "no command `ruder`"),
        (lambda: ship.trajectory(state, 1.0), "must be name → value"),
        (lambda: ship.trajectory(state, {"rudder": [1.0, 2.0]}), "must be one number"),
        (lambda: ship.trajectory(state, n=0), "whole number"),
        (lambda: ship.reset(seed=3), "Nothing in this system is random"),
    ]
    for call, sentence in wrong:
        with pytest.raises(ArgumentError, match=sentence):
            call()
