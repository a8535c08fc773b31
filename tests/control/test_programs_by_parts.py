"""Parts of programs and of what optima say, evaluated without a solver: within steps, changes, softened rows, texts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import casadi as ca
import numpy as np
import pytest

from coadjoint.control import built, c_library, free_duration, joints, objective, phased_optimum, program
from coadjoint.control.conditions import _active
from coadjoint.control.given import _fits
from coadjoint.control.guess import Guesses
from coadjoint.control.optimum import (
    SADDLE,
    STATIONARY,
    UNSTABLE,
    Optimum,
    _residuals,
    difference,
    guesses_line,
    soft_lines,
    violation,
)
from coadjoint.control.phased_optimum import PhasedOptimum
from coadjoint.control.quadratic import Hpipm
from coadjoint.control.resolution import JudgedMotions
from coadjoint.control.transcription import Split, Transcription
from coadjoint.control.within_steps import WorstWithin, lines, with_points
from coadjoint.errors import ArgumentError, OptimumError


def numbers(value: Any) -> list[float]:
    return np.round(ca.DM(ca.evalf(ca.MX(value))).full().T.ravel(), 12).tolist()


class Column(NamedTuple):
    begin: Any
    end: Any


# equations within steps


@pytest.mark.parametrize("nz", [1, 0])
def test_equations_within_steps_are_those_of_parts_of_the_step_with_the_input_of_that_time(nz):
    """r = z − h u₀, x⁺ = x + p h u₀ + h² u₁ of linear u from u₀ to u₁; the path x u₁, at θ = 1/3 and 2/3."""
    x, u, z, p, h = (ca.SX.sym(name, size) for name, size in zip("xuzph", (1, 2, nz, 1, 1), strict=True))
    residual = z - h * u[0] if nz else ca.SX(0, 1)
    equations = ca.Function("e", [x, u, z, p, h], [residual, x + p * h * u[0] + h**2 * u[1]])
    v = ca.SX.sym("v", 1)
    path = ca.Function("p", [x, v, p, h], [x * v + p])
    both, within = with_points(equations, path, 2, [Column(0, 1)], [1])
    given = [2.0, [0.5, 1.5], [0.1, 0.2, 0.3][: 3 * nz], 3.0, 0.6]
    r, after = (one.full().ravel() for one in both(*given))
    assert after == pytest.approx([2.0 + 3.0 * 0.6 * 0.5 + 0.36 * 1.5])
    assert r == pytest.approx([0.1 - 0.3, 0.2 - 0.1, 0.3 - 0.2] if nz else [])
    inputs, steps = [0.5 + 1 / 3, 0.5 + 2 / 3], [0.2, 0.4]
    expected = [(2.0 + 3.0 * h * 0.5 + h**2 * v) * v + 3.0 for v, h in zip(inputs, steps, strict=True)]
    assert within(*given).full().ravel() == pytest.approx(expected)
    assert both.name_out() == ["residual", "next"] and within.name_out() == ["within"]
    held, _ = with_points(equations, path, 1, [Column(0, 0)], [1])
    assert held.numel_in(2) == 2 * nz


# costs and constraints


def inputs_of(cost: Any, begin: Any, end: Any) -> Any:
    return SimpleNamespace(columns=[("u", SimpleNamespace(change_cost=cost), begin, end)])


def test_changes_cost_their_square_over_the_length_of_the_step():
    u, h = ca.MX(ca.DM([[1.0, 4.0, 2.0], [3.0, 4.0, 8.0]])), ca.MX(ca.DM([[0.5, 0.25, 0.5]]))
    held = objective._of_changes(inputs_of(2.0, 0, 0), u, h, {})
    assert numbers(held) == [2 * (9 / 0.25 + 4 / 0.5)]
    after = objective._of_changes(inputs_of(2.0, 0, 0), u, h, {"u": ca.MX(ca.DM([[3.0]]))})
    assert numbers(after) == [2 * (4 / 0.5 + 9 / 0.25 + 4 / 0.5)]
    linear = objective._of_changes(inputs_of(3.0, 0, 1), u, h, {})
    assert numbers(linear) == [3 * (4 / 0.5 + 0 + 36 / 0.5)]
    assert objective._of_changes(inputs_of(0.0, 0, 1), u, h, {}) == 0.0
    both = objective._of_changes(inputs_of(np.array([0.0, 2.0]), [0, 1], [0, 1]), u, h, {})
    assert numbers(both) == [2 * (1 / 0.25 + 16 / 0.5)]
    one = objective._of_changes(inputs_of(2.0, 0, 0), u[:, 0], h[:, 0], {})
    assert numbers(one) == [0.0]


def test_measurements_without_values_are_asked_for():
    made = SimpleNamespace(data={"g": (np.zeros(0, int), None, None, None)}, eta=())
    with pytest.raises(ArgumentError, match="`g` has no values"):
        objective._misfit(cast(Any, made), None, None, None, None)


SOFT = SimpleNamespace(size=1, linear=np.array([3.0]), quadratic=np.array([4.0]), matrix=np.array([[1.0], [-1.0]]))


@pytest.mark.parametrize(
    ("points", "nodes", "lengths"),
    [(None, 1, [1.0]), (0, 3, [0.25, 0.75, 0.5]), (1, 2, [0.5, 1.0]), (2, 4, [0.5, 0.5, 1, 1])],
)
def test_slack_costs_by_the_length_that_its_node_stands_for(points, nodes, lengths):
    s = [0.5, 2.0, 1.0, 3.0][:nodes]
    softened = program._Softened(ca.MX(ca.DM([*s, 9.0])), ca.MX(ca.DM([[0.5, 1.0]])))
    rows = cast(Any, SimpleNamespace(slack=SOFT))
    found = softened(rows, ca.MX(ca.DM(np.zeros((2, nodes)))), points)
    assert numbers(found) == [sign * one for one in s for sign in (1, -1)]
    each = [3.0 * one + 2.0 * one**2 for one in s]
    assert numbers(softened.cost) == [pytest.approx(np.dot(each, lengths))]
    assert softened._begin == nodes and softened(cast(Any, SimpleNamespace(slack=None)), "hard", 0) == "hard"
    last = softened(rows, ca.MX(ca.DM([[1.0], [1.0]])), None)
    assert numbers(last) == [10.0, -8.0]


def test_rows_within_a_step_repeat_those_of_the_path():
    rows = [
        SimpleNamespace(lower=np.array([1.0]), upper=np.array([2.0])),
        SimpleNamespace(lower=np.array([3.0]), upper=np.array([5.0])),
    ]
    problem = SimpleNamespace(path={"a": None, "b": None}, path_points=2)
    found = program._inside(cast(Any, SimpleNamespace(problem=problem, path=rows)))
    assert found.what == "the path (`a`, `b`) inside the step"
    assert found.lower.tolist() == [1, 3, 1, 3] and found.upper.tolist() == [2, 5, 2, 5]


@pytest.mark.parametrize(("name", "place"), [("m", slice(3, 4)), ("J", slice(4, 8)), ("k", slice(8, 9))])
def test_parameters_of_a_phase_follow_its_profiles(name, place):
    problem = SimpleNamespace(
        parameters=("m", "J", "k"), system=SimpleNamespace(parameters=SimpleNamespace(m=1.0, J=np.eye(2), k=2.0))
    )
    profiles = {"a": SimpleNamespace(size=1), "b": SimpleNamespace(size=2)}
    assert joints._place(cast(Any, SimpleNamespace(profiles=profiles, problem=problem)), name) == place


def test_profiles_come_first_among_the_optimal_numbers():
    profiles = {"a": SimpleNamespace(size=1, guess=np.float64(0)), "b": SimpleNamespace(size=2, guess=np.zeros(2))}
    made = SimpleNamespace(profiles=profiles, commands=lambda u: {"u": u})
    parts = cast(Split, SimpleNamespace(u="rows", parameters=np.array([1.0, 2.0, 3.0, 4.0])))
    found = Transcription.taken(cast(Any, made), parts)
    assert found["u"] == "rows" and found["a"] == 1.0 and found["a"].shape == () and found["b"].tolist() == [2, 3]


def test_a_limit_is_active_where_its_force_exceeds_its_distance():
    lower, upper = np.array([0.0, 0.0, 1.0, 0.0]), np.array([1.0, 1.0, 1.0, np.inf])
    value, force = np.array([0.0, 0.5, 1.0, 3.0]), np.array([2.0, 0.0, 0.0, 0.0])
    assert _active(value, lower, upper, force, "it").tolist() == [True, False, True, False]
    with pytest.raises(OptimumError, match="it is only just reached"):
        _active(value, lower, upper, np.zeros(4), "it")


@pytest.mark.parametrize(
    ("value", "fits"), [([1, 2], True), ([[1, 2]], False), ([1, np.nan], False), ("a", False), ([1, [2]], False)]
)
def test_finite_numbers_of_a_shape_need_no_further_check(value, fits):
    assert _fits(value, (2,)) == fits


# the C library

INPUTS = [("a", SimpleNamespace(shape=(2,))), ("b", SimpleNamespace(shape=())), ("c", SimpleNamespace(shape=(3,)))]


def test_commands_in_force_are_at_their_places_in_the_inputs():
    made = SimpleNamespace(inputs=INPUTS, previous={"b": slice(7, 8), "c": slice(2, 5)})
    places, commands = c_library._previous(cast(Any, made))
    assert places.tolist() == [7, 2, 3, 4] and commands.tolist() == [2, 3, 4, 5] and places.dtype == np.int64
    none, of_none = c_library._previous(cast(Any, SimpleNamespace(inputs=INPUTS, previous={})))
    assert none.tolist() == of_none.tolist() == []


def test_given_numbers_are_changing_parameters_and_then_the_goal(monkeypatch):
    parameters = SimpleNamespace(mass=1.0, J=np.eye(3))
    problem = SimpleNamespace(changing=["J"], system=SimpleNamespace(parameters=parameters))
    monkeypatch.setattr(c_library, "given_values", lambda problem: {"goal": {"g": np.zeros(3)}, "u": 0.0})
    assert c_library._given(cast(Any, SimpleNamespace(problem=problem))) == [("J", (3, 3)), ("goal.g", (3,)), ("u", ())]


# free durations


def planning(**more: Any) -> Any:
    made = object.__new__(free_duration.FreeDurationController)
    made.__dict__.update(more)
    return made


def test_inputs_of_a_plan_are_read_on_and_linear_ones_between_its_nodes():
    """A plan of steps 0.1, 0.1, 0.4, 0.4 from t = 2; u: one held input, and one from `begin` to `end`."""
    u = np.array([[1.0, 10.0, 20.0], [2.0, 20.0, 30.0], [3.0, 30.0, 40.0], [4.0, 40.0, 50.0]])
    columns = [("held", None, [0], [0]), ("linear", None, [1], [2])]
    made = planning(
        _plan=SimpleNamespace(u=u, h=0.4), _begin=2.0, _guess=np.array([-1.0, -2.0, -3.0]), steps=2,
        problem=SimpleNamespace(count=4, dt=0.1), _transcription=SimpleNamespace(columns=columns),
    )  # fmt: skip
    assert made._lengths(made._plan).tolist() == [0.1, 0.1, 0.4, 0.4] and made._even(made._plan) == 2
    found = made._inputs_at(np.array([2.07, 2.15, 2.4, 3.0, 3.4]))
    assert found[:, 0].tolist() == [2.0, 3.0, 4.0, -1.0]  # at 2.11, 2.275, 2.7 and after the end at 3
    assert found[:, 1] == pytest.approx([17.0, 25.0, 35.0, 50.0]) and found[:, 2] == pytest.approx(
        [25.0, 35.0, 50.0, 50.0]
    )


def test_the_command_in_force_is_among_the_given_numbers():
    columns = [("a", None, [0], [1]), ("b", None, [2], [2])]
    made = planning(
        _p=np.array([5.0, 6.0]), _transcription=SimpleNamespace(columns=columns, previous={"a": slice(1, 2)})
    )
    assert made._with_previous(np.array([1.0, 2.0, 3.0])).tolist() == [5.0, 2.0] and made._p.tolist() == [5.0, 6.0]


def test_a_controller_of_a_free_duration_has_no_library_and_says_why_it_finds_no_plan():
    with pytest.raises(ArgumentError, match="has no C library"):
        planning().export_c("folder")
    made = planning(_predicted=lambda measured, clock: None)
    assert made._iterate(None, None) == "the model has no step from this state"


def test_an_optimum_that_the_solver_does_not_find_is_none(monkeypatch):
    found = {"f": ca.DM(2.0), "x": ca.DM([1.0, 3.0])}
    monkeypatch.setattr(free_duration, "answer", lambda solver, *given: found)
    good, bad = (SimpleNamespace(stats=lambda ok=ok: {"success": ok}) for ok in (True, False))
    cost, w = planning()._optimum(good, None, None, None)
    assert cost == 2.0 and w.tolist() == [1.0, 3.0] and planning()._optimum(bad, None, None, None) is None

    def fails(*given):
        raise OptimumError("no")

    monkeypatch.setattr(free_duration, "answer", fails)
    assert planning()._optimum(good, None, None, None) is None


# guesses


def test_further_guesses_are_the_simulated_motion_and_bends(monkeypatch):
    monkeypatch.setattr("coadjoint.control.guess.named", lambda problem, guess: problem)
    monkeypatch.setattr("coadjoint.control.guess.bent", lambda transcription, w, seed: (transcription, w, seed))
    made = SimpleNamespace(_transcription="t", variables=lambda *given: given)
    bends = [
        ("t", "w", seed) for seed in range(len([*Guesses.others(cast(Any, made), cast(Any, "simulate"), "w", "x")]))
    ]
    assert [*Guesses.others(cast(Any, made), cast(Any, "simulate"), "w", "x")] == bends and len(bends) > 1
    found = [*Guesses.others(cast(Any, made), cast(Any, "interpolate"), "w", "x")]
    assert found == [("interpolate", "simulate", "x"), *bends]


@pytest.mark.parametrize("angle", [0.0, 1e-7, 2 * np.pi, 7.0])
def test_no_turn_and_a_full_one_have_no_other_way_round(angle, monkeypatch):
    monkeypatch.setattr("coadjoint.control.guess.named", lambda problem, guess: "interpolate")
    monkeypatch.setattr("coadjoint.control.guess.goal_place", lambda problem: (None, None))
    space = SimpleNamespace(dim=lambda group: 0)
    problem = SimpleNamespace(system=SimpleNamespace(group=None, additional=space))
    made = SimpleNamespace(_turned=lambda problem: np.array([0.0, 0.0, angle]))
    assert Guesses.other_way(cast(Any, made), cast(Any, problem), np.zeros(3)) is None
    curved = SimpleNamespace(
        system=SimpleNamespace(group=None, additional=SimpleNamespace(dim=lambda group: 2, flat=False))
    )
    with pytest.raises(ArgumentError, match="no straight lines"):
        problem = SimpleNamespace(start=None, system=SimpleNamespace(places=(None, curved.system.additional, None)))
        Guesses._interpolated(cast(Any, made), cast(Any, problem))
    assert Guesses.other_way(cast(Any, made), cast(Any, curved), np.zeros(3)) is None


@pytest.mark.parametrize("angle", [1.0, 4.0])
def test_the_other_way_round_is_the_rest_of_a_turn_back(angle, monkeypatch):
    """Also of turns beyond half a turn, as where a goal is written as such."""
    monkeypatch.setattr("coadjoint.control.guess.named", lambda problem, guess: "interpolate")
    monkeypatch.setattr("coadjoint.control.guess.goal_place", lambda problem: ("goal", None))
    monkeypatch.setattr("coadjoint.control.guess.evaluate", lambda function, *given: np.eye(3))
    system = SimpleNamespace(group=SimpleNamespace(matrix=None), additional=SimpleNamespace(dim=lambda group: 0))
    problem: Any = SimpleNamespace(system=system, start=SimpleNamespace(g=None))
    made: Any = SimpleNamespace(
        _turned=lambda problem: np.array([0.0, 0.6, 0.8]) * angle, _interpolated=lambda problem, back: back,
        _transcription=SimpleNamespace(split=lambda w: SimpleNamespace(x=["first"])),
        of_motion=lambda *given: given[1:],
    )  # fmt: skip
    back, known, first = Guesses.other_way(made, problem, np.zeros(3))
    np.testing.assert_allclose(back, np.array([0.0, -0.6, -0.8]) * (2 * np.pi - angle))
    assert known == {} and first == "first"


class Found(NamedTuple):
    cost: float
    solver: str
    misses: bool = False


@pytest.mark.parametrize(
    ("optima", "solver"),
    [
        ([Found(2.0, "a")], "a"),
        ([Found(4.0, "a", True), Found(3.0, "b")], "b, from another guess"),
        ([Found(2.0, "a", True), Found(3.0, "b")], "a"),
        ([OptimumError("no"), Found(3.0, "b")], "b, from another guess"),
        ([OptimumError("no")], None),
    ],
)
def test_of_a_free_duration_the_optimum_says_whether_another_guess_led_to_it(optima, solver, monkeypatch):
    monkeypatch.setattr(built, "Optimum", Found)
    monkeypatch.setattr(built, "replace", lambda one, **changes: one._replace(**changes))
    monkeypatch.setattr(built, "misses_end", lambda violated: violated)
    monkeypatch.setattr(Found, "violated", property(lambda self: self.misses), raising=False)
    left = iter(optima)
    transcription = SimpleNamespace(split=lambda w: SimpleNamespace(x=["x"]), problem=None)
    case = SimpleNamespace(transcription=transcription, guess="w", _replace=lambda guess: guess)
    made: Any = SimpleNamespace(
        _attempt=lambda case, settings, place: next(left),
        _guesses=SimpleNamespace(others=lambda problem, guess, x: ["w"] * (len(optima) - 1)),
    )
    if solver is None:
        with pytest.raises(OptimumError, match=r"no Another start of the solver"):
            built.BuiltProgram._of_free_duration(made, cast(Any, case), cast(Any, None))
    else:
        found = cast(Any, built.BuiltProgram._of_free_duration(made, cast(Any, case), cast(Any, None)))
        assert found.solver == solver


def test_cases_are_shared_out_over_threads_and_come_back_in_their_order():
    made = SimpleNamespace(_attempt=lambda case, settings, place: (case, place))
    for threads, places in ((1, [0] * 5), (2, [0, 1, 0, 1, 0]), (3, [0, 1, 2, 0, 1])):
        found = built.BuiltProgram.solved_each(cast(Any, made), cast(Any, range(5)), cast(Any, None), threads)
        assert found == list(zip(range(5), places, strict=True))


# residuals


def test_a_run_differs_from_the_optimum_by_its_worst_number_either_way():
    rows = np.array([[1.0, 5.0, 2.0], [3.0, 5.0, 4.0]])
    made: Any = SimpleNamespace(graph=SimpleNamespace(numbers=lambda records: rows), live=[0, 2])
    parts: Any = SimpleNamespace(x=np.array([[1.0, 2.5], [3.25, 4.0]]))
    assert difference(made, cast(Any, SimpleNamespace(records=None)), parts) == 0.5
    parts.x[1, 0] = 2.0
    assert difference(made, cast(Any, SimpleNamespace(records=None)), parts) == 1.0
    bounds: Any = SimpleNamespace(limits=(np.array([0.0, 1.0]), np.array([2.0, 3.0])))
    assert [violation(bounds, np.array(g)) for g in ([1, 2], [-0.5, 2], [1, 3.25])] == [0.0, 0.5, 0.25]


@pytest.mark.parametrize("space", [None, "a space"])
def test_residuals_are_weighed_differences_at_the_measured_nodes_and_the_last_input_goes_on(space):
    """off = x + 10 u − y at nodes 0 and 2 of two steps, with a weight of 0 where nothing was measured."""
    x, u, p, h, y = (ca.SX.sym(name) for name in "xuphy")
    function = ca.Function("m", [x, u, p, h, y], [ca.vertcat(x + 10 * u - y, p * h - y)])
    data = {"m": (np.array([0, 2]), np.array([[1.0, 2.0]]), np.array([[2.0, 4.0], [0.0, 0.5]]), None)}
    measured = {"m": SimpleNamespace(values=np.zeros((2, 2)), space=space)}
    held: Any = SimpleNamespace(begin=0, end=0, shape=())
    made: Any = SimpleNamespace(
        data=data, inputs=[("u", held)], numbers=lambda parameters: np.array([3.0]),
        problem=SimpleNamespace(measured=measured), functions=SimpleNamespace(measured={"m": function}),
    )  # fmt: skip
    parts: Any = SimpleNamespace(u=np.array([[0.1], [0.3]]), x=np.array([[1.0], [2.0], [4.0]]), parameters=None, h=0.5)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("coadjoint.control.optimum.at_end", lambda inputs: [0])
        found = _residuals(made, parts)["m"]
    np.testing.assert_allclose(found, [[2 * (1.0 + 1.0 - 1.0), np.nan], [4 * (4.0 + 3.0 - 2.0), 0.5 * (1.5 - 2.0)]])


# texts


def run(steps: int, begin: float = 0.0) -> Any:
    class Flown:
        records = SimpleNamespace(t=begin + np.arange(steps + 1.0))

        def __str__(self) -> str:
            return f"run of {steps}"

    return Flown()


def test_soft_constraints_say_when_they_are_violated_most():
    rows = {"a": np.array([[0.0], [0.25], [0.125]]), "b": np.array([[1e-6]]), "c": np.array([[0.5, 2.0]])}
    assert soft_lines(rows, 1.0, 4.0) == [
        ("soft constraint", text)
        for text in ("`a` is violated by at most 0.25 at t = 3 s", "`b` holds", "`c` is violated by at most 2")
    ]


def test_several_guesses_are_told_by_their_least_and_largest_cost():
    told = guesses_line({"first": 3.0, "random 1": 1.5, "random 2": "no optimum"})
    assert told == "2 of 3 led to an optimum, costs 1.5 (`random 1`) to 3"


OPTIMUM: dict[str, Any] = {
    "cost": 1.25, "duration": 2.0, "run": run(4), "solver": "ipopt", "iterations": 7, "solve_seconds": 0.5,
    "build_seconds": 0.25, "violation": 1e-10, "difference": 2e-10, "violated": {}, "within": {}, "guesses": {},
    "parameters": {"mass": np.array(2.5)}, "residuals": {"g": np.array([3.0, np.nan, -4.0])}, "minimum": True,
    "solution": SimpleNamespace(problem=SimpleNamespace(path_points=0)),
}  # fmt: skip


def told(kind: Any = Optimum, of: dict[str, Any] = OPTIMUM, **changes: Any) -> list[tuple[str, str]]:
    text = kind.__str__(cast(Any, SimpleNamespace(**of | changes)))
    return [(line[:18].rstrip(), line[18:]) for line in text.split("\n\n")[0].split("\n")]


def test_the_summary_of_an_optimum():
    assert told() == [
        ("optimum", "cost 1.25 over 2 s, 4 steps"),
        ("solver", "ipopt, 7 iterations in 0.5 s, built in 0.25 s"),
        ("constraints", "violated by at most 1.0e-10; the run differs from the optimum by at most 2.0e-10"),
        ("parameter mass", "2.5"),
        ("measured g", "2 numbers, 3.54 σ in the mean square, 4 σ at most"),
    ]
    warned = [text for name, text in told(difference=5e-9, minimum=False, iterations=0) if name == "warning"]
    assert warned == [UNSTABLE, SADDLE, STATIONARY]
    assert "warning" not in dict(told(difference=3.9e-9)) and "warning" in dict(told(difference=4.1e-9))
    assert dict(told(guesses={"first": 1.0}))["guesses"].startswith("1 of 1 led")


PHASED: dict[str, Any] = {
    "costs": {"a": 1.0, "b": 0.5}, "cost": 1.5, "durations": {"a": 2.0, "b": 1.0}, "duration": 3.0,
    "runs": {"a": run(4), "b": run(2, 2.0)}, "parameters": {"a": {}, "b": {"mass": np.array([2.0])}}, "solver": "ipopt",
    "iterations": 3, "solve_seconds": 0.5, "build_seconds": 0.25, "violation": 1e-10, "difference": 2e-10,
    "violated": {"b": {"low": np.array([[0.0], [0.5], [0.0]])}}, "minimum": True,
    "within": {"a": {"clear": WorstWithin(0.5, 1.0, 1.5)}},
    "joints": (SimpleNamespace(before="a", after="b", keep="momentum"),),
}  # fmt: skip


def test_the_summary_of_phases_tells_each_and_what_goes_on():
    assert told(PhasedOptimum, PHASED) == [
        ("optimum", "cost 1.5 over 3 s, 2 phases"),
        ("phase a", "cost 1 over 2 s, 4 steps"),
        ("phase b", "cost 0.5 over 1 s, 2 steps, begins with the momenta of `a`"),
        ("parameter mass", "[2.] in `b`"),
        ("solver", "ipopt, 3 iterations in 0.5 s, built in 0.25 s"),
        ("constraints", "violated by at most 1.0e-10; the runs differ from the optimum by at most 2.0e-10"),
        ("soft constraint", "`low in b` is violated by at most 0.5 at t = 2.5 s"),
        *lines({"clear in a": WorstWithin(0.5, 1.0, 1.5)}, 0),
    ]
    joints = (SimpleNamespace(before="a", after="b", keep="velocity"),)
    other = told(PhasedOptimum, PHASED, joints=joints, difference=7e-9, minimum=False, iterations=0, within={})
    assert "velocities of `a`" in dict(other)["phase b"]
    assert [text for name, text in other if name == "warning"] == [UNSTABLE, SADDLE.partition(";")[0], STATIONARY]
    assert "warning" not in dict(told(PhasedOptimum, PHASED, within={}, difference=5.9e-9))
    text = PhasedOptimum.__str__(cast(Any, SimpleNamespace(**PHASED)))
    assert text.endswith("\n\na\nrun of 4\n\nb\nrun of 2")
    assert cast(Any, PhasedOptimum.cost).fget(SimpleNamespace(**PHASED)) == 1.5
    assert cast(Any, PhasedOptimum.duration).fget(SimpleNamespace(**PHASED)) == 3.0
    assert phased_optimum.ROUND_OFF == 1e-13


# solvers


@pytest.mark.parametrize(
    ("x", "stats", "error", "why"),
    [
        ([1.0, 2.0], {"success": True}, None, ""),
        ([1.0, 2.0], {}, None, "has no solution"),
        ([np.nan, 2.0], {"success": True}, None, "returned no numbers"),
        ([1.0, -1e12], {"success": True}, None, "beyond all bounds"),
        ([0.0, 0.0], {}, "first\nlast line", "last line"),
    ],
)
def test_what_is_no_solution_of_a_quadratic_program_says_why(x, stats, error, why):
    made = object.__new__(Hpipm)
    made._x, made._numbers, made._arguments, made._results = np.full(2, 7.0), {"h": np.zeros(1)}, [], []
    made._buffer = SimpleNamespace(stats=lambda: stats)

    def evaluated():
        assert made._numbers["h"].tolist() == [5.0] and not made._x.any()
        made._x[:] = x
        if error:
            raise RuntimeError(error)

    made._evaluate = evaluated
    found, told = made({"h": np.array([5.0])})
    assert why in told and bool(why) == bool(told)
    np.testing.assert_array_equal(found, x)
    assert (found is made._x) == bool(why)


def test_rows_of_a_motion_are_stepped_with_linear_inputs_until_a_step_fails():
    """x⁺ = x + h (u_begin + u_end)/2, over 2 steps; the second row has none."""
    made = object.__new__(JudgedMotions)
    made._nx, made._linear, made._z, made._p = 1, [(0, 1)], [np.array([4.0])], "p"
    made._transcription = SimpleNamespace(problem=SimpleNamespace(dt=0.5))

    def simulated(x, u, z, p, h):
        assert p == "p" and h == 0.25
        return None if x[0] > 50 else (x + 0.5 * h * (u[0] + u[1]), z + 1)

    made._simulated = simulated
    rows = np.array([[1.0, 2.0, 3.0, 10.0], [100.0, 2.0, 3.0, 20.0]])
    after, before, code = made._step(rows, np.array([0.25, 0.25]), steps=2)
    assert before is rows and code.tolist() == [0, 1]
    assert after[0] == pytest.approx([1.0 + 0.25 * 2.25 + 0.25 * 2.75, 3.0, 4.0, 10.5])  # u̇ = 2: 2 … 2.5 … 3
    assert after[1].tolist() == [100.0, 2.0, 3.0, 20.5]
