"""Inputs that change within a step: what is flown is the optimum, to second order that of the continuous problem."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import coadjoint as co
from coadjoint.control import End, Input, Measured, Problem, Profile
from control.test_known_optima import ball, cubic, effort

METHODS = [co.Midpoint(), co.Trapezoidal(), co.Suzuki4(co.Midpoint()), co.Galerkin()]


def mass(**more):
    return co.System(
        co.Translation(1), lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(torque=motion.inputs.u), **more
    )


def flown(optimum):
    """The run is the optimum, and its balance closes."""
    assert optimum.difference <= 10 * max(optimum.violation, 1e-13)
    assert optimum.run.largest("balance") <= 1e-13


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.title)
def test_a_linear_input_is_flown_as_it_was_found_by_every_method(method):
    goal = Rotation.from_rotvec([0.5, 1.2, -0.7]).as_matrix()
    sphere = ball()
    optimum = Problem(
        sphere, sphere.state(xi=[0.3, 0.0, 0.1]).replace(t=7.0), dt=0.2, steps=6, method=method, cost=effort,
        inputs={"u": Input((3,), -4.0, 4.0, rate=9.0, course="linear")}, end=End(g=goal, xi=np.zeros(3)),
    ).solve()  # fmt: skip
    flown(optimum)
    u = optimum.inputs["u"]
    assert u.shape == (7, 3) and np.max(np.abs(np.diff(u, axis=0))) <= 9.0 * 0.2 + 1e-8
    np.testing.assert_allclose(optimum.run.final.g, goal, atol=1e-8)
    assert optimum.cost == pytest.approx(np.trapezoid(0.5 * np.sum(u**2, axis=1), dx=0.2), rel=1e-12)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("start", [0.0, 40.0])
def test_the_energy_of_a_profile_is_least_where_a_closed_form_says(start):
    """x'' = a + b (t - t0) from rest to rest over 1 m in 2 s is the least effort: a = 6/T^2, b = -12/T^3."""
    system = mass()
    problem = Problem(
        system, system.state(g=[0.0]).replace(t=start), dt=0.05, duration=2.0,
        inputs={"u": Profile(lambda t, theta: theta[:1] + theta[1:] * (t - start), guess=[0.0, 0.0])},
        cost=lambda motion: 0.5 * motion.inputs.u @ motion.inputs.u, end=End(g=[1.0], xi=[0.0]),
    )  # fmt: skip
    optimum = problem.solve()
    flown(optimum)
    np.testing.assert_allclose(optimum.inputs["u"], [1.5, -1.5], rtol=2e-3)
    assert problem.solve(guess=optimum.run).cost == pytest.approx(optimum.cost, rel=1e-9)


@pytest.mark.long
def test_linear_inputs_follow_the_cubic_to_second_order_and_better_than_held_ones():
    """The cubic on SO(3) between two velocities, by a solver of boundary values, whose ξ' is u: of the trapezoidal
    rule, which samples u at the nodes, u there is of order 2, where held inputs are of order 1."""
    sphere, T, begin, last = ball(), 2.0, np.array([0.6, 0.0, -0.3]), np.array([0.0, 0.8, 0.2])
    goal = Rotation.from_rotvec([0.5, 1.2, -0.7])
    known = cubic(begin, last, goal.as_quat(), T)
    fine = np.linspace(0, T, 20001)
    least = np.trapezoid(0.5 * np.sum(known(fine)[7:10] ** 2, axis=0), fine)

    def errors(course, method, steps):
        optimum = Problem(
            sphere, sphere.state(xi=begin), dt=T / steps, steps=steps, method=method, cost=effort,
            inputs={"u": Input((3,), course=course)}, end=End(g=goal.as_matrix(), xi=last),
        ).solve()  # fmt: skip
        flown(optimum)
        run, u = optimum.run.records, optimum.inputs["u"]
        t = np.asarray(run.t)
        velocity = np.max(np.abs(np.asarray(run.mu) - known(t)[4:7].T))
        return np.array([velocity, np.max(np.abs(u - known(t[: len(u)])[7:10].T)), abs(optimum.cost - least)])

    linear, held = ([errors(course, co.Trapezoidal(), steps) for steps in (10, 20)] for course in ("linear", "held"))
    assert np.log2(linear[0] / linear[1]) == pytest.approx([2, 2, 2], abs=0.15)
    assert np.all(linear[1] < np.array([0.9, 0.1, 0.1]) * held[1])
    middle = [errors("linear", co.Midpoint(), steps) for steps in (10, 20)]
    assert np.log2(middle[0] / middle[1])[[0, 2]] == pytest.approx([2, 2], abs=0.15)


@pytest.mark.long
def test_derivatives_of_an_optimum_with_a_line_and_a_profile_are_those_of_differences():
    system = co.System(
        co.Translation(1), lambda xi, p: 0.5 * p.mass * xi @ xi, parameters={"mass": 1.5},
        forces=lambda motion, p: co.Force(torque=motion.inputs.u + motion.inputs.wave),
    )  # fmt: skip

    def solved(mass):
        here = system.replace(mass=mass)
        return Problem(
            here, here.state(g=[0.0], xi=[0.2]), dt=0.25, steps=8, end=End(g=[1.0], xi=[0.0]),
            inputs={
                "u": Input((1,), course="linear"),
                "wave": Profile(lambda t, theta: theta * jnp.sin(3 * t) * jnp.ones(1), guess=0.1),
            },
            cost=lambda motion, p: motion.inputs.u @ motion.inputs.u + (2 * motion.inputs.wave @ motion.inputs.wave),
        ).solve(tolerance=1e-11)  # fmt: skip

    optimum, e = solved(1.5), 1e-4
    flown(optimum)
    after, before, found = solved(1.5 + e), solved(1.5 - e), optimum.sensitivity("mass")
    assert found.cost["mass"] == pytest.approx((after.cost - before.cost) / (2 * e), rel=1e-5)
    for name in ("u", "wave"):
        slope = (after.inputs[name] - before.inputs[name]) / (2 * e)
        np.testing.assert_allclose(found.inputs[name]["mass"], slope, atol=1e-6)


@pytest.mark.long
def test_the_numbers_of_a_profile_have_the_deviations_of_their_normal_equations():
    system, generator = mass(), np.random.default_rng(5)
    h, steps, sigma = 0.1, 30, 0.02
    waves = [jnp.sin, jnp.cos]
    runs = [
        co.simulate(
            system,
            system.state(g=[0.0]),
            dt=h,
            steps=steps,
            inputs={"u": co.mechanics.Signal(lambda t, w=w: w(t)[None])},
        )
        for w in waves
    ]
    matrix = np.stack([np.asarray(run.records.g)[:, 0] for run in runs], 1)
    seen = matrix @ [0.7, -0.4] + sigma * generator.standard_normal(steps + 1)
    found = Problem(
        system, system.state(g=[0.0]), dt=h, steps=steps,
        inputs={"u": Profile(lambda t, theta: (theta[0] * jnp.sin(t) + theta[1] * jnp.cos(t))[None], [0.0, 0.0])},
        measured={"place": Measured(lambda motion: motion.g, seen[:, None], sigma)},
    ).solve()  # fmt: skip
    np.testing.assert_allclose(found.inputs["u"], np.linalg.lstsq(matrix, seen, rcond=None)[0], atol=1e-8)
    known = sigma * np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    np.testing.assert_allclose(found.deviations()["u"], known, rtol=1e-7)


def given(u, **more):
    system = mass()
    return Problem(system, system.state(g=[0.0]), dt=0.1, steps=5, inputs={"u": u}, cost=effort, **more)


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda: Input((1,), course="cubic"), '"held" or "linear"'),
        (lambda: Profile(1.0, [0.0]), "a function of t and its numbers"),
        (lambda: Profile(lambda t: t, [0.0]), r"must take \(t, theta\)"),
        (lambda: Profile(lambda t, theta: theta, np.zeros((2, 2))), r"be one number or have shape \(m,\)"),
        (lambda: Profile(lambda t, theta: theta, []), r"be one number or have shape \(m,\)"),
        (lambda: Profile(lambda t, theta: theta, "many"), "must be numbers"),
        (lambda: Profile(lambda t, theta: theta, [0.0], lower=[0.0, 1.0]), r"have the shape \(1,\)"),
        (lambda: Profile(lambda t, theta: theta, [0.0], lower=1.0, upper=0.0), "Nothing lies between"),
        (lambda: given(Profile(lambda t, theta: theta / t, [1.0])).solve(), "`u` must be finite at the start"),
        (lambda: given(Profile(lambda t, theta: np.sin(t) * theta, [1.0])).solve(), "`u` cannot be diff"),
        (lambda: given(Profile(lambda t, theta: {"a": theta}, [1.0])).solve(), "`u` must return"),
        (lambda: given(Profile(lambda t, theta: theta, [1.0, 1.0])).solve(), "shape|broadcast"),
        (lambda: given(Input((1,), course="linear")).regulator(), "leave out linear ones"),
        (lambda: given(Profile(lambda t, theta: theta, [1.0])).controller(), "leave out profiles"),
    ],
)
def test_what_is_no_input_is_told_in_one_sentence(ask, words):
    with pytest.raises(co.errors.CoadjointError, match=words) as error:
        ask()
    assert "\n" not in str(error.value)


def test_a_rate_or_a_place_that_cannot_be_reached_is_named():
    far = End(g=[1.0], xi=[0.0])
    with pytest.raises(co.errors.OptimumError, match="most violated: `g` at the end"):
        given(Input((1,), rate=1.0, course="linear"), end=far).solve()
    with pytest.raises(co.errors.OptimumError, match="most violated: "):
        given(Profile(lambda t, theta: theta, [0.1], upper=0.2), end=far).solve()
