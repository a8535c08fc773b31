"""Parts of controllers and estimators, evaluated without a solver: plans, guesses, refusals and counts of calls."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import numpy as np
import pytest

from coadjoint.control import Input, free_duration, guess
from coadjoint.control.expansion import Expanding
from coadjoint.control.free_duration import FreeDurationController
from coadjoint.control.given import with_previous
from coadjoint.control.least_squares_cost import squares
from coadjoint.control.linearised import LinearSteps, Simulated
from coadjoint.control.mpc_solution import Record
from coadjoint.control.predictive import Controller
from coadjoint.control.requirements import require_convex
from coadjoint.errors import ArgumentError


def made(kind: type, **given: Any) -> Any:
    found = object.__new__(kind)
    found.__dict__.update(given)
    return found


def test_the_last_failure_is_kept_and_calls_are_counted_by_their_status():
    record = Record()
    for status, sentence, seconds in (("solved", "", 1.0), ("failed", "no step", 2.0), ("solved", "", 4.0)):
        record.note(
            cast(
                Any,
                SimpleNamespace(status=status, sentence=sentence, preparation_seconds=0.0, feedback_seconds=seconds),
            )
        )
    assert record.last_failure == "no step" and record.feedback == [1.0, 2.0, 4.0]
    assert record.rows()[0] == ("calls", "3: 2 solved, 1 failed")


def window(H: object) -> Any:
    columns = [SimpleNamespace(name=name, begin=slice(k, k + 1)) for k, name in enumerate("abc")]
    return SimpleNamespace(
        of_disturbances=lambda: np.array(H, float),
        free=np.array([0, 2]),
        transcription=SimpleNamespace(columns=columns),
    )


@pytest.mark.parametrize("H", [[[1e-14, 0], [0, 1.0]], [[np.nan, 0], [0, -1.0]], np.zeros((0, 0)), [[2, 1], [1, 2]]])
def test_a_cost_that_grows_with_every_disturbance_in_its_unit_is_convex(H):
    require_convex(window(H))


@pytest.mark.parametrize(("H", "name"), [([[1.0, 0], [0, 0]], "c"), ([[-1e-9, 0], [0, 5.0]], "a")])
def test_a_disturbance_that_costs_nothing_or_gains_is_named(H, name):
    with pytest.raises(ArgumentError, match=f"every number of input `{name}`"):
        require_convex(window(H))


@pytest.mark.parametrize(("bounded", "kept"), [(True, 2.5), (False, 0.0)])
def test_the_multiplier_of_the_terminal_set_is_the_last_and_not_negative(bounded, kept):
    expanding = made(Expanding, _bounded=bounded)
    expanding.note(np.array([9.0, 2.5]))
    assert expanding.multiplier == kept
    expanding.note(np.array([9.0, -2.5]))
    assert expanding.multiplier == 0.0


@dataclass(frozen=True)
class Data:
    inputs: dict[str, object]
    duration: float | None = 1.0


def test_inputs_with_a_bound_or_cost_of_changes_or_a_linear_course_count_from_their_guess():
    inputs = {
        "free": Input((2,), guess=[1.0, 2.0]), "one rate": Input((2,), guess=[3.0, 4.0], rate=[np.inf, 1.0]),
        "cost": Input((), guess=5.0, change_cost=0.1), "linear": Input((), guess=6.0, course="linear"),
        "known": Input((), guess=7.0, rate=1.0, previous=8.0), "signal": np.sin,
    }  # fmt: skip
    found = with_previous(cast(Any, Data(inputs)))
    previous = {name: getattr(one, "previous", None) for name, one in found.inputs.items()}
    assert previous.pop("free") is None and previous.pop("signal") is None and found.duration is None
    assert {name: np.ravel(one).tolist() for name, one in previous.items()} == {
        "one rate": [3.0, 4.0], "cost": [5.0], "linear": [6.0], "known": [8.0],
    }  # fmt: skip


def test_a_sum_of_squares_has_its_residual_and_only_of_a_function():
    cost = squares(lambda motion: np.array([[1.0, 2.0], [motion, 0.0]]))
    assert float(cost(3.0)) == 14.0 and cast(Any, cost).residual(3.0).shape == (2, 2)
    with pytest.raises(ArgumentError, match="`function` must be a function of the motion, but is 3"):
        squares(cast(Any, 3.0))


# A free duration.


class Program(NamedTuple):
    bounds: Any


def controller(optima: dict[str, Any], log: list[Any], **more: Any) -> Any:
    """The optimum of each guess by its name; a plan that begins with 9 misses its end."""

    def optimum(solver, program, start, numbers):
        log.append((solver, start, [side.tolist() for side in program.bounds], numbers))
        return optima[start]

    given: dict[str, Any] = {
        "_predicted": lambda measured, clock: np.array([7.0]), "delay": 3, "_plan": None, "_violated": "x",
        "problem": SimpleNamespace(dt=0.5, end=None), "_program": Program((np.zeros(3), np.ones(3))),
        "_with_previous": lambda row: row, "_solvers": ("near", "far"), "_later": lambda begin, first: "later",
        "_from_afar": lambda first: iter(["guess", "other"]), "_optimum": optimum,
        "_transcription": SimpleNamespace(violated=lambda w: "miss" if w[0] == 9 else "", split=lambda w: w),
        "_keep": lambda w, begin: log.append((w.tolist(), begin)),
    }  # fmt: skip
    return made(FreeDurationController, **given | more)


def test_a_plan_is_sought_from_the_last_one_and_from_afar_where_that_fails_or_misses_its_end(monkeypatch):
    monkeypatch.setattr(free_duration, "misses_end", lambda violated: violated == "miss")
    good, worse, missing = (2.0, np.array([1.0])), (3.0, np.array([2.0])), (2.5, np.array([9.0]))
    clock = SimpleNamespace(t=10.0, inputs=["old", "new"])
    bounds = [[7.0, 0.0, 0.0], [7.0, 1.0, 1.0]]
    log: list[Any] = []
    assert controller({"later": good}, log, _plan="there")._iterate(None, clock) == ""
    assert log == [("near", "later", bounds, "new"), ([1.0], 11.5)]
    log.clear()
    assert controller({"guess": worse}, log)._iterate(None, clock) == "" and log[0][:2] == ("far", "guess")
    log.clear()
    optima = {"later": missing, "guess": good, "other": worse}
    assert controller(optima, log, _plan="there")._iterate(None, clock) == ""
    assert [one[1] for one in log[:-1]] == ["later", "guess"] and log[-1][0] == [1.0]
    log.clear()
    assert controller(optima, log, _plan="there", _violated="miss")._iterate(None, clock) == "" and len(log) == 2
    log.clear()
    told = controller(dict.fromkeys(optima), log, _plan="there")._iterate(None, clock)
    assert told == "the solver found no optimum from this state; a soft `end` can always be planned" and len(log) == 3


# Nodes that follow from inputs.


@pytest.mark.parametrize("first", [0, 1])
def test_nodes_follow_from_inputs_until_a_step_has_no_solution(first):
    """x⁺ = x + h u, z = the guess + 1; there is no step with u = 9."""

    def step(x, u, z, p, h):
        return None if u[0] == 9.0 else (x + h * u, z + 1.0)

    lengths = np.array([1.0, 0.5, 0.25])
    follower = made(Controller, _expanding=SimpleNamespace(lengths=lambda left: lengths), _simulated=step, _p=None)
    x, z, u = np.zeros((4, 1)), np.array([[5.0], [6.0], [7.0]]), np.array([[1.0], [2.0], [4.0]])
    assert follower._follow(x, u, z, 3, first)
    assert x[:, 0].tolist() == ([0.0, 1.0, 2.0, 3.0] if first == 0 else [0.0, 0.0, 1.0, 2.0])
    assert z[:, 0].tolist() == ([6.0, 7.0, 8.0] if first == 0 else [5.0, 6.0, 7.0])
    u[1] = 9.0
    assert not follower._follow(x, u, z, 3)
    assert x[:, 0].tolist() == [0.0, 1.0, 1.0, 1.0]


@pytest.mark.parametrize("nz", [0, 1])
def test_a_step_is_found_by_newtons_iteration(nz):
    """z² = u, x⁺ = x + h z."""

    def tables(x, u, z, p, h):
        return np.atleast_2d(z[:nz] ** 2 - u), np.atleast_2d(x + h * (z if nz else u)), np.atleast_2d(2 * z)

    step = made(Simulated, _tables=tables, _nz=nz)
    after, z = step(np.array([1.0]), np.array([4.0]), np.array([3.0]), None, 0.5)
    assert after == pytest.approx([2.0 if nz else 3.0], rel=1e-10) and z == pytest.approx([2.0 if nz else 3.0])
    if nz:
        assert step(np.array([1.0]), np.array([-1.0]), np.array([3.0]), None, 0.5) is None
        assert step(np.array([1.0]), np.array([4.0]), np.zeros(1), None, 0.5) is None
    assert step(np.array([np.inf]), np.array([4.0]), np.array([3.0]), None, 0.5) is None


@pytest.mark.parametrize("nz", [0, 1])
def test_unknowns_of_linear_steps_are_eliminated(nz):
    """r = rz z + rw w + r₀ = 0, a = az z + aw w + a₀."""
    random = np.random.default_rng(2)
    rz, rw, r, az, aw, after = (
        random.normal(size=shape) for shape in ((2, nz, nz), (2, nz, 3), (2, nz, 1), (2, 2, nz), (2, 2, 3), (2, 2, 1))
    )
    tables = r, after, rw, rz, aw, az
    steps = made(LinearSteps, _tables=lambda *given: tables, _shapes=[one.shape for one in tables])
    found = steps(*[None] * 5)
    w = random.normal(size=(2, 3, 1))
    z = -np.linalg.solve(rz, rw @ w + r) if nz else np.zeros((2, 0, 1))
    assert found.M @ w + found.c[:, :, None] == pytest.approx(az @ z + aw @ w + after)
    assert found.E @ w + found.e[:, :, None] == pytest.approx(-z)


# Guesses.


def test_a_run_gives_its_inputs_of_the_same_shape_as_a_guess(monkeypatch):
    t = np.arange(4.0)
    inputs = SimpleNamespace(names=("a", "b"))
    run: Any = SimpleNamespace(
        records=SimpleNamespace(t=t, inputs=None, places="places"),
        system=SimpleNamespace(inputs=inputs, inputs_at=None),
    )
    values = {"a": np.ones((4, 2, 2)), "b": 2 * np.ones((4, 3)), "d": t}
    monkeypatch.setattr(guess, "evaluate", lambda function, *given: SimpleNamespace(asdict=lambda: values))
    monkeypatch.setattr(guess.jax, "vmap", lambda function: function)
    problem: Any = SimpleNamespace(count=3, system=SimpleNamespace(places="places"))
    wanted = [
        (name, SimpleNamespace(shape=shape)) for name, shape in (("a", (2, 2)), ("b", (2,)), ("c", ()), ("d", ()))
    ]
    records, found = guess._of_run(problem, cast(Any, SimpleNamespace(inputs=wanted)), run)
    assert records is run.records and {name: one.shape for name, one in found.items()} == {"a": (4, 4), "d": (4, 1)}
    assert found["d"][:, 0].tolist() == t.tolist()
    inputs.names = None
    assert guess._of_run(problem, cast(Any, SimpleNamespace(inputs=wanted)), run)[1] == {}
    for other in (
        SimpleNamespace(count=4, system=problem.system),
        SimpleNamespace(count=3, system=SimpleNamespace(places="b")),
    ):
        with pytest.raises(ArgumentError, match=f"this system with {other.count} steps.* 4 records"):
            guess._of_run(cast(Any, other), cast(Any, None), run)


def test_changes_of_inputs_cost_their_square_over_the_length_of_a_step():
    """Σ c (Δ + s (u − v))²/h less that of the plan, of the inputs whose command before is known."""
    random = np.random.default_rng(4)
    scale, cost, rated, h = np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.3, 0.7]), np.array([1, 2]), 0.2
    expanding = made(Expanding, rated=rated, scale=scale, change_cost=cost, h=h, width=2, free=np.arange(3))
    H, g, w = np.zeros((4, 7, 7)), np.zeros((4, 7)), random.normal(size=(4, 7))
    change, known = random.normal(size=(4, 2)), np.ones((4, 2), bool)
    known[0, 1] = False
    expanding._add_changes(H, g, change, known)
    after = change + scale[1:] * (w[:, 5:] - w[:, 2:4])  # of w: two states, v of each rated input, and all inputs
    expected = known * cost[1:] / h * (after**2 - change**2)
    found = 0.5 * np.einsum("ki,kij,kj->k", w, H, w) + np.sum(g * w, axis=1)
    assert found == pytest.approx(expected.sum(axis=1), rel=1e-12)
