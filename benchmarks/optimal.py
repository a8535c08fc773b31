"""Optimal motion beside the same program written by hand: a rigid body turned with least effort, by the left rule.

By hand: CasADi's own variables and IPOPT with exact second derivatives; the steps of the paper for a rigid body, by the
Cayley map, μ_k + h u_k = (dτ⁻¹_{hω})*Jω, μ_{k+1} = Fᵀ(μ_k + h u_k), R_{k+1} = R_k F. Beside it the same problem by
multiple shooting with RK4 and quaternions, as one would write without a group, and by crocoddyl's FDDP, where it is
installed (`pip install crocoddyl`): semi-implicit Euler on its own quaternions, the end by a penalty.
"""

from __future__ import annotations

import importlib.util
import time
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import coadjoint as co
from benchmarks.clock import Contender, interleaved, table_of

J, T, TURN = np.array([1.0, 2.0, 3.0]), 5.0, 2.5 * np.array([1.0, 1.0, 1.0]) / np.sqrt(3)
HAND = "hand-written CasADi, the same steps"
SHOOTING = "hand-written CasADi, RK4 and quaternions"
FDDP = "crocoddyl's FDDP, Euler, the end by a penalty"
PENALTY = 1e7
TOLERANCE = 1e-9


def measure(quick: bool) -> dict[str, Any]:
    """Processor time of stating and solving, by turns; costs and iterations; the invariants between nodes.

    These are |R Rᵀ − e|, and the momentum in space less what the torque has put in, |π_{k+1} − π_k − h R_k u_k|,
    relative to the largest momentum; of RK4, whose torque turns within the step, there is no such sum.
    """
    found: dict[Any, Any] = {}
    for steps in (64, 256) if quick else (64, 256, 1024):
        contenders = {
            HAND: by_hand(steps),
            SHOOTING: by_rk4(steps),
            "co.control": ours(steps),
        }
        if importlib.util.find_spec("crocoddyl") is not None:
            contenders[FDDP] = by_crocoddyl(steps)
        answers = {name: solve() for name, solve in contenders.items()}
        timed = interleaved({name: Contender(solve) for name, solve in contenders.items()}, 2 if quick else 4)
        table = table_of(timed, HAND)
        found[steps] = {name: {**table[name], **answers[name]} for name in contenders}
    return found


def ours(steps: int) -> Any:
    """The problem by the library."""

    def solve() -> dict[str, Any]:
        optimum = problem_of(steps).solve(tolerance=TOLERANCE)
        R = np.asarray(optimum.run.records.g)
        return {
            "cost": optimum.cost, "iterations": optimum.iterations, "solver": optimum.solve_seconds,
            "violation": optimum.violation, "orthogonal": _defect(R),
            "momentum": _momentum(R, np.asarray(optimum.run.records.mu), optimum.inputs["u"], T / steps),
        }  # fmt: skip

    return solve


def problem_of(steps: int) -> co.control.Problem:
    """The problem as it is stated."""
    body = co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ (p.J * xi),
        parameters={"J": J},
        forces=lambda motion, p: co.Force(torque=motion.inputs.u),
    )
    return co.control.Problem(
        body, body.state(), dt=T / steps, steps=steps, method=co.LeftRectangle(),
        inputs={"u": co.control.Input((3,))}, cost=lambda motion, p: 0.5 * motion.inputs.u @ motion.inputs.u,
        end=co.control.End(g=Rotation.from_rotvec(TURN).as_matrix(), mu=np.zeros(3)),
    )  # fmt: skip


def by_hand(steps: int) -> Any:
    """The same program without the library."""
    return partial(_by_hand, steps)


def _by_hand(steps: int) -> dict[str, Any]:
    return program_by_hand(steps)(TURN)


def step_by_hand(ca: Any, h: float) -> Any:
    """A step of the paper for a rigid body, (R by columns and μ, u, ω) to its residual and the next R and μ."""
    R, mu, u, w = ca.SX.sym("R", 9), ca.SX.sym("mu", 3), ca.SX.sym("u", 3), ca.SX.sym("w", 3)
    p = J * w
    left = p + h / 2 * ca.cross(w, p) + h**2 / 4 * w * ca.dot(w, p)
    half = h / 2 * ca.skew(w)
    size = 1 + h**2 / 4 * ca.dot(w, w)
    F = ca.SX.eye(3) + 2 / size * (half + half @ half)
    pushed = mu + h * u
    after = ca.vertcat(ca.vec(ca.reshape(R, 3, 3) @ F), F.T @ pushed)
    return ca.Function("step", [ca.vertcat(R, mu), u, w], [left - pushed, after])


