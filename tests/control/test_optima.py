"""Optimal motions against closed forms and an independent solver of boundary values; what is flown is the optimum."""

from __future__ import annotations

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.spatial.transform import Rotation

import coadjoint as co
import paper_vehicle
from coadjoint.control import Bounds, End, Input, Problem
from coadjoint.control.boundary_conditions import _element, place_of
from coadjoint.kernels.trace.evaluate import evaluate

J = np.diag([1.0, 2.0, 3.0])
T = 5.0


def body():
    return co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ p.J @ xi,
        parameters={"J": J},
        forces=lambda motion, p: co.Force(torque=motion.inputs.torque),
    )


def effort(motion, p):
    return 0.5 * motion.inputs.torque @ motion.inputs.torque


def turning(vector, steps, **more):
    system = body()
    end = End(g=Rotation.from_rotvec(vector).as_matrix(), xi=np.zeros(3))
    return Problem(
        system, system.state(), dt=T / steps, steps=steps, inputs={"torque": Input((3,))}, cost=effort, end=end, **more
    )


def mass(dim=1, **more):
    """A unit mass that is pushed, on ℝⁿ."""
    return co.System(
        co.Translation(dim), lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(torque=motion.inputs.push), **more
    )


@pytest.mark.long
def test_a_turn_about_a_principal_axis_has_the_least_effort_of_the_closed_form_to_second_order():
    """θ̈ = u/J₃ from rest to rest takes ½∫u² = 6 J₃²θ²/T³."""
    least = 6 * 9 * 2.5**2 / T**3
    errors = []
    for steps in (8, 16, 32):
        optimum = turning([0, 0, 2.5], steps).solve()
        errors.append(optimum.cost - least)
        assert optimum.violation < 1e-9 and optimum.difference < 1e-8
    assert np.log2(np.abs(errors[:-1]) / np.abs(errors[1:])) == pytest.approx([2, 2], abs=0.1)
    assert abs(errors[-1]) < 0.01 * least


def least_effort(vector):
    """½∫|u|² of the turn by `vector` by Pontryagin's principle: quaternion, ω and both costates, by collocation."""
    inverse = 1 / np.diag(J)
    goal = Rotation.from_rotvec(vector).as_quat()  # (x, y, z, w)

    def slopes(t, y):
        q, w, pw, pr = y[:4], y[4:7], y[7:10], y[10:13]
        momentum = np.diag(J)[:, None] * w
        u = -inverse[:, None] * pw
        rate = inverse[:, None] * (np.cross(momentum.T, w.T).T + u)
        v, s = q[:3], q[3]
        dq = 0.5 * np.vstack([s * w + np.cross(v.T, w.T).T, -np.sum(v * w, axis=0)])
        weighted = inverse[:, None] * pw
        # d/dw of ⟨J⁻¹p, Jw × w⟩ = ⟨a, Jw × w⟩, a = J⁻¹p:  J(w × a) + a × Jw
        turned = np.diag(J)[:, None] * np.cross(w.T, weighted.T).T + np.cross(weighted.T, momentum.T).T
        return np.vstack([dq, rate, -turned - pr, np.cross(pr.T, w.T).T])

    def ends(a, b):
        start = [a[0], a[1], a[2], a[3] - 1, *a[4:7]]
        return np.array([*start, *(b[:3] - goal[:3]), *b[4:7]])

    t = np.linspace(0, T, 201)
    s = t / T
    turn = Rotation.from_rotvec(np.outer(3 * s**2 - 2 * s**3, vector))
    guess = np.zeros((13, t.size))
    guess[:4] = turn.as_quat().T
    guess[4:7] = np.outer(vector, 6 * s * (1 - s) / T)
    guess[7:10] = -(np.diag(J)[:, None] ** 2) * np.outer(vector, 6 * (1 - 2 * s) / T**2)
    found = solve_bvp(slopes, ends, t, guess, tol=1e-9, max_nodes=20000)
    assert found.success
    fine = np.linspace(0, T, 20001)
    u = inverse[:, None] * found.sol(fine)[7:10]
    return np.trapezoid(0.5 * np.sum(u**2, axis=0), fine)


