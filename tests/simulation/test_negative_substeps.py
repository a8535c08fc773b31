"""Substeps that go backwards are refused where forces dissipate, and only there."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.simulation.arguments import SAFE, damping_rate

SUZUKI = co.Suzuki4(co.Midpoint(co.Cayley()))
ALLOWED = co.Suzuki4(co.Midpoint(co.Cayley()), negative_substeps="allow")


def body(forces, rate: float = 0.5) -> tuple[co.System, co.State]:
    p = co.Parameters(inertia=[1.0, 1.5, 2.0], rate=rate)
    system = co.System(
        co.SO3(), lambda xi, n, nu, p: 0.5 * p.inertia @ xi**2 + nu @ nu, additional=co.Defining(), parameters=p,
        forces=forces,
    )  # fmt: skip
    return system, system.state(xi=[0.3, 0.2, 0.1], q=[1, 0, 0], qdot=[0, 0.3, 0])


def linear(motion, p):
    """Every velocity decays as exp(−rate t)."""
    return co.Force(torque=-p.rate * p.inertia * motion.xi, force=-2 * p.rate * motion.nu)


HARMLESS = {
    "no force": None,
    "a spring": lambda motion, p: co.Force(force=-3.0 * motion.n),
    "thrust": lambda motion, p: co.Force(force=jnp.array([1.0, 0, 0]) * jnp.cos(motion.t)),
    "a gyroscope": lambda motion, p: co.Force(torque=jnp.cross(jnp.array([0.0, 0, 3.0]), motion.xi)),
    "a motor that feeds": lambda motion, p: co.Force(torque=0.2 * p.inertia * motion.xi),
}
DISSIPATIVE = {
    "linear": linear,
    "quadratic": lambda motion, p: co.Force(force=co.mechanics.quadratic_drag(0.5, motion.nu)),
    "one axis": lambda motion, p: co.Force(torque=jnp.array([0.0, 0.0, -0.1]) * motion.xi),
    "with thrust": {"drag": linear, "thrust": HARMLESS["thrust"]},
}


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("forces", HARMLESS.values(), ids=HARMLESS)
def test_substeps_that_go_backwards_are_taken_where_nothing_dissipates(forces):
    system, start = body(forces)
    assert not co.simulate(system, start, dt=0.05, steps=5, method=SUZUKI).warnings


@pytest.mark.long
@pytest.mark.parametrize("forces", DISSIPATIVE.values(), ids=DISSIPATIVE)
def test_substeps_that_go_backwards_are_refused_where_forces_dissipate(forces):
    system, start = body(forces)
    for call in (co.simulate, co.trajectory):
        with pytest.raises(co.errors.ArgumentError, match=r"go backwards, by 0\.0329 s, and the forces dissipate"):
            call(system, start, dt=0.05, steps=5, method=SUZUKI)
        call(system, start, dt=0.05, steps=5, method=ALLOWED)
        call(system, start, dt=0.05, steps=5, method=co.methods.LeftRight())
    at_rest = system.state(q=[1, 0, 0])
    with pytest.raises(co.errors.ArgumentError, match="the forces dissipate"):
        co.simulate(system, at_rest, dt=0.05, steps=5, method=SUZUKI)
    fleet = system.replace(rate=co.each([0.5, 1.0]))
    with pytest.raises(co.errors.ArgumentError, match="the forces dissipate"):
        co.simulate(fleet, start, dt=0.05, steps=5, method=SUZUKI)


def test_the_rate_is_that_of_the_fastest_velocity():
    assert damping_rate(*body(linear, 0.7)) == pytest.approx(0.7, rel=1e-12)


@pytest.mark.cases(1)
@pytest.mark.parametrize("product", [0.5, 0.95 * SAFE, 1.9])
def test_up_to_the_safe_product_of_rate_and_substep_the_damping_is_right(product):
    """ξ₃ of a body that turns about its axis decays as exp(−λt): to a few percent a step while λ|γ|h < 1."""
    substep = -min(fraction for _, fraction in SUZUKI.stages)
    system, _ = body(linear, 10.0)
    start = system.state(xi=[0, 0, 0.1], q=[0, 0, 0])
    dt = product / (10.0 * substep)
    run = co.simulate(system, start, dt=dt, steps=2, method=ALLOWED)
    decay = run.final.mu[2] / run.start.mu[2]
    off = abs(decay / np.exp(-20.0 * dt) - 1)
    warned = any("too fast for substeps that go backwards" in sentence for sentence in run.warnings)
    assert warned == (product > SAFE)
    assert off < 0.05 if product < SAFE else off > 5


def test_the_choice_is_one_of_two_words():
    with pytest.raises(co.errors.ArgumentError, match='must be "refuse" or "allow"'):
        co.Suzuki4(co.Midpoint(), negative_substeps="yes")  # pyright: ignore[reportArgumentType]
