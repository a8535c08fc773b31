"""Forces that read the momenta μ and π of the motion: dissipation on coadjoint orbits, and drag in momenta."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import LagrangianError

AXIS = np.array([0.0, 0.0, 1.0])
DAMPING = 0.3


def toward_the_field(motion):
    """The double bracket −α μ × (μ × b), which is normal to μ."""
    return co.Force(torque=-DAMPING * jnp.cross(motion.mu, jnp.cross(motion.mu, AXIS)))


def spin():
    return co.System(co.SO3(), hamiltonian=lambda mu: -mu @ AXIS, forces={"landau_lifshitz": toward_the_field})


def spin_at(t):
    """μ of unit length from the horizontal plane: μ₃ = tanh αt, and an azimuth that grows at unit rate."""
    return np.stack([np.cos(t) / np.cosh(DAMPING * t), np.sin(t) / np.cosh(DAMPING * t), np.tanh(DAMPING * t)], axis=-1)


def error_of_spin(dt):
    system = spin()
    run = co.simulate(
        system, system.state(mu=[1.0, 0.0, 0.0]), dt=dt, duration=4.0, method=co.HamiltonianMidpoint(), accuracy=False
    )
    assert abs(run.dataset.mu.values[0, 0] - 1.0) < 1e-15
    return np.max(np.abs(run.dataset.mu.values - spin_at(run.dataset.time.values)))


def test_landau_lifshitz_follows_its_closed_form_at_second_order():
    coarse, fine = error_of_spin(0.02), error_of_spin(0.01)
    assert fine < 3e-5 and np.log2(coarse / fine) == pytest.approx(2.0, abs=0.05)


def body(forces, **options):
    return co.System(
        co.SO3(),
        lambda xi, n, nu, p: 0.5 * xi @ p.inertia @ xi + 0.5 * p.mass * nu @ nu,
        additional=co.Defining(),
        parameters=co.Parameters(inertia=[[1.0, 0.1, 0], [0.1, 2.0, 0], [0, 0, 3.0]], mass=2.0),
        forces=forces,
        **options,
    )


def by_momenta(motion, p):
    return co.Force(torque=-0.3 * motion.mu, force=-0.2 * motion.pi)


def by_velocities(motion, p):
    return co.Force(torque=-0.3 * p.inertia @ motion.xi, force=-0.2 * p.mass * motion.nu)


DEAR = co.Midpoint(), co.RightRectangle(), co.EnergyMomentum(), co.Galerkin()
METHODS = [co.LeftRectangle(), *(pytest.param(method, marks=pytest.mark.long) for method in DEAR)]


@pytest.mark.long
@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_drag_in_momenta_is_drag_in_velocities(method):
    runs = []
    for force in (by_momenta, by_velocities):
        system = body({"drag": force})
        start = system.state(q=[0, 0, 1], xi=[1.0, -0.5, 0.7], qdot=[0.3, 0.1, 0.2])
        runs.append(co.simulate(system, start, dt=0.05, steps=20, method=method, accuracy=False))
    for name in ("R", "n", "mu", "pi", "work_drag"):
        one, other = (run.dataset[name].values for run in runs)
        np.testing.assert_allclose(one, other, rtol=0, atol=2e-13)


@pytest.mark.long
def test_an_input_reads_the_momenta_of_the_node():
    system = body(lambda motion, p: co.Force(torque=motion.inputs.torque))
    start = system.state(q=[0, 0, 1], xi=[1.0, -0.5, 0.7], qdot=[0, 0, 0])
    held = {"torque": lambda motion: -0.5 * motion.mu}
    run = co.simulate(system, start, dt=0.05, steps=5, inputs=held, accuracy=False)
    np.testing.assert_allclose(run.records.inputs.torque[:5], -0.5 * run.dataset.mu.values[:5], rtol=1e-13)


@pytest.mark.long
def test_momenta_by_xla_are_those_of_native_code():
    system = spin()
    ends = [
        co.simulate(system, system.state(mu=[0.6, 0.0, 0.8]), dt=0.1, steps=5, method=co.HamiltonianMidpoint(),
                    backend=backend, accuracy=False).final.mu
        for backend in ("native", "xla")
    ]  # fmt: skip
    np.testing.assert_allclose(*ends, atol=1e-14)


def test_momenta_of_a_discrete_lagrangian_alone_are_refused():
    with pytest.raises(LagrangianError, match="reads μ or π, but this system has only a discrete Lagrangian"):
        system = co.System(
            co.SO3(), discrete_lagrangian=lambda xi, h: h * 0.5 * xi @ xi, forces=lambda m: co.Force(torque=-m.mu)
        )
        co.simulate(system, system.state(xi=[1.0, 0, 0]), dt=0.1, steps=2)


def test_a_dissipation_function_of_momenta_is_refused():
    with pytest.raises(LagrangianError, match="takes velocities, not μ and π"):
        system = body({"damping": co.mechanics.rayleigh(lambda motion, p: motion.mu @ motion.mu)})
        co.simulate(system, system.state(q=[0, 0, 1], xi=[1.0, 0, 0], qdot=[0, 0, 0]), dt=0.1, steps=2)
