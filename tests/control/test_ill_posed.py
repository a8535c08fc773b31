"""What cannot be asked of an optimal motion is told in one sentence."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.control import Bounds, End, Input, Problem, Profile
from coadjoint.control.solve import answer
from coadjoint.errors import Interrupted, OptimumError

SYSTEM = co.System(
    co.Translation(1), lambda xi, p: 0.5 * p.mass * xi @ xi, parameters={"mass": 1.0},
    forces=lambda motion, p: co.Force(torque=motion.inputs.push),
)  # fmt: skip
START = SYSTEM.state(g=[0.0])


def cost(motion, p):
    return motion.inputs.push @ motion.inputs.push


GOOD = {"dt": 0.1, "steps": 5, "inputs": {"push": Input((1,))}, "cost": cost, "end": End(g=[0.1])}

WRONG = {
    "nothing to choose": ({"inputs": {}}, "nothing to choose"),
    "inputs that are a list": ({"inputs": ["push"]}, "dictionary of name"),
    "no duration": ({"steps": None}, "duration"),
    "a cost that is a number": ({"cost": 1.0}, "must be a Python function"),
    "a cost of too many arguments": ({"cost": lambda motion, p, q: 0.0}, "must take \\(motion, p\\)"),
    "a cost that is a vector": ({"cost": lambda motion, p: jnp.ones(2) * motion.xi[0]}, "one number, but returns 2"),
    "a cost by NumPy": ({"cost": lambda motion, p: float(motion.xi[0])}, "jax.numpy"),
    "a cost of an input that is not there": ({"cost": lambda motion, p: motion.inputs.pull @ motion.xi}, "pull"),
    "a cost without an operation in CasADi": ({"cost": lambda motion, p: jnp.round(motion.xi[0])}, "round_even"),
    "a path that is a function": ({"path": {"slow": lambda motion, p: motion.xi}}, "co.control.Bounds"),
    "an end that is a state": ({"end": START}, "co.control.End"),
    "an empty end": ({"end": End()}, "is empty"),
    "an end outside the group's shape": ({"end": End(g=[0.0, 1.0])}, "g"),
    "an end by velocity and momentum": ({"end": End(xi=[0.0], mu=[0.0])}, "not both"),
    "an end in q without q": ({"end": End(q=[1.0])}, "no `additional`"),
    "a free duration that is a number": ({"free_duration": 3.0}, "shortest, longest"),
    "more equations than choices": ({"steps": 1, "end": End(g=[0.1], xi=[0.0])}, "more equations than|No optimum"),
    "a path that is not finite": ({"path": {"log": Bounds(lambda motion, p: jnp.log(motion.g[0]), 0.0)}}, "`log`"),
    "a free duration that is backwards": ({"free_duration": (2.0, 1.0)}, "shortest, longest"),
    "a parameter that is none": ({"parameters": {"weight": (0.0, 1.0)}}, "no parameter `weight`"),
    "a parameter without bounds": ({"parameters": {"mass": 1.0}}, "lower, upper"),
    "a parameter between nothing": ({"parameters": {"mass": (2.0, 1.0)}}, "Nothing lies between"),
    "steps that choose themselves": ({"method": co.methods.VariableStep()}, "fixed step"),
    "a method that is a text": ({"method": "midpoint"}, "must be a method"),
    "an input that nothing takes": ({"inputs": {"pull": Input((1,))}, "cost": None}, "push"),
}


@pytest.mark.parametrize("name", WRONG)
def test_an_ill_posed_problem_is_told_in_one_sentence(name):
    changes, told = WRONG[name]
    with pytest.raises(co.errors.CoadjointError, match=told) as error:
        Problem(SYSTEM, START, **(GOOD | changes)).solve()
    assert "\n" not in str(error.value) and len(str(error.value)) < 500


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: Input((2, 2)), "must be \\(\\) or \\(m,\\)"),
        (lambda: Input((2,), lower=[0.0, 0.0, 0.0]), "have the shape \\(2,\\)"),
        (lambda: Input((), lower=1.0, upper=0.0), "Nothing lies between"),
        (lambda: Input((2,), lower=[0.0, 2.0], upper=1.0), "Nothing lies between"),
        (lambda: Input((), lower=np.nan), "must be numbers"),
        (lambda: Input((), rate=0.0), "must be positive"),
        (lambda: Input((), guess="zero"), "must be numbers"),
        (lambda: Bounds(1.0, lower=0.0), "a function of the motion"),
        (lambda: Bounds(lambda motion, p: motion.xi), "needs `lower` or `upper`"),
    ],
)
def test_wrong_inputs_and_bounds_are_told(make, told):
    with pytest.raises(co.errors.ArgumentError, match=told):
        make()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"solver": "newton"}, 'must be "ipopt" or "fatrop"'),
        ({"tolerance": 2.0}, "small positive number"),
        ({"max_iterations": 0}, "must be a whole number from 1"),
        ({"guess": np.zeros(3)}, "a run, a name or None"),
        ({"guess": "straight"}, '"interpolate" or "simulate"'),
        ({"options": {"no_such_option": 1}}, "CasADi cannot set up ipopt"),
    ],
)
def test_wrong_options_of_the_solver_are_told(options, told):
    with pytest.raises(co.errors.ArgumentError, match=told):
        Problem(SYSTEM, START, **GOOD).solve(**options)


def pushed(u=None, **more):
    """A unit mass for 1 s, from rest, with |u| ≤ 1 N."""
    unit = SYSTEM.replace(mass=1.0)
    given = {"inputs": {"push": u or Input((1,), -1.0, 1.0)}, "cost": cost, "dt": 0.1, "steps": 10}
    return Problem(unit, unit.state(g=[0.0]), **(given | more))


def regulated(at=None, inputs=None, **more):
    return Problem(SYSTEM, START, **(GOOD | {"end": None} | more)).regulator(at, inputs)


def cost_of_place(motion, p):
    return motion.g @ motion.g + cost(motion, p)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: regulated(SYSTEM.state(g=[0.0], xi=[1.0]), cost=cost_of_place), "moves by 0.1 in a step"),
        (lambda: regulated(inputs={"push": [1.0]}), "moves by"),
        (lambda: regulated(inputs={"pull": [1.0]}), "no co.control.Input `pull`"),
        (lambda: regulated(inputs={"push": "hard"}), "`push`"),
        (lambda: regulated(cost=lambda motion, p: motion.g[0] + cost(motion, p)), "its slope there is"),
        (lambda: regulated(), "No regulator holds this state"),
        (lambda: regulated(inputs=[0.0]), "dictionary of name → command"),
        (lambda: regulated(cost=None), "something to minimise"),
        (lambda: Problem(SYSTEM, START, **GOOD, terminal=3.0), "must be a regulator"),
        (lambda: Problem(SYSTEM, START, **GOOD).regulator("rest"), "must be a co.State"),
    ],
)
def test_wrong_regulators_are_told(make, told):
    with pytest.raises(co.errors.ArgumentError, match=told) as error:
        make()
    assert "\n" not in str(error.value)


RESISTS = {
    "a place too far away": ({"end": End(g=[10.0], xi=[0.0])}, "`g` at the end", 9.75),
    "a speed too high": ({"end": End(g=[0.5], xi=[3.0])}, "`xi` at the end", 2.0),
    "too little time": ({"end": End(g=[1.0], xi=[0.0]), "free_duration": (0.5, 1.0)}, "`g` at the end", 0.75),
    "too slow a change": ({"u": Input((1,), rate=0.1), "end": End(g=[1.0], xi=[0.0])}, "`g` at the end", 0.992),
    "a wall at the start": ({"path": {"wall": Bounds(lambda motion, p: motion.g, 1.0)}}, "`wall` at node 0", 1.0),
    "a wall before the end": (
        {"path": {"wall": Bounds(lambda motion, p: motion.g, upper=0.3)}, "end": End(g=[0.4])},
        "`g` at the end|`wall` at node 10", None,
    ),
    "an end that is a function": ({"end": lambda motion, p: motion.g - 4.5}, "the end", 4.0),
    "a linear input": ({"u": Input((1,), -1, 1, course="linear"), "end": End(xi=[4.0])}, "`xi` at the end", 3.0),
    "a profile": ({"u": Profile(lambda t, theta: theta, [0.0], -1, 1), "end": End(xi=[4.0])}, "`xi` at the end", 3.0),
}  # fmt: skip


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", RESISTS)
def test_of_constraints_that_no_motion_satisfies_the_one_that_resists_is_named(name):
    """By how much the motion that comes nearest leaves it, not by what the solver left in the equations of motion."""
    changes, resists, amount = RESISTS[name]
    with pytest.raises(co.errors.OptimumError, match=f"most violated: .*({resists}).*, by ") as error:
        pushed(**changes).solve()
    assert "\n" not in str(error.value)
    if amount is not None:
        assert float(str(error.value).rsplit("by ", 1)[1].rstrip(".")) == pytest.approx(amount, rel=6e-3)


def test_many_starts_are_refused():
    with pytest.raises(co.errors.ArgumentError, match="one start"):
        Problem(SYSTEM, SYSTEM.state(g=co.each([[0.0], [1.0]])), **GOOD)


def test_a_guess_of_other_length_is_refused():
    run = co.simulate(SYSTEM, START, dt=0.1, steps=4, inputs={"push": np.zeros(1)}, accuracy=False)
    with pytest.raises(co.errors.ArgumentError, match="5 steps"):
        Problem(SYSTEM, START, **GOOD).solve(guess=run)


def test_casadi_that_is_not_there_is_told(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(co.errors.ArgumentError, match=r'pip install "coadjoint\[control\]"'):
        Problem(SYSTEM, START, **GOOD).solve()


def test_an_interrupt_ends_the_solver(monkeypatch):
    """CasADi turns it into an exception of its own, inside which IPOPT ends."""
    import signal

    quartic = {"steps": 400, "cost": lambda motion, p: motion.inputs.push[0] ** 4}  # Newton's steps gain a third each
    problem = Problem(SYSTEM, START, **(GOOD | quartic))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    from coadjoint.control import built

    found_by = built.found_by

    def interrupted(*arguments):
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.02)  # of processor time, in the iterations
        return found_by(*arguments)

    monkeypatch.setattr(built, "found_by", interrupted)
    alarm = signal.signal(signal.SIGVTALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    try:
        with pytest.raises(KeyboardInterrupt):
            problem.solve()
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGINT, before)
        signal.signal(signal.SIGVTALRM, alarm)


def test_options_of_ipopt_in_the_working_directory_are_not_read(tmp_path, monkeypatch):
    """Such a file may name files to write and a library to load; the search for what resists reads none, either."""
    monkeypatch.chdir(tmp_path)
    Path("ipopt.opt").write_text("output_file written\nfile_print_level 5\n")
    with pytest.raises(co.errors.OptimumError, match="`g` at the end"):
        pushed(**RESISTS["a place too far away"][0]).solve()
    assert [path.name for path in Path().iterdir()] == ["ipopt.opt"]


@pytest.mark.parametrize("bounds", [(0.5, 4.0), (np.diag([0.5] * 3), np.diag([4.0] * 3) + 0.1)])
def test_bounds_that_choose_a_pair_of_a_symmetric_matrix_apart_are_an_error(bounds):
    body = co.System(
        co.SO3(), lambda xi, p: 0.5 * xi @ p.inertia @ xi, parameters={"inertia": np.diag([1.0, 2.0, 2.5])}
    )
    given = {"dt": 0.1, "steps": 5, "end": co.control.End(xi=[0.0, 0.0, 0.1])}
    with pytest.raises(
        co.errors.ArgumentError, match=r"`inertia` is a symmetric matrix, but its bounds leave the entries \[0, 1\]"
    ):
        co.control.Problem(body, body.state(xi=[0, 0, 0.2]), parameters={"inertia": bounds}, **given)
    diagonal = np.diag([0.5] * 3), np.diag([4.0] * 3)
    assert co.control.Problem(body, body.state(xi=[0, 0, 0.2]), parameters={"inertia": diagonal}, **given).count == 5


def test_a_copy_with_another_step_says_how_to_keep_the_duration_or_the_steps():
    problem = Problem(SYSTEM, START, **GOOD)
    with pytest.raises(co.errors.ArgumentError, match=r"they are 0.5 s and 5 with dt = 0.05 s.* give steps=None too"):
        dataclasses.replace(problem, dt=0.05)
    assert dataclasses.replace(problem, dt=0.05, steps=None).count == 10


@pytest.mark.parametrize(
    ("stopped", "error", "says"),
    [
        (RuntimeError("in f:\nKeyboardInterrupt"), Interrupted, "Interrupted in the solver"),
        (RuntimeError("in f:\nno memory"), OptimumError, "The solver stopped: no memory"),
    ],
)
def test_a_solver_that_stops_is_told_apart_from_one_that_is_interrupted(stopped, error, says):
    def solver(**given):
        raise stopped

    program: Any = SimpleNamespace(limits=(0, 0), bounds=(0, 0))
    with pytest.raises(error, match=says):
        answer(solver, program, np.zeros(1), None)
