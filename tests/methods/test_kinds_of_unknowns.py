"""Velocities of one kind do not decide how well those of another are solved for."""

from functools import partial

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.newton import solver
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import native, xla
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.copies import replace_parameters
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


@pytest.mark.long
@pytest.mark.cases(2)
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


@pytest.mark.long
@pytest.mark.cases(1)
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
    constants = Constants(system.parameters, None)
    final, iterations = run(program, constants, state)
    assert np.max(np.abs(final.xi)) < 1e-13 * speed**2
    assert iterations <= 5 * STEPS
    watched = native.run(program, constants, state, H, 1, STEPS, monitors=True)
    assert watched.extrema["newton_residual"][1] < 1e-14


def certified(program, constants, state, shift):
    """The Newton residual of the step whose ξ, once solved for, is multiplied by 1 + shift."""
    (stage,) = program.stages

    def residual(constants, state, h):
        root = solver.solve(partial(stage.residual, constants, state, h), stage.guess(constants, state, h), h, (3, 1))
        z = root.unknowns * jnp.array([1 + shift, 1 + shift, 1 + shift, 1.0])
        after = stage.advance(constants, state, h, z, 1.0)
        return stage.certificate(constants, state, h, z, after)["newton_residual"]

    return float(evaluate(residual, constants, state, np.float64(H)))


@pytest.mark.long
@pytest.mark.cases(1)
@RULES
def test_the_residual_of_a_rotation_is_relative_to_its_own_momentum(method):
    """An error of 1e-6 in ξ shows as one, however much momentum a slider has."""

    def lagrangian(xi, n, nu):
        return 0.5 * xi @ INERTIA @ xi + 0.5 * nu @ nu

    for speed in (0.0, 1.0, 1e4):
        assert certified(*prepared(method, lagrangian, [1.0, 2.0, 0.5], speed), 0.0) < 1e-14
        assert 5e-7 < certified(*prepared(method, lagrangian, [1.0, 2.0, 0.5], speed), 1e-6) < 3e-6


@pytest.mark.usefixtures("optimised")
def test_momentum_of_a_body_at_rest_where_forces_balance_is_solved_to_round_off():
    """π is the round-off of spring and weight, which cancel: a residual relative to it would be noise."""

    def lagrangian(xi, n, nu, a):
        return 0.5 * xi @ INERTIA @ xi + nu @ nu - 3.5 * n @ n + 7.0 * n @ a

    system = co.System(co.SO3(), lagrangian, additional=co.Defining(), advected=co.Defining())
    place = [0.1, 0.2, -0.3]
    start = system.state(q=place, xi=[0.3, 1.0, 0.2], a0=place)
    run = co.simulate(system, start, dt=0.05, steps=200)
    assert 0 < np.max(np.abs(run.records.pi)) < 1e-14
    assert run.largest("newton_residual") < 1e-14


def test_momenta_that_cancel_are_solved_to_round_off():
    """π = Mν + Cξ = 0 by the recoil of a turning body: the residual is relative to Cξ, not to what is left."""
    coupling = np.array([[0.1, 0.3, 0.2], [-0.3, 0.2, 0.1], [0.4, 0.5, 0.3]])

    def lagrangian(xi, n, nu):
        return 0.5 * xi @ INERTIA @ xi + nu @ nu + nu @ coupling @ xi

    system = co.System(co.SO3(), lagrangian, additional=co.Defining())
    xi = np.array([0.3, 1.0, 0.2])
    start = system.state(q=[1.0, 1.0, 1.0], xi=xi, qdot=-0.5 * coupling @ xi * (1 + 1e-14))
    run = co.simulate(system, start, dt=0.05, steps=200)
    assert 0 < np.max(np.abs(run.records.pi)) < 1e-13
    assert run.largest("newton_residual") < 1e-14
