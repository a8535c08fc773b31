"""Motions in phases: one cut in two is the same, and what joins the two is that of known optima."""

from __future__ import annotations

import math

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad, solve_bvp
from scipy.spatial.transform import Rotation

import coadjoint as co
import paper_vehicle
from coadjoint.control import Bounds, End, Input, Measured, Phases, Problem, Profile


def flown(optimum):
    """The runs are the optimum, and their balances close."""
    assert optimum.difference <= 10 * max(optimum.violation, 1e-13)
    assert all(run.largest("balance") <= 1e-13 for run in optimum.runs.values())


def mass(m=1.0):
    return co.System(
        co.Translation(1), lambda xi, p: 0.5 * p.mass * xi @ xi, parameters={"mass": m},
        forces=lambda motion, p: co.Force(torque=motion.inputs.u),
    )  # fmt: skip


def effort(motion, p):
    return 0.5 * motion.inputs.u @ motion.inputs.u


@pytest.mark.long
def test_a_motion_cut_in_two_is_the_same_motion():
    vehicle = paper_vehicle.system(
        forces=lambda motion, p: co.Force(torque=motion.inputs.torque, force=motion.inputs.force)
    )
    start = vehicle.state(q=[0, 0, 0], xi=[0.1, 0, 0], a0=[0, 0, 1])
    more = {
        "dt": 0.25, "inputs": {"torque": Input((3,)), "force": Input((3,), -80.0, 80.0)},
        "cost": lambda motion, p: motion.inputs.torque @ motion.inputs.torque
        + 0.01 * motion.inputs.force @ motion.inputs.force,
        "path": {"north": Bounds(lambda motion, p: motion.q[1], -0.2, 0.2)},
    }  # fmt: skip
    end = End(g=co.attitude.zyx(1.0, 0, 0), q=[2, 0, 0], xi=np.zeros(3), qdot=np.zeros(3))
    whole = Problem(vehicle, start, steps=16, end=end, **more).solve(tolerance=1e-10)
    cut = Phases(
        {"a": Problem(vehicle, start, steps=6, **more), "b": Problem(vehicle, start, steps=10, end=end, **more)}
    )
    optimum = cut.solve(tolerance=1e-10)
    assert optimum.cost == pytest.approx(whole.cost, rel=1e-9)
    for name, values in whole.inputs.items():
        both = np.concatenate([optimum.inputs["a"][name], optimum.inputs["b"][name]])
        np.testing.assert_allclose(both, values, atol=1e-6)
    np.testing.assert_allclose(optimum.runs["b"].final.g, whole.run.final.g, atol=1e-9)
    assert float(optimum.runs["b"].start.t) == pytest.approx(1.5)
    flown(optimum)
    assert "begins with the momenta of `a`" in str(optimum)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("brake", [1.0, 2.0])
def test_a_switch_between_phases_gives_the_least_time_of_the_closed_form(brake):
    """-b <= u <= 1 over 1 m from rest to rest: T = √(2 (1 + 1/b)), the switch at b/(1 + b) of it, on no grid."""
    system = mass()
    one = {
        "dt": 0.1, "steps": 8,
        "cost": lambda motion, p: 1.0 + 0 * motion.t, "free_duration": (0.05, 5.0),
    }  # fmt: skip
    optimum = Phases({
        "drive": Problem(system, system.state(g=[0.0]), inputs={"u": Input((1,), 0.0, 1.0, guess=0.1)}, **one),
        "stop": Problem(system, system.state(g=[0.0]), inputs={"u": Input((1,), -brake, 0.0)},
                        end=End(g=[1.0], xi=[0.0]), **one),
    }).solve(tolerance=1e-11)  # fmt: skip
    least = math.sqrt(2 * (1 + 1 / brake))
    assert optimum.duration == pytest.approx(least, rel=1e-8)
    assert optimum.durations["drive"] == pytest.approx(least * brake / (1 + brake), rel=1e-5)
    np.testing.assert_allclose(optimum.inputs["drive"]["u"], 1.0, atol=1e-5)
    flown(optimum)


@pytest.mark.long
def test_a_flight_that_drops_its_payload_on_the_way_takes_the_least_effort_of_its_integrals():
    """x' = v, v' = u/m(t) with m = 3 for 1 s and m = 1 for 2 s: over a metre, from rest to rest, the least ½∫u² is
    ½ b·G⁻¹b with G the Gram matrix of 1/m and (T − t)/m, b = (0, 1), and if momentum goes on, of 1 and ∫ds/m."""
    masses, cut, T = (3.0, 1.0), 1.0, 3.0

    def m(t):
        return masses[0] if t < cut else masses[1]

    def reach(t):
        return (cut - t) / masses[0] + (T - cut) / masses[1] if t < cut else (T - t) / masses[1]

    for keep, functions in {
        "velocity": (lambda t: 1 / m(t), lambda t: (T - t) / m(t)),
        "momentum": (lambda t: 1.0, reach),
    }.items():
        gram = [[quad(lambda t, a=a, b=b: a(t) * b(t), 0, T, points=[cut])[0] for a in functions] for b in functions]
        least = 0.5 * np.linalg.inv(gram)[1, 1]
        errors = []
        for steps in (5, 10):
            first, second = (mass(one) for one in masses)
            optimum = Phases(
                {
                    "loaded": Problem(first, first.state(g=[0.0]), dt=cut / steps, steps=steps, cost=effort,
                                      inputs={"u": Input((1,))}),
                    "empty": Problem(second, second.state(g=[0.0]), dt=(T - cut) / (2 * steps), steps=2 * steps,
                                     cost=effort, inputs={"u": Input((1,))}, end=End(g=[1.0], xi=[0.0])),
                },
                keep=keep,
            ).solve()  # fmt: skip
            flown(optimum)
            errors.append(abs(optimum.cost - least) / least)
        assert errors[1] < 3e-3 and math.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)


