"""What filters do when measurements contradict them: after rejections in a row, and with losses for outliers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.estimation import Filter, Measurement, ModelProcess, engines
from coadjoint.estimation.engines import FilterEngine, robust
from coadjoint.losses import Huber, Loss, Student

H, AWAY = 0.1, 5.0


def boat() -> tuple[ModelProcess, Any]:
    system = co.System(
        co.Translation(1), lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.Trivial(2)
    )  # fmt: skip
    start = system.state(q=[0.0, 0.0], qdot=[0.0, 0.0])
    return ModelProcess(system, start, noise={"force": 0.01}), start


PROCESS, START = boat()


def filter(native: bool = True, members: int | None = None, **options: Any) -> Filter:
    defaults: dict[str, Any] = {"function": lambda m: m.n, "deviation": 0.1, "gate": 0.999}
    fix = Measurement(**{**defaults, **options})
    found = Filter(
        PROCESS, START, measurements={"gps": fix}, deviations={"q": 0.1, "nu": 0.01}, accuracy=False, members=members
    )
    if not native:
        found._engine = FilterEngine(PROCESS, list(found._measured.prepared.values()))
        found._engine._filters = None
    return found


@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize(("do", "ends"), [("inflate", 0.2), ("reset", 1e-6)])
@pytest.mark.cases(2)
def test_the_third_fix_in_a_row_beyond_the_gate_moves_the_filter_to_it(native: bool, do: str, ends: float):
    one = filter(native, after_rejections=(3, do))
    times, values = H * np.arange(1, 8), np.tile([AWAY, -AWAY], (7, 1))
    values[1] = np.nan
    found = one.run({"gps": (times, values)}, dt=H, covariances=True)
    gps = found.nis["gps"]
    assert gps.recovered.tolist() == [False, False, False, True, False, False, False]
    assert gps.used.tolist() == [False, False, False, True, True, True, True] and np.isnan(gps.nis[1])
    assert np.max(np.abs(found.states.n[4] - [AWAY, -AWAY])) < ends
    if do == "reset":
        place = [PROCESS.names.index(f"q[{i}]") for i in range(2)]
        assert np.allclose(found.covariances[4][np.ix_(place, place)], 0.01 * np.eye(2), atol=1e-8)
    assert "; recovered after rejections at 1 times, first at 0.4 s" in str(found)


def test_recoveries_are_logged_with_their_times(caplog: pytest.LogCaptureFixture):
    caplog.set_level("INFO")
    values = np.tile([AWAY, -AWAY], (4, 1))
    filter(after_rejections=(3, "reset")).run({"gps": (H * np.arange(1, 5), values)}, dt=H)
    online = filter(after_rejections=(1, "inflate"), members=2)
    online.update({"gps": np.array([[0.0, 0.0], [AWAY, 0.0]])})
    said = "`gps` at t = {} s is value {} in a row beyond its gate, and {} it.".format
    assert caplog.messages == [said(0.3, 3, "the estimate was reset to"), said(0, 1, "P was inflated for")]


def test_a_value_within_the_gate_begins_the_count_again_and_members_have_their_own():
    one = filter(members=2, after_rejections=(2, "reset"))
    for k, (far, recovers) in enumerate([((1, 1), (0, 0)), ((0, 1), (0, 1)), ((1, 0), (0, 0)), ((1, 1), (1, 0))]):
        place = one.state.n
        given = np.where(np.array(far)[:, None], place + AWAY, place)
        assert one.update({"gps": given})["gps"].recovered.tolist() == [bool(r) for r in recovers], k


@pytest.mark.parametrize("native", [True, False])
def test_a_filter_stops_after_rejections_and_is_unchanged(native: bool):
    one = filter(native, after_rejections=(2, "stop"))
    one.update({"gps": [AWAY, 0.0]})
    before = one.rows.copy()
    with pytest.raises(co.errors.StepError, match="stopped at t = 0 s: 2 values of `gps` in a row are beyond its gate"):
        one.update({"gps": [AWAY, 0.0]})
    assert np.array_equal(one.rows, before)


def test_a_late_fix_repeats_the_counts_from_its_time():
    options: Any = {
        "measurements": {"gps": Measurement(lambda m: m.n, deviation=0.1, gate=0.999, after_rejections=(2, "reset"))}
    }
    timely, late = (Filter(PROCESS, START, deviations={"q": 0.1}, memory=1.0, accuracy=False, **options) for _ in "ab")
    far = {"gps": [AWAY, 0.0]}
    timely.predict(H)
    timely.update(far)
    timely.predict(H)
    timely.update(far)
    late.predict(H)
    late.predict(H)
    late.update(far)
    late.update(far, t=H)
    assert np.allclose(late.rows, timely.rows, atol=1e-12) and late.rows[0].max() > 1.0


@pytest.mark.cases(2)
@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize("loss", [Huber(), Huber(0.5), Student(4), Student(1)])
def test_a_robust_update_is_the_least_of_its_cost(native: bool, loss: Loss):
    """½ eᵀP⁻¹e + ρ(|y − x̂ − e|²/σ²) has no slope at the estimate."""
    one = filter(native, gate=None, loss=loss)
    P, y = 0.01 * np.eye(2), np.array([0.9, -0.4])
    nis = one.update({"gps": y})["gps"].nis
    e = np.asarray(one.state.n)
    r = y - e
    slope = np.linalg.solve(P, e) - float(loss.weight(np.array(r @ r / 0.01), 2)) * r / 0.01
    assert np.max(np.abs(slope)) < 1e-10 * np.linalg.norm(r / 0.01) and nis == pytest.approx(y @ y / 0.02)
    plain = filter(native, gate=None)
    plain.update({"gps": y})
    assert np.linalg.norm(e) < 0.8 * np.linalg.norm(np.asarray(plain.state.n))


@pytest.mark.cases(2)
@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize(
    ("loss", "y"), [(Student(1), 1.5), (Student(4), 2.0), (Huber(0.5), 1.5), (Huber(), 40.0), (Student(1), 1e6)]
)
def test_the_weight_of_a_precise_sensor_converges_near_the_turn_over_of_a_loss(native: bool, loss: Loss, y: float):
    """½ e²/P + ρ((y − e)²/R), P = 0.01 ≫ R = 0.0016, has no slope at the estimate, where w contracts slowly."""
    fix: dict[str, Any] = {"function": lambda m: m.n[0], "gate": None, "loss": loss, "deviation": 0.04}
    one = filter(native, **fix)
    y = 0.2 * y
    one.update({"gps": y})
    e = float(one.state.n[0])
    slope = e / 0.01 - float(loss.weight(np.array((y - e) ** 2 / 0.0016), 1)) * (y - e) / 0.0016
    assert abs(slope) < 1e-9 * max(e / 0.01, 1.0)
    one = filter(native, **fix)
    one.update({"gps": 0.0})
    assert one.state.n[0] == 0


@pytest.mark.parametrize("loss", [Huber(0.5), Student(4), Student(30)])
def test_a_weight_is_found_in_few_steps_of_newton(loss: Loss, monkeypatch):
    """w = weight(R ν²/(A w + R)²), of several members at once, in at most eight steps."""
    monkeypatch.setattr(engines, "TRIPS", 8)
    A, R, nu = np.array([2.0, 0.5, 4.0]), 0.25, np.array([3.0, 0.1, -20.0])
    found = robust(A[:, None, None], np.array([[R]]), nu[:, None], loss.numbers(1))
    for a, y, w in zip(A, nu, found, strict=True):
        assert w == pytest.approx(float(loss.weight(np.array(R * y * y / (a * w + R) ** 2), 1)), rel=1e-9)


@pytest.mark.parametrize("loss", [Huber(), Student(3)])
@pytest.mark.parametrize("m", [1, 3])
def test_the_weight_of_a_loss_is_the_slope_of_its_cost(loss: Loss, m: int):
    for square in (0.3, 5.0, 400.0):
        slope = (loss.cost(square * (1 + 1e-6), m, np) - loss.cost(square * (1 - 1e-6), m, np)) / (2e-6 * square)
        assert 2 * slope == pytest.approx(float(loss.weight(np.array(square), m)), rel=1e-6)


WRONG: dict[str, tuple[Any, str]] = {
    "no gate": (
        lambda: filter(gate=None, after_rejections=(3, "reset")),
        "needs a `gate`: without one no value",
    ),
    "no count": (lambda: filter(after_rejections="reset"), 'must be a count and a word, as .10, "reset"., but is'),
    "zero": (lambda: filter(after_rejections=(0, "reset")), "The count of `after_rejections` of .* must be a whole"),
    "a word": (lambda: filter(after_rejections=(3, "restart")), 'must be "inflate", "reset" or "stop", but is'),
    "degrees": (lambda: Student(0.5), "`degrees` of co.losses.Student must be a finite number from 1"),
}


@pytest.mark.parametrize(("call", "says"), WRONG.values(), ids=WRONG)
def test_a_wrong_use_raises_one_sentence(call: Any, says: str):
    with pytest.raises(co.errors.ArgumentError, match=says):
        call()


def test_a_measurement_of_no_numbers_and_a_force_on_nothing_are_errors():
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi)
    nothing, process = Measurement(lambda m: m.q, 0.1), ModelProcess(body, body.state())
    with pytest.raises(co.errors.ArgumentError, match=r"measurement `a` returns no number: .* without `additional`, q"):
        Filter(process, body.state(), measurements={"a": nothing}, deviations={"g": 0.1}, accuracy=False)
    with pytest.raises(co.errors.ArgumentError, match="`noise` gives `force`, but this system is without `additional`"):
        ModelProcess(body, body.state(), noise={"force": 0.1})
