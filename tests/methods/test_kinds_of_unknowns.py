"""Velocities of one kind do not decide how well those of another are solved for."""

import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels import native, xla
from coadjoint.kernels.evaluate import tabulate
from coadjoint.kernels.program import Code
from coadjoint.mechanics.system import replace_parameters
from coadjoint.methods.program import Constants, StepProgram

H, STEPS = 0.1, 20
INERTIA = np.diag([1.0, 2.0, 3.0])


def prepared(method, lagrangian, xi, speed):
    system = co.System(co.SO3(), lagrangian, additional=co.Trivial(1))
    start = system.state(g=np.eye(3), q=[0.0], xi=xi, qdot=[speed])
    program = StepProgram(replace_parameters(system, None), method)
    return program, Constants(system.parameters, None), method.begin(system, start, H)


def by_native(program, constants, state):
    chunk = native.run(program, constants, state, H, 1, STEPS, monitors=False)
    assert chunk.code is Code.CONVERGED
    return chunk.final, chunk.iterations


def by_numpy(program, constants, state):
    step, iterations = tabulate(lambda c, s, h: xla.step(program, c, s, h), constants, state, np.float64(H)), 0
    for _ in range(STEPS):
        result = step(constants, state, np.float64(H))
        assert result.code == 0
        state, iterations = result.after, iterations + int(result.iterations)
    return state, iterations


BACKENDS = pytest.mark.parametrize("run", [by_native, by_numpy], ids=["native", "xla"])
RULES = pytest.mark.parametrize("method", [co.LeftRectangle(), co.Midpoint()], ids=["left", "midpoint"])


@BACKENDS
@RULES
def test_rotation_does_not_depend_on_the_speed_of_a_slider_it_does_not_feel(method, run):
    """ℓ = ½ξ·Jξ + ½ν²: ξ is the same to the last bit whatever ν is."""

    def lagrangian(xi, n, nu):
        return 0.5 * xi @ INERTIA @ xi + 0.5 * nu @ nu

    slow, few = run(*prepared(method, lagrangian, [1.0, 2.0, 0.5], 1.0))
    fast, many = run(*prepared(method, lagrangian, [1.0, 2.0, 0.5], 1e6))
    np.testing.assert_array_equal(fast.xi, slow.xi)
    assert many == few


@BACKENDS
@pytest.mark.parametrize("speed", [1e2, 1e4])
def test_a_body_that_does_not_turn_is_not_solved_for_below_the_round_off_of_its_advance(speed, run):
    """Along a principal axis of a mass matrix without zeros, Mν × ν is round-off: so is ξ, and every step ends."""
    seed = 3
    print(f"seed {seed}")
    axes = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    mass, inertia = (axes @ np.diag(sizes) @ axes.T for sizes in ([3.0, 2.0, 1.0], [1.0, 2.0, 3.0]))

    def lagrangian(xi, n, nu):
        return 0.5 * xi @ inertia @ xi + 0.5 * nu @ mass @ nu

    system = co.System(co.SO3(), lagrangian, additional=co.Defining())
    start = system.state(g=np.eye(3), q=np.zeros(3), xi=np.zeros(3), qdot=speed * axes[:, 0])
    program = StepProgram(replace_parameters(system, None), co.Midpoint())
    state = co.Midpoint().begin(system, start, H)
    final, iterations = run(program, Constants(system.parameters, None), state)
    assert np.max(np.abs(final.xi)) < 1e-13 * speed**2
    assert iterations <= 5 * STEPS