def two_inertias(J1, J2, keep, goal, T):
    """The least ½∫|u|² of μ' = μ × ξ + u, R' = R ξ̂, μ = J ξ, where J changes at T/2, by Pontryagin's principle:
    u = −p, p' = p × ξ − J⁻¹(p × μ + m), m' = m × ξ, on both halves at once, by a solver of boundary values."""
    inverses = np.linalg.inv(J1), np.linalg.inv(J2)
    B = np.eye(3) if keep == "momentum" else J2 @ inverses[0]

    def half(y, inverse):
        q, mu, p, m = y[:4], y[4:7], y[7:10], y[10:13]
        xi = inverse @ mu
        dq = 0.5 * np.vstack([q[3] * xi + np.cross(q[:3].T, xi.T).T, -np.sum(q[:3] * xi, axis=0)])
        dp = np.cross(p.T, xi.T).T - inverse @ (np.cross(p.T, mu.T).T + m)
        return np.vstack([dq, np.cross(mu.T, xi.T).T - p, dp, np.cross(m.T, xi.T).T])

    def slopes(s, y):
        return T / 2 * np.vstack([half(y[:13], inverses[0]), half(y[13:26], inverses[1]),
                                  np.sum(y[7:10] ** 2 + y[20:23] ** 2, axis=0)[None] / 2])  # fmt: skip

    def ends(a, b):
        joint = [b[:4] - a[13:17], B @ b[4:7] - a[17:20], b[7:10] - B.T @ a[20:23], b[10:13] - a[23:26]]
        return np.concatenate([a[:3], [a[3] - 1], a[4:7], b[13:16] - goal[:3], b[17:20], *joint, a[26:]])

    s = np.linspace(0, 1, 41)
    guess = np.zeros((27, s.size))
    vector = Rotation.from_quat(goal).as_rotvec()
    for first, begin in ((0, 0.0), (13, 0.5)):
        tau = begin + s / 2
        guess[first : first + 4] = Rotation.from_rotvec(np.outer(3 * tau**2 - 2 * tau**3, vector)).as_quat().T
        guess[first + 4 : first + 7] = np.outer(J1 @ vector, 6 * tau * (1 - tau) / T)
    found = solve_bvp(slopes, ends, s, guess, tol=1e-8, max_nodes=20000)
    assert found.success
    return found.y[26, -1], found.y[4:7, -1]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("keep", ["velocity", "momentum"])
def test_a_slew_that_changes_its_inertia_is_that_of_a_boundary_value_solver_to_second_order(keep):
    J1, J2, T = np.diag([1.0, 2.0, 3.0]), np.diag([1.5, 0.7, 1.1]), 2.0
    goal = Rotation.from_rotvec([0.5, 1.2, -0.7])
    least, momentum = two_inertias(J1, J2, keep, goal.as_quat(), T)
    errors = []
    for steps in (6, 12):
        bodies = [
            co.System(co.SO3(), lambda xi, p: 0.5 * xi @ p.J @ xi, parameters={"J": J},
                      forces=lambda motion, p: co.Force(torque=motion.inputs.u)) for J in (J1, J2)
        ]  # fmt: skip
        more = {"dt": T / (2 * steps), "steps": steps, "inputs": {"u": Input((3,))}, "cost": effort}
        optimum = Phases({
            "first": Problem(bodies[0], bodies[0].state(), **more),
            "second": Problem(bodies[1], bodies[1].state(), end=End(g=goal.as_matrix(), xi=np.zeros(3)), **more),
        }, keep=keep).solve()  # fmt: skip
        flown(optimum)
        there = np.asarray(optimum.runs["first"].final.mu)
        errors.append([abs(optimum.cost - least) / least, np.max(np.abs(there - momentum))])
    assert np.log2(np.array(errors[0]) / errors[1]) == pytest.approx([2, 2], abs=0.25)
    assert errors[1][0] < 0.02 and errors[1][1] < 0.02