@pytest.mark.long
def test_a_turn_about_no_principal_axis_has_the_effort_of_a_boundary_value_solver_to_second_order():
    vector = 2.5 * np.array([1, 1, 1]) / np.sqrt(3)
    least = least_effort(vector)
    errors = [turning(vector, steps).solve().cost - least for steps in (16, 32, 64)]
    assert np.log2(np.abs(errors[:-1]) / np.abs(errors[1:])) == pytest.approx([2, 2], abs=0.15)
    assert abs(errors[-1]) < 2e-3 * least


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("method", [co.Suzuki4(co.Midpoint()), co.Galerkin(degree=2), co.LeftRectangle()])
def test_other_methods_find_the_same_turn(method):
    least = 6 * 9 * 2.5**2 / T**3
    optimum = turning([0, 0, 2.5], 20, method=method).solve()
    assert optimum.cost == pytest.approx(least, rel=0.15 if method.order == 1 else 5e-3)
    assert optimum.difference < 1e-8


def test_the_shortest_time_from_rest_to_rest_switches_once():
    """|u| ≤ 1 moves a unit mass by 1 in 2 s: full thrust to the middle, full brake after it."""
    system = mass()
    problem = Problem(
        system, system.state(g=[0.0]), dt=0.1, steps=30, inputs={"push": Input((1,), -1, 1, guess=0.1)},
        cost=lambda motion: 1.0 + 0 * motion.t, end=End(g=[1.0], xi=[0.0]), free_duration=(0.5, 10.0),
    )  # fmt: skip
    optimum = problem.solve()
    assert optimum.duration == pytest.approx(2.0, abs=1e-6) and optimum.cost == pytest.approx(2.0, abs=1e-6)
    push = optimum.inputs["push"][:, 0]
    assert push[:15] == pytest.approx(np.ones(15), abs=1e-5) and push[15:] == pytest.approx(-np.ones(15), abs=1e-5)
    assert optimum.run.records.t[-1] == pytest.approx(2.0, abs=1e-6)


def test_bounds_rates_and_paths_hold_at_every_node():
    system = mass(2)
    centre, radius = np.array([1.0, 0.05]), 0.4

    def clear(motion):
        return jnp.sum((motion.g - centre) ** 2)

    problem = Problem(
        system, system.state(g=[0.0, 0.0]), dt=0.1, duration=4.0,
        inputs={"push": Input((2,), lower=-1.0, upper=[1.0, 0.5], rate=2.0)},
        cost=lambda motion: motion.inputs.push @ motion.inputs.push,
        path={"clear of the post": Bounds(clear, lower=radius**2), "slow": Bounds(lambda motion: motion.xi, -0.9, 0.9)},
        end=End(g=[2.0, 0.0], xi=[0.0, 0.0]),
    )  # fmt: skip
    optimum = problem.solve()
    g, push = np.asarray(optimum.run.records.g), optimum.inputs["push"]
    distance = np.hypot(*(g - centre).T)
    assert np.min(distance) == pytest.approx(radius, abs=1e-6)  # it touches the post, and does not cross it
    assert np.max(push - [1.0, 0.5]) < 1e-7 and np.min(push) > -1 - 1e-7
    assert np.max(np.abs(np.diff(push, axis=0))) / 0.1 < 2.0 + 1e-6
    assert g[-1] == pytest.approx([2.0, 0.0], abs=1e-7)


def thrust(motion, p):
    return 0.5 * motion.inputs.torque @ motion.inputs.torque + 0.005 * motion.inputs.force @ motion.inputs.force


