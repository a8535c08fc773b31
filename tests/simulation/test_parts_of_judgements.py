"""The rates of excited modes, the motion ahead of a step, and what failed steps and interrupts say, in closed form."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.program import Code
from coadjoint.simulation import monitors, trajectory
from coadjoint.simulation.accuracy import resolution, verdict
from coadjoint.simulation.accuracy.resolution import fastest_rate

H = 0.2


def linear(A: np.ndarray, f: np.ndarray) -> Any:
    """Steps of ẋ = A x + f by the midpoint rule, on rows of t, of (π, n) = x, which is (2,), and of another number."""
    plan = SimpleNamespace(
        program=SimpleNamespace(
            skeleton=SimpleNamespace(lagrangian=len, additional=SimpleNamespace(flat=True)),
            method=SimpleNamespace(regular=True),
        ),
        backend="native",
    )
    places = SimpleNamespace(mu=np.zeros(0, int), n=np.array([2]), pi=np.array([1]), a=np.zeros((0, 3), int))

    def over(rows, h, fractions, members):
        half = 0.5 * h[0] * A
        after = rows.copy()
        x = (np.eye(2) + half) @ rows[:, 1:3].T + h[0] * f[:, None]
        after[:, 1:3] = np.linalg.solve(np.eye(2) - half, x).T
        return after, rows[:, 3] < 9.0

    return SimpleNamespace(plan=plan, places=places, over=over)


def test_the_fastest_rate_is_that_of_the_modes_in_which_the_motion_is():
    decay = linear(np.diag([-3.0, -0.5]), np.zeros(2))
    at = lambda *x: np.array([7.0, *x, 0.0])  # noqa: E731
    assert fastest_rate(decay, at(1.0, 2.0), H, None) == pytest.approx(3.0 * H, rel=1e-6)
    assert fastest_rate(decay, at(1e-9, 2.0), H, None) == pytest.approx(3.0 * H, rel=1e-6)  # relative to its kind
    resting = linear(np.diag([-3.0, -0.5]), np.array([3.0, 0.0]))
    assert fastest_rate(resting, at(1.0, 2.0), H, None) == pytest.approx(0.5 * H, rel=1e-6)
    turning = linear(np.array([[0.0, -4.0], [1.0, 0.0]]), np.zeros(2))
    assert fastest_rate(turning, at(0.3, -0.2), H, np.array([5])) == pytest.approx(2.0 * H, rel=1e-6)
    failing = at(1.0, 2.0)
    failing[3] = 9.0
    assert fastest_rate(decay, failing, H, None) is None
    decay.plan.backend = "xla"
    assert fastest_rate(decay, at(1.0, 2.0), H, None) is None


def test_the_motion_ahead_is_that_of_the_steps_which_have_a_solution():
    """Of rows x that grow by one a step and fail at their second number; NaN from their third on."""
    seen: list[Any] = []

    def probe(rows, h, steps, members):
        ends = rows[:, 0] + steps
        after = np.stack([np.where(ends >= rows[:, 2], np.nan, ends), rows[:, 1], rows[:, 2]], axis=1)
        return after, None, np.where(ends > rows[:, 1], 3, 0)

    def compare(begun, ended, other):
        seen.append((begun[:, 0].tolist(), ended[:, 0].tolist()))
        return {}

    parts: Any = SimpleNamespace(probe=probe, compare=compare)
    sampled = verdict.SampledSteps(parts, ahead=(2, 5))
    rows = np.array([[0.0, 99, 99], [10.0, 12.0, 99], [20.0, 99, 23.0], [30.0, 35.0, 99]])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(verdict, "sizes_of", lambda found: {})
        sampled._look_ahead(rows, np.full(4, H), None)
    assert seen == [([2.0, 32.0, 5.0], [3.0, 33.0, 6.0])]


def test_a_run_is_judged_by_the_steps_that_can_be_judged(monkeypatch):
    """None where no step of half the length has a solution."""
    plan = SimpleNamespace(backend="xla", h=H, program=SimpleNamespace(method=None))
    method = SimpleNamespace(over_fixed_steps=lambda records, h: (records, np.full(2, h)))
    run: Any = SimpleNamespace(plan=plan, method=method, one=(None, None), members=None)
    kept, asked = SimpleNamespace(steps=np.arange(2), rows=np.zeros((2, 1))), list[int]()
    sampler: Any = SimpleNamespace(members=None, changing=None, chosen=lambda n: asked.append(n) or kept)
    for good, expected in (([True, False], "judged"), ([False, False], None)):
        made = SimpleNamespace(
            places=SimpleNamespace(xi=np.zeros(0, int)), probe=SimpleNamespace(layout=SimpleNamespace(unpack=len)),
            errors=lambda rows, h, members, good=good: (SimpleNamespace(good=np.array(good)), {}),
        )  # fmt: skip
        monkeypatch.setattr(resolution, "Doubling", lambda plan, like, made=made: made)
        monkeypatch.setattr(resolution, "with_steps_between", lambda kept, *rest: kept)
        monkeypatch.setattr(resolution, "_judgement", lambda *given: "judged")
        assert resolution.judged_run(run, sampler) == expected
    assert asked == 2 * [resolution.STEPS_BY_XLA]


def test_a_budget_takes_what_acted_from_each_chosen_quantity(monkeypatch):
    monkeypatch.setattr(monitors, "momentum_put_in", lambda system, record: np.array([1.0, 10.0, 100.0]))
    record: Any = SimpleNamespace(ledger=np.zeros(1))
    now, c0 = np.array([5.0, 7.0]), np.array([[1.0, 0.0, 2.0], [0.0, 3.0, 0.0]])
    found = monitors._with_budget(cast(Any, None), record, now, c0)
    assert found["kelvin_noether_budget"].tolist() == [5 - 201, 7 - 30] and found["kelvin_noether"] is now
    record.ledger = None
    assert list(monitors._with_budget(cast(Any, None), record, now, c0)) == ["kelvin_noether"]


@pytest.mark.parametrize(
    ("code", "says"),
    [
        (Code.NOT_CONVERGED, "it did not converge; take a smaller dt"),
        (Code.BEYOND_CHART, "it left the chart of the difference map; "),
        (Code.NOT_FINITE, "its numbers are not finite; take a smaller dt"),
    ],
)
def test_a_step_of_a_trajectory_that_failed_names_its_remedy(code, says):
    program: Any = SimpleNamespace(method=co.Midpoint())
    unsolved, beyond = program.method.remedies
    said = trajectory._failed(code, program)
    assert said.startswith(says) and (beyond if code is Code.BEYOND_CHART else unsolved) in said
    assert ("check the energy and forces there" in said) == (code is Code.NOT_FINITE)
