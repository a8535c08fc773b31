"""Optimal motions and controllers next to plain CasADi, written out for the same steps: set up, solved, solved again.

Below these, the spread of the local optima that several guesses lead to.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

import coadjoint as co
from benchmarks.clock import Timing, table_of
from benchmarks.optimal import HAND, TURN, J, problem_of, program_by_hand, step_by_hand
from coadjoint.control import built

STEPS, STAGES, H, GOAL, MOST = 50, 15, 0.1, co.attitude.zyx(1.0, 0.3, -0.2), 2.0
IPOPT = "hand-written CasADi, IPOPT from the last plan"
SQP = "hand-written CasADi, one step of sqpmethod with qrqp"


def measure(quick: bool) -> dict[str, Any]:
    """Processor times, and ratios to the hand-written program in the same repetition."""
    return {
        "solves": _solves(3 if quick else 15),
        "controllers": _controllers(2 if quick else 7, 5 if quick else 30),
        "stages": STAGES,
        "optima": _optima(),
    }


def _timed(function: Callable[[], Any]) -> tuple[Any, float]:
    began = time.process_time()
    found = function()
    return found, time.process_time() - began


def _solver_times() -> list[float]:
    """The processor times of all further calls of solvers, as they come."""
    found, original = [], built.found_by

    def timed(function: Any, *given: Any) -> Any:
        class Solver:
            stats = function.stats

            def __call__(self, **named: Any) -> Any:
                answer, seconds = _timed(lambda: function(**named))
                found.append(seconds)
                return answer

        return original(Solver(), *given)

    built.found_by = timed
    return found


def _solves(times: int) -> dict[str, dict[str, float]]:
    """First solutions of new problems, and second ones for other goals of problems that are built."""
    first: dict[str, list[float]] = {HAND: [], "co.control": [], "co.control, with the run and its certificate": []}
    second: dict[str, list[float]] = {HAND: [], "co.control": [], "its solver alone": []}
    problem, hand, alone = problem_of(STEPS), program_by_hand(STEPS), _solver_times()
    problem.solve()
    for turn in TURN * np.linspace(0.5, 1.0, times)[:, None]:
        goal = co.control.End(g=Rotation.from_rotvec(turn).as_matrix(), mu=np.zeros(3))
        optimum, seconds = _timed(lambda goal=goal: problem.solve(goal=goal))
        answer, by_hand = _timed(lambda turn=turn: hand(turn))
        assert abs(answer["cost"] - optimum.cost) < 1e-8
        values = by_hand, seconds, alone[-1]
        for row, value in zip(second.values(), values, strict=True):
            row.append(value)
        optimum, seconds = _timed(lambda: problem_of(STEPS).solve())
        by_hand = _timed(lambda: program_by_hand(STEPS)(TURN))[1]
        values = by_hand, seconds, seconds + _timed(lambda optimum=optimum: optimum.run)[1]
        for row, value in zip(first.values(), values, strict=True):
            row.append(value)
    tables = {"first": (first, HAND), "again": (second, "its solver alone")}
    return {
        f"{kind}: {name}": row
        for kind, (rows, yardstick) in tables.items()
        for name, row in table_of({name: Timing(tuple(one)) for name, one in rows.items()}, yardstick).items()
    }


def steering() -> tuple[co.System, co.control.Problem]:
    """The body, and the problem of its controller."""
    body = co.System(
        co.SO3(), lambda xi, p: 0.5 * xi @ (p.J * xi), parameters={"J": J},
        forces=lambda motion, p: co.Force(torque=motion.inputs.torque),
    )  # fmt: skip

    def away(motion: Any, p: Any) -> Any:
        between, torque = motion.g - jnp.asarray(GOAL), motion.inputs.torque
        return 10 * jnp.sum(between**2) + motion.xi @ motion.xi + 0.1 * torque @ torque

    return body, co.control.Problem(
        body, body.state(), dt=H, steps=STAGES, method=co.LeftRectangle(),
        inputs={"torque": co.control.Input((3,), lower=-MOST, upper=MOST)}, cost=away, final_cost=away,
    )  # fmt: skip


class ByHand:
    """The same controller by CasADi alone; each call solves from the last plan, one step later."""

    def __init__(self, solver: str, options: dict[str, Any]):
        import casadi as ca

        n, step = STAGES, step_by_hand(ca, H)
        variables, first = ca.MX.sym("variables", 18 * n + 12), ca.MX.sym("first", 12)
        rows = ca.reshape(variables[: 18 * n], 18, n)
        x, u, w = ca.horzcat(rows[:12, :], variables[18 * n :]), rows[12:15, :], rows[15:, :]
        residual, following = step.map(n)(x[:, :-1], u, w)
        node, torque = ca.SX.sym("x", 12), ca.SX.sym("u", 3)
        off = node[:9] - GOAL.T.ravel()
        away = 10 * ca.sumsqr(off) + ca.sumsqr(node[9:] / J) + 0.1 * ca.sumsqr(torque)
        cost = ca.Function("cost", [node, torque], [away])
        f = H / 2 * ca.sum2(cost.map(n)(x[:, :-1], u) + cost.map(n)(x[:, 1:], u)) + cost(x[:, -1], u[:, -1])
        g = ca.vertcat(x[:, 0] - first, ca.vec(residual), ca.vec(following - x[:, 1:]))
        self.solve = ca.nlpsol("mpc", solver, {"x": variables, "f": f, "g": g, "p": first}, options)
        bound = np.full((n, 18), np.inf)
        bound[:, 12:15] = MOST
        self.bound = np.concatenate([bound.ravel(), np.full(12, np.inf)])
        self.w = np.concatenate(
            [np.tile(np.concatenate([np.eye(3).ravel(), np.zeros(9)]), n), np.eye(3).ravel(), [0] * 3]
        )
        self.multipliers: dict[str, Any] = {}

    def __call__(self, R: np.ndarray, mu: np.ndarray) -> np.ndarray:
        """The torque for a state."""
        first = np.concatenate([R.T.ravel(), mu])
        found = self.solve(x0=self.w, p=first, lbx=-self.bound, ubx=self.bound, lbg=0, ubg=0, **self.multipliers)
        w = found["x"].full().ravel()
        self.multipliers = {"lam_x0": found["lam_x"], "lam_g0": found["lam_g"]}
        self.w = np.concatenate([w[18:-12], w[-30:-12], w[-12:]])
        return w[12:15]


def by_ipopt() -> ByHand:
    """To convergence, with a warm start."""
    own = {"print_level": 0, "sb": "yes", "tol": 1e-8, "warm_start_init_point": "yes", "mu_init": 1e-4}
    return ByHand("ipopt", {"ipopt": own, "print_time": False})


def by_sqp() -> ByHand:
    """One quadratic program a call."""
    quiet = {"print_iter": False, "print_header": False, "error_on_fail": False}
    own = {"qpsol": "qrqp", "qpsol_options": quiet, "max_iter": 1, "error_on_fail": False, "print_status": False}
    return ByHand("sqpmethod", own | {"print_header": False, "print_iteration": False, "print_time": False})


def _controllers(times: int, calls: int) -> dict[str, dict[str, float]]:
    """Set-up of new controllers, and a call of each along the same motion."""
    made: dict[str, Callable[[], Any]] = {
        IPOPT: by_ipopt,
        SQP: by_sqp,
        "co.control": lambda: steering()[1].controller(),
    }
    setting: dict[str, list[float]] = {name: [] for name in made}
    calling: dict[str, list[float]] = {name: [] for name in made}
    body, problem = steering()
    problem.controller()
    for _ in range(times):
        steered = {}
        for name, make in made.items():
            steered[name], seconds = _timed(make)
            setting[name].append(seconds)
        stepper = co.Stepper(body, body.state(), dt=H, method=co.LeftRectangle(), inputs={"torque": np.zeros(3)})
        spent = dict.fromkeys(made, 0.0)
        for _ in range(calls):
            state = stepper.state
            R, mu = np.asarray(state.g), np.asarray(state.mu)
            for name in (IPOPT, SQP):
                hand = steered[name]
                spent[name] += _timed(lambda hand=hand, R=R, mu=mu: hand(R, mu))[1]
            answer, seconds = _timed(lambda own=steered["co.control"], state=state: own(state))
            spent["co.control"] += seconds
            stepper.step(answer.command)
        for name, seconds in spent.items():
            calling[name].append(seconds / calls)
    return {
        f"{kind}: {name}": row
        for kind, rows in (("set-up", setting), ("a call", calling))
        for name, row in table_of({name: Timing(tuple(one)) for name, one in rows.items()}, IPOPT).items()
    }


def _optima() -> dict[str, dict[str, float]]:
    """The costs that eight guesses lead to."""
    turn, inertia = problem_of(STEPS), np.array([1.0, 2.0, 3.0])
    turn = replace(turn, duration=None, system=turn.system.replace(J=inertia), method=co.Midpoint())
    cart = co.System(
        co.Translation(2), lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(torque=motion.inputs.push)
    )
    post = co.control.Bounds(lambda motion: jnp.sum((motion.g - jnp.array([1.0, 0.05])) ** 2), 0.16)
    past = co.control.Problem(
        cart, cart.state(g=[0.0, 0.0]), dt=0.1, steps=40, inputs={"push": co.control.Input((2,), -1.0, 1.0)},
        cost=lambda motion: 0.5 * motion.inputs.push @ motion.inputs.push, path={"clear of the post": post},
        end=co.control.End(g=[2.0, 0.0], xi=[0.0, 0.0]),
    )  # fmt: skip
    ends = {"2.5 rad about the third axis": 2.5, "half a turn about it": np.pi, "half a turn less 1e-6": np.pi - 1e-6}
    cases = {
        name: replace(turn, duration=None, end=co.control.End(g=co.attitude.zyx(yaw, 0, 0), xi=np.zeros(3)))
        for name, yaw in ends.items()
    }
    found = {}
    for name, problem in (cases | {"past a post": past}).items():
        guesses = problem.solve(guesses=8).guesses
        costs = {guess: cost for guess, cost in guesses.items() if isinstance(cost, float)}
        found[name] = {
            "first": costs.get("first", float("nan")), "best": min(costs.values()), "worst": max(costs.values()),
            "found": len(costs), "tried": len(guesses),
        }  # fmt: skip
    return found