@pytest.mark.long
def test_what_is_flown_keeps_momentum_and_closes_its_balance_and_is_the_optimum():
    vehicle = paper_vehicle.system(
        forces=lambda motion, p: co.Force(torque=motion.inputs.torque, force=motion.inputs.force)
    )
    start = vehicle.state(q=[0, 0, 0], a0=[0, 0, 1])
    turn = co.attitude.zyx(np.pi / 2, 0, 0)
    optimum = Problem(
        vehicle, start, dt=0.1, duration=20.0, inputs={"torque": Input((3,)), "force": Input((3,))},
        cost=thrust,
        end=End(g=turn, q=[5, 0, 0], xi=np.zeros(3), qdot=np.zeros(3)),
    ).solve()  # fmt: skip
    assert optimum.iterations <= 12
    final = optimum.run.final
    assert final.q == pytest.approx([5, 0, 0], abs=1e-8) and np.asarray(final.g) == pytest.approx(turn, abs=1e-9)
    assert float(np.max(optimum.run.dataset.balance_highest)) < 1e-13
    assert optimum.difference < 1e-9
    assert "optimum" in str(optimum) and "Kelvin–Noether" in optimum.run.certificate.long()
    again = Problem(
        vehicle, start, dt=0.1, duration=20.0, inputs={"torque": Input((3,)), "force": Input((3,))},
        cost=thrust,
        end=lambda motion, p: jnp.concatenate([motion.q - jnp.array([5.0, 0, 0]), motion.xi, motion.nu,
                                               co.SO3().vee(jnp.asarray(turn).T @ motion.g)]),
    )  # fmt: skip
    assert again.solve(guess=optimum.run).cost == pytest.approx(optimum.cost, rel=1e-8)


@pytest.mark.long
def test_costates_are_the_derivatives_of_the_least_cost_by_the_state():
    """λ_k = −∂cost/∂x_{k+1} of what is added to x_{k+1} = Φ: here by moving the start."""

    def least(at):
        system = mass()
        return Problem(
            system, system.state(g=[at]), dt=0.1, duration=2.0, inputs={"push": Input((1,))},
            cost=lambda motion: 0.5 * motion.inputs.push @ motion.inputs.push, end=End(g=[1.0], xi=[0.0]),
        ).solve()  # fmt: skip

    optimum, step = least(0.0), 1e-4
    slope = (least(step).cost - least(-step).cost) / (2 * step)
    place = optimum.names.index("g[0]")
    assert abs(optimum.costates[0, place]) == pytest.approx(abs(slope), rel=1e-6)
    assert slope == pytest.approx(-12 / 2**3, rel=1e-2)  # cost = 6 (1 − x)²/T³


def test_a_parameter_is_chosen_with_the_motion():
    """The damping that a passive body needs to have lost three quarters of its speed after 1 s."""
    system = co.System(
        co.Translation(1), lambda xi, p: 0.5 * xi @ xi, parameters={"damping": 1.0},
        forces=lambda motion, p: co.Force(torque=-p.damping * motion.xi),
    )  # fmt: skip
    optimum = Problem(
        system, system.state(g=[0.0], xi=[1.0]), dt=0.01, duration=1.0, parameters={"damping": (0.0, 10.0)},
        final_cost=lambda motion, p: (motion.xi[0] - 0.25) ** 2,
    ).solve()  # fmt: skip
    assert float(optimum.parameters["damping"]) == pytest.approx(np.log(4), abs=1e-4)
    assert float(optimum.run.system.parameters.damping) == float(optimum.parameters["damping"])