def program_by_hand(steps: int) -> Any:
    """The program with its solver: a turn to its answer."""
    import casadi as ca

    h = T / steps
    step = step_by_hand(ca, h)
    variables = ca.MX.sym("variables", 18 * steps + 12)
    rows = ca.reshape(variables[: 18 * steps], 18, steps)
    x, us, ws = ca.horzcat(rows[:12, :], variables[18 * steps :]), rows[12:15, :], rows[15:, :]
    residual, following = step.map(steps)(x[:, :-1], us, ws)
    goal = ca.MX.sym("goal", 3, 3)
    between = goal.T @ ca.reshape(x[:9, -1], 3, 3)
    end = ca.vertcat(between[2, 1] - between[1, 2], between[0, 2] - between[2, 0], between[1, 0] - between[0, 1]) / 2
    first = np.concatenate([np.eye(3).ravel(), np.zeros(3)])
    g = ca.vertcat(ca.vec(residual), ca.vec(following - x[:, 1:]), x[:, 0] - first, end, x[9:, -1])
    solver = _solver(ca, {"x": variables, "f": h / 2 * ca.sumsqr(us), "g": g, "p": ca.vec(goal)})
    s = np.linspace(0, 1, steps + 1)

    def solve(turn: np.ndarray) -> dict[str, Any]:
        speed = np.outer(6 * s * (1 - s) / T, turn)
        turns = Rotation.from_rotvec(np.outer(3 * s**2 - 2 * s**3, turn)).as_matrix()
        nodes = np.column_stack([turns.transpose(0, 2, 1).reshape(-1, 9), J * speed])
        middle = 0.5 * (speed[1:] + speed[:-1])
        guess = np.concatenate([np.column_stack([nodes[:-1], np.zeros((steps, 3)), middle]).ravel(), nodes[-1]])
        answer, w = _solved(
            solver, guess, lambda w: np.vstack([w[: 18 * steps].reshape(steps, 18)[:, :9], w[-12:-3]]),
            p=Rotation.from_rotvec(turn).as_matrix().T.ravel(),
        )  # fmt: skip
        rows = w[: 18 * steps].reshape(steps, 18)
        x = np.vstack([rows[:, :12], w[18 * steps :]])
        R = np.swapaxes(x[:, :9].reshape(-1, 3, 3), 1, 2)  # by columns
        return answer | {"momentum": _momentum(R, x[:, 9:], rows[:, 12:15], h)}

    return solve


def by_rk4(steps: int) -> Any:
    """The same motion without a group: quaternions by RK4, whose length the program holds at the end alone."""
    return partial(_by_rk4, steps)


def _by_rk4(steps: int) -> dict[str, Any]:
    import casadi as ca

    h = T / steps
    q, w, u = ca.SX.sym("q", 4), ca.SX.sym("w", 3), ca.SX.sym("u", 3)
    rate = ca.vertcat(0.5 * (q[3] * w + ca.cross(q[:3], w)), -0.5 * ca.dot(q[:3], w), (ca.cross(J * w, w) + u) / J)
    state = ca.vertcat(q, w)
    slope = ca.Function("slope", [state, u], [rate])
    k1 = slope(state, u)
    k2 = slope(state + h / 2 * k1, u)
    k3 = slope(state + h / 2 * k2, u)
    k4 = slope(state + h * k3, u)
    step = ca.Function("step", [state, u], [state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])
    variables = ca.MX.sym("variables", 10 * steps + 7)
    rows = ca.reshape(variables[: 10 * steps], 10, steps)
    x, us = ca.horzcat(rows[:7, :], variables[10 * steps :]), rows[7:, :]
    angle = np.linalg.norm(TURN)
    goal = np.sin(angle / 2) * TURN / angle
    first = np.array([0.0, 0, 0, 1, 0, 0, 0])
    g = ca.vertcat(ca.vec(step.map(steps)(x[:, :-1], us) - x[:, 1:]), x[:, 0] - first, x[:3, -1] - goal, x[4:, -1])
    program = {"x": variables, "f": h / 2 * ca.sumsqr(us), "g": g}
    s = np.linspace(0, 1, steps + 1)
    part = angle * (3 * s**2 - 2 * s**3) / 2
    quaternions = np.column_stack([np.outer(np.sin(part), TURN / angle), np.cos(part)])
    nodes = np.column_stack([quaternions, np.outer(6 * s * (1 - s) / T, TURN)])
    guess = np.concatenate([np.column_stack([nodes[:-1], np.zeros((steps, 3))]).ravel(), nodes[-1]])

    def rotations(w: np.ndarray) -> np.ndarray:
        found = np.vstack([w[: 10 * steps].reshape(steps, 10)[:, :4], w[-7:-3]])
        length = np.sum(found**2, axis=1)[:, None, None]
        return (length * Rotation.from_quat(found).as_matrix()).reshape(-1, 9)

    return _solved(_solver(ca, program), guess, rotations)[0]


