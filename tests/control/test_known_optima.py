"""Optimal motions whose least time, or whose equations by Pontryagin's principle, are known: by closed forms, from the
literature, or by a solver of boundary values that knows nothing of the library."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.spatial.transform import Rotation

import coadjoint as co
from coadjoint.control import End, Input, Problem


def by_input(motion):
    return co.Force(torque=motion.inputs.u)


def effort(motion):
    return 0.5 * motion.inputs.u @ motion.inputs.u


def mass():
    return co.System(co.Translation(1), lambda xi: 0.5 * xi @ xi, forces=by_input)


def ball():
    return co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, forces=by_input)


def quickest(system, start, end, steps, low, high, longest, **more):
    return Problem(
        system, start, dt=1.0 / steps, steps=steps,
        inputs={"u": Input((np.size(low),), low, high, guess=0.1)},
        cost=lambda motion: 1.0 + 0 * motion.t, end=end, free_duration=(0.1, longest), **more,
    )  # fmt: skip


@pytest.mark.cases(1)
@pytest.mark.parametrize(("steps", "far", "most"), [(20, 1.0, 1.0), (21, 1.0, 1.0), (31, 3.0, 0.5)])
def test_the_shortest_time_between_rests_is_twice_the_root_of_distance_over_acceleration(steps, far, most):
    """T = 2√(d/u), and of an odd number N of steps, whose middle one has the switch within, T √(1 + 1/(N² − 1))."""
    system = mass()
    optimum = quickest(system, system.state(g=[0.0]), End(g=[far], xi=[0.0]), steps, -most, most, 20.0).solve()
    least = 2 * np.sqrt(far / most)
    discrete = least if steps % 2 == 0 else least * np.sqrt(1 + 1 / (steps**2 - 1))
    assert optimum.duration == pytest.approx(discrete, rel=1e-7)
    half, u = steps // 2, optimum.inputs["u"][:, 0]
    assert u[:half] == pytest.approx(np.full(half, most), abs=1e-5)
    assert u[-half:] == pytest.approx(np.full(half, -most), abs=1e-5)


def test_weaker_thrust_than_brake_switches_later():
    """−2 ≤ u ≤ 1: T = √(2d(1 + 1/2)), and the switch is at two thirds of it, here within a step."""
    system, steps = mass(), 40
    optimum = quickest(system, system.state(g=[0.0]), End(g=[1.0], xi=[0.0]), steps, [-2.0], [1.0], 20.0).solve()
    assert optimum.duration == pytest.approx(np.sqrt(3.0), rel=1e-3) and optimum.duration > np.sqrt(3.0)
    between = np.flatnonzero((optimum.inputs["u"] > -1.999) & (optimum.inputs["u"] < 0.999))
    assert between.tolist() == [26]  # 26/40 < 2/3 < 27/40


def test_the_quickest_plane_turn_takes_twice_the_root_of_inertia_times_angle():
    J, angle = 2.5, 1.7
    system = co.System(
        co.SO2(), lambda xi: 0.5 * J * xi @ xi, forces=by_input
    )  # fmt: skip
    goal = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    problem = quickest(
        system, system.state(), End(g=goal, xi=[0.0]), 20, -1.0, 1.0, 20.0, method=co.Midpoint(co.Exponential())
    )
    assert problem.solve().duration == pytest.approx(2 * np.sqrt(J * angle), rel=1e-7)


@pytest.mark.long
def test_the_quickest_half_turn_with_three_bounded_torques_nutates():
    """A sphere with |u_i| ≤ J turns by 180° from rest to rest in 3.2431 s by five switches, not in the 2√π s of a turn
    about one axis: Bilimoria and Wie, Time-optimal three-axis reorientation of a rigid spacecraft, JGCD 16 (1993)."""
    sphere = ball()
    times = []
    for steps in (30, 60):
        h, s = 3.3 / steps, (np.arange(steps) + 0.5) / steps
        middle = np.where(np.abs(s - 0.5) < 0.25, -1, 1)
        signal = co.Held(h * np.arange(steps), np.stack([middle, -middle * np.sign(s - 0.5), -np.sign(s - 0.5)], 1))
        near = co.simulate(
            sphere, sphere.state(), dt=h, steps=steps, inputs={"u": lambda motion, h=h, u=signal: u(motion.t + h / 2)},
            monitors=False, accuracy=False,
        )  # fmt: skip
        end = End(g=np.diag([-1.0, -1.0, 1.0]), xi=np.zeros(3))
        optimum = quickest(sphere, sphere.state(), end, steps, -np.ones(3), np.ones(3), 8.0).solve(guess=near)
        times.append(optimum.duration)
        assert np.count_nonzero(np.diff(np.sign(optimum.inputs["u"]), axis=0)) == 5
    assert times[1] < times[0] < 2 * np.sqrt(np.pi)
    assert (4 * times[1] - times[0]) / 3 == pytest.approx(3.2431, abs=3e-4)  # of order 2 in h


def cubic(start_velocity, end_velocity, goal, T):
    """ξ, its slope and its second derivative on [0, T], of the cubic on SO(3): R' = Rξ̂, ξ''' = ξ'' × ξ."""

    def slopes(t, y):
        v, s, xi, curve = y[:3], y[3], y[4:7], y[10:13]
        dq = 0.5 * np.vstack([s * xi + np.cross(v.T, xi.T).T, -np.sum(v * xi, axis=0)])
        return np.vstack([dq, y[7:10], curve, np.cross(curve.T, xi.T).T])

    def ends(a, b):
        return np.array([*a[:3], a[3] - 1, *(a[4:7] - start_velocity), *(b[:3] - goal[:3]), *(b[4:7] - end_velocity)])

    t = np.linspace(0, T, 101)
    s, vector = t / T, Rotation.from_quat(goal).as_rotvec()
    guess = np.zeros((13, t.size))
    guess[:4] = Rotation.from_rotvec(np.outer(3 * s**2 - 2 * s**3, vector)).as_quat().T
    guess[4:7] = np.outer(start_velocity, 1 - s) + np.outer(end_velocity, s) + np.outer(vector, 6 * s * (1 - s) / T)
    found = solve_bvp(slopes, ends, t, guess, tol=1e-10, max_nodes=50000)
    assert found.success
    return found.sol


@pytest.mark.long
def test_the_least_acceleration_between_two_velocities_is_the_cubic_to_second_order():
    """½∫|ξ'|² is least on ξ''' = ξ'' × ξ (Noakes, Heinzinger and Paden 1989): by p' = −m, m' = m × ξ and ξ' = p."""
    sphere = ball()
    T, begin, last = 2.0, np.array([0.6, 0.0, -0.3]), np.array([0.0, 0.8, 0.2])
    goal = Rotation.from_rotvec([0.5, 1.2, -0.7])
    known = cubic(begin, last, goal.as_quat(), T)
    fine = np.linspace(0, T, 20001)
    least = np.trapezoid(0.5 * np.sum(known(fine)[7:10] ** 2, axis=0), fine)
    costs, velocities = [], []
    for steps in (10, 20, 40):
        optimum = Problem(
            sphere, sphere.state(xi=begin), dt=T / steps, steps=steps, inputs={"u": Input((3,))},
            cost=effort, end=End(g=goal.as_matrix(), xi=last),
        ).solve()  # fmt: skip
        run = optimum.run.records
        costs.append(abs(optimum.cost - least))
        velocities.append(np.max(np.abs(np.asarray(run.mu) - known(np.asarray(run.t))[4:7].T)))
    for errors in (costs, velocities):
        assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2, 2], abs=0.15)
    assert costs[-1] < 1e-3 * least and velocities[-1] < 1e-3


@pytest.mark.long
def test_between_the_velocities_of_a_geodesic_the_cubic_is_the_geodesic():
    sphere = ball()
    xi = np.array([0.4, -0.9, 0.6])
    optimum = Problem(
        sphere, sphere.state(xi=xi), dt=0.1, steps=20, inputs={"u": Input((3,), guess=0.3)},
        method=co.Midpoint(co.Exponential()), cost=effort,
        end=End(g=Rotation.from_rotvec(2.0 * xi).as_matrix(), xi=xi),
    ).solve()  # fmt: skip
    assert optimum.iterations > 0 and optimum.cost < 1e-12
    middle = np.asarray(optimum.run.records.g)[10]
    assert middle == pytest.approx(Rotation.from_rotvec(1.0 * xi).as_matrix(), abs=1e-7)