@pytest.mark.long
def test_an_actuator_that_lags_is_part_of_the_optimum():
    def rule(motion, h, p):
        late = jnp.exp(-h / p.lag)
        x, u = motion.internal.push, motion.ahead.push
        return {"push": co.mechanics.Course(u + (x - u) * late, u + (x - u) * (1 - late) * p.lag / h)}

    system = co.System(
        co.Translation(1), lambda xi, p: 0.5 * xi @ xi, parameters={"lag": 0.3}, internal=rule,
        forces=lambda motion, p: co.Force(torque=motion.internal.push),
    )  # fmt: skip
    optimum = Problem(
        system, system.state(g=[0.0], internal={"push": np.zeros(1)}), dt=0.05, duration=3.0,
        inputs={"push": Input((1,), -1, 1)}, cost=lambda motion, p: motion.inputs.push @ motion.inputs.push,
        end=End(g=[1.0], xi=[0.0]),
    ).solve()  # fmt: skip
    assert optimum.difference < 1e-8
    assert np.asarray(optimum.run.final.g) == pytest.approx([1.0], abs=1e-8)
    assert np.max(np.abs(np.asarray(optimum.run.records.internal.push)[1:, 0] - optimum.inputs["push"][:, 0])) > 0.1


@pytest.mark.long
def test_another_solver_finds_the_same_optimum():
    problem = turning([0.4, 0.0, 1.0], 12)
    assert problem.solve(solver="fatrop", tolerance=1e-8).cost == pytest.approx(problem.solve().cost, rel=1e-6)


def test_what_has_no_optimum_is_told_with_the_constraint_that_resists():
    system = mass()
    far = Problem(
        system, system.state(g=[0.0]), dt=0.1, duration=1.0, inputs={"push": Input((1,), -1, 1)},
        cost=lambda motion: motion.inputs.push @ motion.inputs.push, end=End(g=[10.0], xi=[0.0]),
    )  # fmt: skip
    with pytest.raises(co.errors.OptimumError, match=r"most violated: .*, by "):
        far.solve()
    endless = Problem(
        system, system.state(g=[0.0]), dt=0.1, duration=1.0, inputs={"push": Input((1,))},
        cost=lambda motion: motion.inputs.push[0],
    )  # fmt: skip
    with pytest.raises(co.errors.OptimumError, match="No optimum was found"):
        endless.solve(max_iterations=50)


@pytest.mark.long
def test_an_end_half_a_turn_away_is_not_taken_for_the_end():
    """The skew part of a rotation by π is zero, too: a pendulum that hangs must not pass for one that stands."""
    pendulum = co.System(
        co.SO2(), lambda xi, a: 0.5 * xi @ xi - a[1], advected=co.Defining(),
        forces=lambda motion: co.Force(torque=motion.inputs.u),
    )  # fmt: skip
    hanging = pendulum.state(a0=[0.0, -1.0])
    problem = Problem(
        pendulum, hanging, dt=0.1, duration=8.0, inputs={"u": Input((1,), -0.6, 0.6)},
        cost=lambda motion: 0.5 * motion.inputs.u @ motion.inputs.u, end=End(g=-np.eye(2), xi=[0.0]),
    )  # fmt: skip
    optimum = problem.solve()
    assert np.asarray(optimum.run.final.g) == pytest.approx(-np.eye(2), abs=1e-7)
    assert optimum.cost > 0.05
    half = turning([0, 0, np.pi - 1e-9], 20).solve()
    assert np.asarray(half.run.final.g) == pytest.approx(np.diag([-1.0, -1.0, 1.0]), abs=1e-7)


def test_a_function_of_the_motion_beside_an_input_is_part_of_the_optimum():
    system = co.System(
        co.Translation(1), lambda xi: 0.5 * xi @ xi,
        forces=lambda motion: co.Force(torque=motion.inputs.push + motion.inputs.spring),
    )  # fmt: skip
    optimum = Problem(
        system, system.state(g=[0.0]), dt=0.05, duration=2.0,
        inputs={"push": Input((1,)), "spring": lambda motion: -0.7 * motion.g},
        cost=lambda motion: motion.inputs.push @ motion.inputs.push, end=End(g=[1.0], xi=[0.0]),
    ).solve()  # fmt: skip
    assert optimum.difference < 1e-8 and np.asarray(optimum.run.final.g) == pytest.approx([1.0], abs=1e-8)
    assert optimum.inputs.keys() == {"push"}