def by_crocoddyl(steps: int) -> Any:
    """The same motion by differential dynamic programming with pinocchio's quaternions."""
    return partial(_by_crocoddyl, steps)


def _by_crocoddyl(steps: int) -> dict[str, Any]:
    import crocoddyl  # pyright: ignore[reportMissingImports]
    import pinocchio  # pyright: ignore[reportMissingImports]

    h, angle = T / steps, np.linalg.norm(TURN)
    model = pinocchio.Model()
    model.gravity = pinocchio.Motion.Zero()
    joint = model.addJoint(0, pinocchio.JointModelSpherical(), pinocchio.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, pinocchio.Inertia(1.0, np.zeros(3), np.diag(J)), pinocchio.SE3.Identity())
    state = crocoddyl.StateMultibody(model)
    actuation = crocoddyl.ActuationModelFull(state)
    goal = np.concatenate([Rotation.from_rotvec(TURN).as_quat(), np.zeros(3)])
    effort, end = crocoddyl.CostModelSum(state, 3), crocoddyl.CostModelSum(state, 3)
    residuals = crocoddyl.ResidualModelControl(state, 3), crocoddyl.ResidualModelState(state, goal, 3)
    effort.addCost("effort", crocoddyl.CostModelResidual(state, residuals[0]), 1.0)
    end.addCost("end", crocoddyl.CostModelResidual(state, residuals[1]), PENALTY)
    differential = crocoddyl.DifferentialActionModelFreeFwdDynamics
    models = [
        crocoddyl.IntegratedActionModelEuler(differential(state, actuation, cost), dt)
        for cost, dt in ((effort, h), (end, 0.0))
    ]
    first = np.array([0.0, 0, 0, 1, 0, 0, 0])
    solver = crocoddyl.SolverFDDP(crocoddyl.ShootingProblem(first, [models[0]] * steps, models[1]))
    solver.th_stop = 1e-12
    s = np.linspace(0, 1, steps + 1)
    turns = Rotation.from_rotvec(np.outer(3 * s**2 - 2 * s**3, TURN)).as_quat()
    nodes = np.column_stack([turns, np.outer(6 * s * (1 - s) / T, TURN)])
    began = time.perf_counter()
    assert solver.solve(list(nodes), [np.zeros(3)] * steps, 500, False, 1e-9)
    seconds = time.perf_counter() - began
    x, u = np.array(solver.xs), np.array(solver.us)
    R = Rotation.from_quat(x[:, :4]).as_matrix()
    gap = (Rotation.from_quat(x[-1, :4]).inv() * Rotation.from_rotvec(TURN)).magnitude() / angle
    return {
        "cost": 0.5 * h * float(np.sum(u**2)), "iterations": int(solver.iter), "solver": seconds,
        "violation": max(gap, float(np.max(np.abs(x[-1, 4:])))),
        "orthogonal": float(np.max(np.abs(np.linalg.norm(x[:, :4], axis=1) ** 2 - 1))),
        "momentum": _momentum(R, J * x[:, 4:], u, h),
    }  # fmt: skip


def _momentum(R: np.ndarray, mu: np.ndarray, u: np.ndarray, h: float) -> float:
    """The largest |π_{k+1} − π_k − h R_k u_k| beside |π|, π = R μ."""
    pi = np.einsum("kij,kj->ki", R, mu)
    put_in = h * np.einsum("kij,kj->ki", R[:-1], u)
    return float(np.max(np.abs(np.diff(pi, axis=0) - put_in)) / np.max(np.abs(pi)))


def _solver(ca: Any, program: dict[str, Any]) -> Any:
    own = {"print_level": 0, "tol": TOLERANCE, "constr_viol_tol": TOLERANCE, "sb": "yes"}
    return ca.nlpsol("hand", "ipopt", program, {"ipopt": own, "print_time": False})


def _solved(solver: Any, guess: np.ndarray, rotations: Any, **given: Any) -> tuple[dict[str, Any], np.ndarray]:
    began = time.perf_counter()
    found = solver(x0=guess, lbg=0, ubg=0, **given)
    seconds = time.perf_counter() - began
    stats = solver.stats()
    assert stats["success"]
    w = found["x"].full().ravel()
    R = rotations(w).reshape(-1, 3, 3)
    return {
        "cost": float(found["f"]), "iterations": stats["iter_count"], "solver": seconds,
        "violation": float(np.max(np.abs(found["g"].full()))), "orthogonal": _defect(R),
    }, w  # fmt: skip


def _defect(R: np.ndarray) -> float:
    return float(np.max(np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3))))