@pytest.mark.long
def test_a_shared_parameter_a_total_time_and_other_kinds_of_inputs_go_over_the_joint():
    system = mass(2.0)
    more = {"dt": 0.1, "steps": 10, "parameters": {"mass": (0.5, 4.0)}, "free_duration": (0.2, 5.0)}
    optimum = Phases(
        {
            "line": Problem(system, system.state(g=[0.0], xi=[0.3]), cost=effort, end=End(g=[0.4]),
                            inputs={"u": Input((1,), course="linear")}, method=co.Trapezoidal(), **more),
            "wave": Problem(system, system.state(g=[0.0]), end=End(g=[1.0], xi=[0.0]), cost=effort,
                            inputs={"u": Profile(lambda t, theta: theta[0] + theta[1:] * t, [0.1, 0.0])},
                            final_cost=lambda motion, p: (p.mass - 1.0) ** 2, **more),
        },
        shared=("mass",), total_duration=(3.0, 3.0),
    ).solve()  # fmt: skip
    flown(optimum)
    assert optimum.duration == pytest.approx(3.0, abs=1e-9)
    assert optimum.parameters["line"]["mass"] == pytest.approx(optimum.parameters["wave"]["mass"], abs=1e-12)
    assert float(optimum.runs["line"].final.g[0]) == pytest.approx(0.4, abs=1e-8)
    speed = float(optimum.runs["line"].final.mu[0]) / float(optimum.parameters["line"]["mass"])
    assert float(optimum.runs["wave"].start.xi[0]) == pytest.approx(speed, rel=1e-12)
    assert optimum.costs["line"] + optimum.costs["wave"] == pytest.approx(optimum.cost)
    assert "parameter mass" in str(optimum)


def test_velocities_go_on_whatever_mass_is_chosen():
    """Braked by 1 N the cart goes 1 − 1/(2 m) = 0.75 m in 1 s if its speed is 1 m/s at first."""
    one, two = mass(1.0), mass(1.2)
    optimum = Phases(
        {
            "free": Problem(one, one.state(g=[-0.5], xi=[1.0]), dt=0.1, steps=5, inputs={"u": Input((1,), 0.0, 0.0)}),
            "push": Problem(two, two.state(g=[0.0]), dt=0.1, steps=10, inputs={"u": Input((1,), -1.0, -1.0)},
                            parameters={"mass": (0.4, 3.0)}, end=End(g=[0.75])),
        },
        keep="velocity",
    ).solve()  # fmt: skip
    assert float(optimum.parameters["push"]["mass"]) == pytest.approx(2.0, abs=1e-6)
    assert float(optimum.runs["push"].start.mu[0]) == pytest.approx(2.0, abs=1e-6)
    flown(optimum)


def phase(system=None, **more):
    system = mass() if system is None else system
    given = {"dt": 0.1, "steps": 4, "inputs": {"u": Input((1,), -1.0, 1.0)}, "cost": effort}
    return Problem(system, system.state(g=[0.0]), **(given | more))


def pair(one=None, two=None, **more):
    system = mass()
    one, two = (phase(system, **(given or {})) if not isinstance(given, Problem) else given for given in (one, two))
    return Phases({"one": one, "two": two}, **more)


PLANE = co.System(
    co.SE2(), lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(torque=motion.inputs.u * jnp.ones(3))
)


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda: Phases([phase(), phase()]), "dictionary of name"),
        (lambda: Phases({"one": phase()}), "two phases at least"),
        (lambda: Phases({"one": phase(), "two": phase()}), 'keep="momentum" or keep="velocity"'),
        (lambda: pair(keep="energy"), "each of the 1 joints"),
        (lambda: pair(keep=["momentum", "velocity"]), "each of the 1 joints"),
        (lambda: pair(two=Problem(PLANE, PLANE.state(), dt=0.1, steps=2, inputs={"u": Input()})), "another group"),
        (lambda: pair(two={"free_start": {"g": 1.0}}), "the first phase alone"),
        (lambda: pair({"free_duration": (0.1, 1.0)},
                      {"measured": {"g": Measured(lambda motion, p: motion.g, np.zeros((5, 1)), 1.0)}}), "fix it"),
        (lambda: pair(two={"method": co.LeftRectangle(start="velocity")}), 'start="momentum"'),
        (lambda: pair(shared=("mass",)), "fewer than two phases"),
        (lambda: pair(shared="mass"), "must be names"),
        (lambda: pair(total_duration=3.0), "shortest, longest"),
        (lambda: pair(total_duration=(2.0, 3.0)), "the phases last 0.8 to 0.8 s"),
        (lambda: pair().solve(guess={"three": "simulate"}), "dictionary of phases"),
        (lambda: pair().solve(guess="nearly"), '"interpolate" or "simulate"'),
        (lambda: pair().solve(solver="newton"), 'must be "ipopt" or "fatrop"'),
        (lambda: pair(two={"end": End(g=[9.0])}).solve(), "most violated: `g` at the end of phase `two`, by"),
    ],
)  # fmt: skip
def test_what_are_no_phases_is_told_in_one_sentence(ask, words):
    with pytest.raises(co.errors.CoadjointError, match=words) as error:
        ask()
    assert "\n" not in str(error.value)