@pytest.mark.long
def test_the_velocities_of_the_start_stay_whatever_mass_is_chosen():
    system = co.System(
        co.Translation(1), lambda xi, p: 0.5 * p.mass * xi @ xi, parameters={"mass": 1.0},
        forces=lambda motion, p: co.Force(torque=motion.inputs.push),
    )  # fmt: skip
    optimum = Problem(
        system, system.state(g=[0.0], xi=[1.0]), dt=0.1, duration=1.0, inputs={"push": Input((1,), -1.0, -1.0)},
        end=End(g=[0.75]), parameters={"mass": (0.4, 3.0)},
    ).solve()  # fmt: skip
    assert float(optimum.parameters["mass"]) == pytest.approx(2.0, abs=1e-6)  # 1 − 1/(2 m) = 0.75
    assert optimum.difference < 1e-8


@pytest.mark.cases(1)
@pytest.mark.parametrize(("times", "told"), [(0.99, False), (1.01, True)])
def test_a_run_that_leaves_the_optimum_by_ten_times_all_violations_is_told_on_the_card(times, told):
    optimum = turning([0, 0, 2.5], 8).solve()

    def card(violation, difference):
        return str(replace(optimum, violation=violation, _fly=lambda: optimum._flown._replace(difference=difference)))

    assert ("leaves the optimum" in card(1e-9, times * 10 * 8 * 1e-9)) == told
    assert "leaves the optimum" not in card(0.0, times * 1e-15)


def test_an_end_where_the_solver_begins_is_told_on_the_card():
    system = mass()
    optimum = Problem(
        system, system.state(g=[0.0]), dt=0.1, duration=1.0, inputs={"push": Input((1,), -9, 9)},
        cost=lambda motion: -motion.inputs.push @ motion.inputs.push,
    ).solve()  # fmt: skip
    assert optimum.iterations > 0 or "stationary" in str(optimum)


def of_two_links():
    """Two bodies with two advected parameters, of which one is left out of starts, and additional dynamics by names."""
    return co.System(
        co.Power(co.SO3(), 2),
        lambda xi, n, nu, a: 0.5 * jnp.sum(xi**2) + 0.5 * jnp.sum(nu.x**2) - jnp.sum(a.down * n.x),
        additional={"x": co.Defining(), "y": co.Defining()},
        advected={"pose": co.spaces.RelativePoses(((0, 1),)), "down": co.Defining()},
    )


def test_a_start_with_several_spaces_is_given_again_at_its_place():
    system, x = of_two_links(), np.arange(6.0)
    turned = Rotation.from_rotvec([[0.1, 0.2, 0.3], [0.5, 0.1, 0]]).as_matrix()
    start = system.state(g=turned, q={"x": x, "y": 2 * x}, a0={"pose": None, "down": [0, 0, 1]})
    again = system.state(**place_of(system, start))
    assert again.a == pytest.approx(start.a, abs=1e-14) and again.n == pytest.approx(start.n, abs=1e-14)


def test_an_end_of_several_links_is_reached_where_each_has_its_attitude():
    """2 (F − e)(F + e)⁻¹ of a rotation by θ is 2 tan(θ/2)."""
    pair = co.System(co.Power(co.SO3(), 2), lambda xi: 0.5 * xi[0] @ xi[0] + 0.5 * xi[1] @ xi[1])
    turned = Rotation.from_rotvec([[0, 0, 0.3], [0.5, 0, 0]]).as_matrix()
    found = evaluate(lambda s: _element(pair, s, pair.state().g), pair.state(g=turned))
    assert found == pytest.approx([0, 0, 2 * np.tan(0.15), 2 * np.tan(0.25), 0, 0], abs=1e-14)
