"""Discrete Lagrangians in group form: the step of the algebra form, and the rigid body of Moser and Veselov."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.groups.derivative import left_derivative, right_derivative
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.methods.group_variational import LastIncrement
from coadjoint.theory.unreduced import WithKeywords
from discrete import moser_veselov, random_group_system
from stepping import Stepper
from systems import GROUPS, MAPS, generator

H = 0.15
ROUND_OFF = 1e-12
"""Of 1 + the largest entry; both Newton iterations end within 1e-13 of the same solution."""

J = np.diag([1.0, 2.0, 3.5])
CASES = [
    ("SO3 alone", "cayley", False),
    ("SO3", "exponential", True),
    ("SE3", "cayley", True),
    ("SE2", "bent", False),
    ("SL2", "cayley", True),
    ("SO3 on a sphere", "exponential", True),
]


def close(found, expected, name=""):
    size = 1 + np.max(np.abs(expected), initial=0.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUND_OFF * size, err_msg=name)


@pytest.mark.parametrize("name", ["SO3", "SE3", "SL2", "SO3xSE2"])
def test_derivatives_on_a_group_are_those_of_the_chart(name):
    """(dτ⁻¹_ξ)*∂_ξ f(τ(ξ)) = D^R f and (dτ⁻¹_{−ξ})*∂_ξ f(τ(ξ)) = D^L f = Ad*_F D^R f, for a random cubic f."""
    import jax
    import jax.numpy as jnp

    group, random = GROUPS[name], generator("derivatives", name)
    weights = random.normal(size=(group.matrix_size, group.matrix_size))
    tau = co.Cayley()

    def f(F):
        return jnp.sum(weights * group.matrix(F)) ** 3

    def both(xi):
        F = tau.tau(group, xi)
        slope = jax.grad(lambda xi: f(tau.tau(group, xi)))(xi)
        right, left = right_derivative(group, f, F), left_derivative(group, f, F)
        by_chart = (tau.dtau_inverse_dual(group, xi, slope), tau.dtau_inverse_dual(group, -xi, slope))
        return (right, left, left), (*by_chart, group.Ad_dual(F, right))

    for found, expected in zip(*evaluate(both, 0.5 * random.normal(size=group.dim)), strict=True):
        close(found, expected)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("world", "tau", "forced"), CASES)
def test_steps_in_group_form_are_those_in_algebra_form(world, tau, forced):
    """Three steps, so that the chart is centred at increments other than the first."""
    system, start = random_group_system(world, forced)
    group, Q, V = system.places

    def in_algebra(xi, *rest, **time):
        return system.group_lagrangian(MAPS[tau].tau(group, rest[-1] * xi), *rest, **time)

    discrete = WithKeywords(in_algebra, ("t",) if system.takes("t") else ())
    same = co.System(
        group, discrete_lagrangian=discrete, additional=Q, advected=V,
        forces=None, parameters=system.parameters,
    )  # fmt: skip
    unforced = co.System(
        group, group_lagrangian=system.group_lagrangian, additional=Q, advected=V, parameters=system.parameters
    )
    ours = Stepper(unforced, co.methods.GroupVariational(MAPS[tau], start="velocity"), compiled=True).run(start, H, 3)
    theirs = Stepper(same, co.Variational(MAPS[tau], start="velocity"), compiled=True).run(start, H, 3)
    for left, right in zip(ours, theirs, strict=True):
        for name in ("n", "a", "mu", "pi", "t"):
            close(getattr(left.after, name), getattr(right.after, name), name)
        g = [evaluate(group.matrix, leap.after.g) for leap in (left, right)]
        close(*g, name="g")
    energies = [
        evaluate(lambda r, s=s, leap=leap: leap.step.energy(s, r, H), leap.record)
        for s, leap in ((unforced, ours[-1]), (same, theirs[-1]))
    ]
    close(*energies, name="energy")
    if forced:
        pushed = Stepper(system, co.methods.GroupVariational(MAPS[tau], start="velocity"), compiled=True).run(
            start, H, 2
        )
        last = pushed[-1]
        assert evaluate(lambda r, a: last.step.balance(system, r, H, a), last.record, last.after) <= 1e-13


def body_momenta(system, run):
    """μ̂ = FD − DFᵀ of every record, as in the factorisation of Moser and Veselov."""
    return np.array([evaluate(system.group.hat, mu) for mu in run.records.mu])


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("speed", [0.4, 1.2, 2.6])
def test_the_rigid_body_of_moser_and_veselov_keeps_its_integrals_at_large_rotations(speed):
    """μ̂ = (FD − DFᵀ)/h up to the sign of the basis; Ad*_{g⁻¹}μ, |μ|², tr(μ̂²D²) and tr(FD) are integrals."""
    system = moser_veselov(J)
    D = np.asarray(system.parameters.D)
    start = system.state(xi=[0.1, 0.2, speed])
    run = co.simulate(
        system, start, dt=1.0, steps=2000, method=co.methods.GroupVariational(co.Exponential(), "velocity")
    )
    F, M = run.records.memory.F, body_momenta(system, run)
    np.testing.assert_allclose(M, F @ D - D @ F.transpose(0, 2, 1), rtol=0, atol=2e-14)
    for integral in (
        np.einsum("kij,kj->ki", run.records.g, run.records.mu),
        np.trace(M @ M @ D @ D, axis1=1, axis2=2),
        np.trace(F @ D, axis1=1, axis2=2),
    ):
        assert np.max(np.abs(integral - integral[0])) < 1e-12 * np.max(np.abs(integral))
    angles = np.arccos(np.clip(0.5 * (np.trace(F, axis1=1, axis2=2) - 1), -1, 1))
    assert np.max(angles) > 0.9 * speed
    assert np.ptp(run.records.mu[:, 0]) > 0.05 * np.linalg.norm(run.records.mu[0]), "the motion is no fixed point"


@pytest.mark.long
def test_of_several_increments_with_one_momentum_the_continuation_keeps_to_its_own():
    """About a principal axis μ = J sin θ, so θ and π − θ have one momentum: both runs stay at their own angle."""
    system = moser_veselov(J)
    angle = 0.7
    found = []
    for theta in (angle, np.pi - angle):
        start = system.state(xi=[0.0, 0.0, theta])
        run = co.simulate(
            system, start, dt=1.0, steps=50, method=co.methods.GroupVariational(co.Exponential(), "velocity")
        )
        F = run.records.memory.F
        np.testing.assert_allclose(np.arctan2(F[:, 1, 0], F[:, 0, 0]), theta, rtol=0, atol=1e-12)
        found.append(run.records.mu[0])
    np.testing.assert_allclose(found[1], found[0], rtol=0, atol=1e-14)


@pytest.mark.long
def test_the_chart_does_not_change_the_motion():
    system = moser_veselov(J)
    runs = [
        co.simulate(
            system,
            system.state(xi=[0.2, 0.3, 1.5]),
            dt=1.0,
            steps=200,
            method=co.methods.GroupVariational(tau, "velocity"),
        )
        for tau in (co.Exponential(), co.difference_maps.Squared(co.Exponential()))
    ]
    np.testing.assert_allclose(runs[0].records.g, runs[1].records.g, rtol=0, atol=1e-11)


@pytest.mark.long
def test_momenta_may_start_a_run_and_the_velocity_is_newtons_first_guess():
    system = moser_veselov(J)
    method = co.methods.GroupVariational(co.Exponential(), "velocity")
    first = co.simulate(system, system.state(xi=[0.2, 0.3, 0.8]), dt=1.0, steps=3, method=method, monitors=False)
    given = system.state(xi=[0.25, 0.2, 0.9]).replace(mu=first.records.mu[0], from_velocities=False)
    again = co.simulate(
        system, given, dt=1.0, steps=3, method=co.methods.GroupVariational(co.Exponential()), monitors=False
    )
    np.testing.assert_allclose(again.records.g, first.records.g, rtol=0, atol=1e-13)


def test_a_rotation_where_the_legendre_transform_is_singular_is_refused():
    """About a principal axis dμ/dθ = J cos θ vanishes at θ = π/2."""
    system = moser_veselov(J)
    with pytest.raises(co.errors.LagrangianError, match="Legendre transform"):
        co.simulate(
            system, system.state(xi=[0, 0, np.pi / 2]), dt=1.0, steps=3,
            method=co.methods.GroupVariational(co.Exponential(), "velocity"),
        )  # fmt: skip


def test_increments_that_jump_end_the_run_in_a_sentence():
    system = moser_veselov(J)
    method = co.methods.GroupVariational(co.Exponential(), "velocity")
    with pytest.raises(co.errors.StepError, match="increment"):
        co.simulate(system, system.state(xi=[0.1, 2.0, 0.2]), dt=1.0, steps=200, method=method)


def test_a_first_increment_outside_the_chart_is_refused():
    system = moser_veselov(J)
    with pytest.raises(co.errors.ArgumentError, match="first increment"):
        co.simulate(
            system,
            system.state(xi=[0, 0, 4.0]),
            dt=1.0,
            steps=3,
            method=co.methods.GroupVariational(co.Cayley(), "velocity"),
        )


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: co.System(co.SO3(), group_lagrangian=lambda F, n, s, h: 0.0), r"must take \(F, h\)"),
        (lambda: co.System(co.SO3(), group_lagrangian=lambda h, F: 0.0), "in this order"),
        (lambda: co.System(co.SO3()), "needs a `lagrangian`"),
    ],
)
def test_a_function_of_other_arguments_is_refused(make, says):
    with pytest.raises(co.errors.LagrangianError, match=says):
        make()


def test_a_lagrangian_in_one_form_only_says_which_method_it_needs():
    system = moser_veselov(J)
    start = system.state(xi=[0.1, 0.2, 0.3])
    with pytest.raises(co.errors.LagrangianError, match=r"co\.methods\.GroupVariational"):
        co.simulate(system, start, dt=1.0, steps=3, method=co.Midpoint(start="velocity"))
    with pytest.raises(co.errors.LagrangianError, match="discrete_lagrangian"):
        co.simulate(system, start, dt=1.0, steps=3, method=co.Variational(start="velocity"))


@pytest.mark.long
def test_native_code_and_xla_take_the_same_steps():
    system, start = random_group_system("SO3 alone")
    method = co.methods.GroupVariational(co.Cayley(), "velocity")
    runs = [co.simulate(system, start, dt=H, steps=20, method=method, backend=b) for b in ("native", "xla")]
    np.testing.assert_allclose(runs[0].records.g, runs[1].records.g, rtol=0, atol=1e-12)


@pytest.mark.long
def test_the_last_increment_is_kept_where_a_run_goes_on_or_is_resumed(tmp_path):
    """F lives in the memory of the state: stored, resumed, and taken up by a run with the same step."""
    system = moser_veselov(J)
    start, method = system.state(xi=[0.2, 0.1, 2.4]), co.methods.GroupVariational(co.Exponential(), "velocity")
    whole = co.simulate(system, start, dt=1.0, steps=40, method=method)
    first = co.simulate(system, start, dt=1.0, steps=15, method=method)
    rest = co.simulate(system, first.final, dt=1.0, steps=25, method=method)
    np.testing.assert_allclose(rest.final.g, whole.final.g, rtol=0, atol=1e-12)
    co.simulate(system, start, dt=1.0, steps=40, method=method, store=tmp_path / "run")
    stored = co.resume(tmp_path / "run", system)
    np.testing.assert_array_equal(stored.dataset.R.values, whole.records.g)


@pytest.mark.long
def test_the_derivative_of_a_run_is_that_of_its_difference_quotient():
    """By the start's angular velocity, through the chart that is centred at the last increment."""
    import jax
    import jax.numpy as jnp

    system, method = moser_veselov(J), co.methods.GroupVariational(co.Exponential(), "velocity")

    def end(speed):
        start = system.state(xi=jnp.stack([0.3, 0.2, speed]))
        return co.trajectory(system, start, dt=1.0, steps=10, method=method, backend="native").final.mu[0]

    with co.float64():
        slope = float(jax.grad(end)(0.9))
        quotient = float((end(0.9 + 1e-5) - end(0.9 - 1e-5)) / 2e-5)
    assert abs(slope) > 0.1
    np.testing.assert_allclose(slope, quotient, rtol=1e-6)


def test_the_last_increment_is_the_first_one_of_a_run_that_goes_on_with_the_same_step_alone():
    method, system = co.methods.GroupVariational(co.Exponential()), SimpleNamespace(group=co.SO2())
    last = LastIncrement(np.eye(2), np.zeros(1), np.float64(0.1))
    for memory, from_velocities, h in ((last, False, 0.1), (last, True, 0.1), (last, False, 0.2), (None, False, 0.1)):
        state: Any = SimpleNamespace(memory=memory, from_velocities=from_velocities, xi=np.array([0.5]))
        found = method._first(system, state, h)  # pyright: ignore[reportArgumentType]
        goes_on = memory is last and not from_velocities and h == 0.1
        assert (found is last) == goes_on and found.h == h
        assert goes_on or np.arctan2(found.F[1, 0], found.F[0, 0]) == pytest.approx(0.5 * h)
