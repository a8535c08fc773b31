"""The turn of least effort of a falling cat, against Pontryagin's equations by a solver of boundary values.

Both halves are alike, so that without momentum the cat turns about its spine alone, by an angle θ with θ' = −A(x)·x'.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import least_squares

import coadjoint as co
from coadjoint.models import catalogue, falling_cat

T, WEIGHTS = 0.5, np.array([1.0, 2.0])  # bending to the side costs more than towards the belly
CAT: Any = catalogue["falling_cat"].make(stiffness=0.0)


def pontryagin():
    """Slopes of (θ, x, v, m, p_x, p_v) and their derivatives, the force f, and M(x), as functions of CasADi.

    H = m θ' + p_x·v + p_v·a − ½ f·Wf, with a = M⁻¹(f + ∂K/∂x − ∂²K/∂v∂x v) for K = ½ v·M(x)v at momentum zero.
    """
    import casadi as ca

    arguments = {"w": np.zeros(3), "x": np.full(2, 0.1), "v": np.zeros(2)}
    given = co.control.casadi_function(lambda w, x, v: falling_cat.lagrangian(w, x, v, CAT.parameters), arguments)
    w, x, v, m, px, pv, f = (ca.SX.sym(name, size) for name, size in zip("wxvmpqf", (3, 2, 2, 1, 2, 2, 2), strict=True))
    whole = given(w, x, v)
    spin = -ca.inv(ca.hessian(whole, w)[0]) @ ca.substitute(ca.gradient(whole, w), w, ca.SX.zeros(3))
    K = ca.substitute(whole, w, spin)
    M = ca.hessian(K, v)[0]
    best = ca.inv(M) @ pv / WEIGHTS
    a = ca.inv(M) @ (f + ca.gradient(K, x) - ca.jacobian(ca.gradient(K, v), x) @ v)
    H = m * spin[0] + ca.dot(px, v) + ca.dot(pv, a)
    y = ca.vertcat(ca.SX.sym("theta"), x, v, m, px, pv)
    slope = ca.vertcat(spin[0], v, a, 0, -ca.gradient(H, x), -ca.gradient(H, v))
    slope = ca.substitute(slope, f, best)
    derivatives = ca.Function("J", [y], [ca.jacobian(slope, y)])
    return ca.Function("s", [y], [slope]), derivatives, ca.Function("f", [y], [best]), ca.Function("M", [x, v], [M])


def least_effort(run, forces):
    """½∫f·Wf, and x(t), of the boundary value problem, from an optimum as its first guess."""
    slopes, derivatives, force, inertia = pontryagin()
    t, x = np.asarray(run.t), np.asarray(run.n)
    f = np.stack([np.interp(t, 0.5 * (t[1:] + t[:-1]), column) for column in forces.T], axis=1)
    M = [inertia(place, np.zeros(2)).full() for place in x]
    guess = np.zeros((10, t.size))
    relative = np.diag([1.0, -1.0, -1.0]) @ np.asarray(run.g)
    guess[0], guess[1:3] = np.unwrap(np.arctan2(relative[:, 2, 1], relative[:, 1, 1])), x.T
    guess[3:5] = np.array([np.linalg.solve(a, pi) for a, pi in zip(M, np.asarray(run.pi), strict=True)]).T
    guess[8:10] = np.array([a @ (WEIGHTS * row) for a, row in zip(M, f, strict=True)]).T

    def with_costates(m):
        found = guess.copy()
        found[5] = m
        found[6:8] = slopes(found).full()[8:10] - np.gradient(guess[8:10], t, axis=1)
        return found

    def misfit(m):
        found = with_costates(m)
        return (np.gradient(found[6:8], t, axis=1) - slopes(found).full()[6:8])[:, 3:-3].ravel()

    def jacobian(_, y):
        return derivatives.map(y.shape[1])(y).full().reshape(10, y.shape[1], 10).transpose(0, 2, 1)

    def ends(a, b):
        return np.array([*a[:5], b[0] - np.sign(guess[0, -1]) * np.pi, *b[1:5]])

    first = with_costates(least_squares(misfit, np.zeros(1)).x[0])
    found = solve_bvp(lambda _, y: slopes(y).full(), ends, t, first, fun_jac=jacobian, tol=1e-6, max_nodes=20000)
    assert found.success, found.message
    fine = np.linspace(0, T, 4001)
    return np.trapezoid(0.5 * np.sum(WEIGHTS[:, None] * force(found.sol(fine)).full() ** 2, axis=0), fine), found.sol


def turned(steps):
    """The optimum from upside down to upright, from a turn by springs that carry the bend once round."""
    cat = co.System(
        co.SO3(), falling_cat.lagrangian, additional=co.Trivial(2), parameters=CAT.parameters.asdict(),
        forces=lambda motion, p: co.Force(force=motion.inputs.f),
    )  # fmt: skip
    start = cat.state(g=np.diag([1.0, -1.0, -1.0]), q=[0, 0])
    times = np.linspace(0.0, T, 101)
    course, size = 2 * np.pi * times / T, np.sin(np.pi * times / T) ** 2
    bend = co.Linear(times, size[:, None] * np.stack([np.cos(course), np.sin(course)], axis=1))
    near = co.simulate(
        cat, start, dt=T / steps / 20, steps=20 * steps, save_every=20, monitors=False, accuracy=False,
        inputs={"f": lambda motion: 200.0 * (bend(motion.t) - motion.n) - 2.5 * motion.nu},
    )  # fmt: skip
    return co.control.Problem(
        cat, start, dt=T / steps, steps=steps, inputs={"f": co.control.Input((2,))},
        cost=lambda motion, p: 0.5 * WEIGHTS @ motion.inputs.f**2,
        end=co.control.End(g=np.eye(3), q=[0, 0], qdot=[0, 0]),
    ).solve(guess=near)  # fmt: skip


@pytest.mark.long
def test_a_cat_turns_over_with_the_least_effort_of_a_boundary_value_solver_to_second_order():
    optima = [turned(steps) for steps in (40, 80)]
    least, shape = least_effort(optima[-1].run.records, optima[-1].inputs["f"])
    efforts, ways = [], []
    for optimum in optima:
        run = optimum.run.records
        assert np.max(np.abs(run.mu)) < 1e-8 and np.asarray(run.g[-1]) == pytest.approx(np.eye(3), abs=1e-6)
        efforts.append(optimum.cost - least)
        ways.append(min(np.max(np.abs(run.n.T - side * shape(np.asarray(run.t))[1:3])) for side in (1, -1)))
    for errors in (efforts, ways):
        assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.2)
    assert efforts[-1] < 0.01 * least
