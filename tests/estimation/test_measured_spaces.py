"""Measurements that live on groups and on the sphere: residuals, and what filters state of their errors."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import chi2

import coadjoint as co
from coadjoint.estimation import Filter, InertialState, Measurement, ModelProcess, StrapdownProcess
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.spaces.measured_spaces import measured_space

PITCHES = (0.0, 60.0, 88.0)
S = 0.05
"""rad, of attitudes and directions."""

KINDS: dict[str, Any] = {
    "body": Measurement(lambda m: m.g, space=co.SO3(), deviation=[S, 2 * S, S], coordinates="rpy"),
    "space": Measurement(lambda m: m.g, space=co.SO3(), deviation=S, coordinates="xyzw", error_side="space"),
    "pose": Measurement(lambda m: (m.g, m.q), space=co.SE3(), deviation=[S, S, S, 0.1, 0.2, 0.1]),
    "direction": Measurement(lambda m: m.a.north, space=co.Sphere(), deviation=S),
    "bearing": Measurement(
        lambda m: (m.q[:1], m.a.north), space=(None, co.Sphere()), coordinates=(None, "bearing"), deviation=[0.2, S, S]
    ),
}  # fmt: skip


def spread(members: int, steps: int, pitch: float, one: Measurement, seed: int):
    """(NEES, NIS, their degrees of freedom) of an inertial unit whose attitude is uncertain by 0.1 rad."""
    random, unit = np.random.default_rng(seed), process()
    start = InertialState(rotation=co.attitude.zyx(0.3, np.radians(pitch), -0.2), velocity=(1.0, 0.0, 0.2))
    deviations = {"attitude": 0.1, "velocity": 0.1, "position": 0.3}
    many = Filter(unit, start, measurements={"y": one}, deviations=deviations, members=members)
    first = unit.moved(many.rows, random.multivariate_normal(np.zeros(unit.width), many.P[0], members))
    truth = [unit.with_inputs(first, {"imu": READING})]
    for _ in range(steps):
        truth.append(unit.drawn(truth[-1], 0.1, random))
    times, truth = 0.1 * np.arange(1, steps + 1), np.stack(truth)
    held = {"imu": (np.concatenate([[0.0], times[:-1]]), np.tile(READING, (steps, 1)))}
    found = many.run({"y": (times, many.drawn(truth[1:], random)["y"])}, dt=0.1, inputs=held, covariances=True)
    nees, free = found.nees(truth)
    return nees[1:], found.nis["y"].nis, free, many._measured.prepared["y"].space.dim


READING = np.array([0.1, -0.05, 0.2, 0.3, 0.0, -9.81])


@cache
def process() -> StrapdownProcess:
    return StrapdownProcess(noise={"gyroscope": 0.01, "accelerometer": 0.02})


@pytest.mark.parametrize("kind", ["body", "direction"])
def test_forty_filters_state_their_errors_at_a_pitch_of_88_degrees(kind: str):
    nees, nis, free, m = spread(40, 4, 88.0, KINDS[kind], 3)
    for squares, dof in ((nees[-1], free), (nis, m)):
        low, high = chi2.ppf([0.001, 0.999], dof * squares.size) / squares.size
        assert low < squares.mean() < high


def test_an_iterated_update_is_the_least_of_its_cost_on_the_sphere():
    """½ Σ ηᵢ²/σᵢ² + ½ |ν(η)|²/(s² + s⁴) of a precise sensor and a vague prior, by SciPy; not Kalman's update."""
    unit, sigma, y = process(), np.array([0.5, 0.1, 0.3]), np.array([0.8, 0.5, -0.33])
    one = {n: Measurement(lambda m: m.g[0], space=co.Sphere(), deviation=S, iterations=n) for n in (1, None, 8)}

    def fresh(n: int | None) -> Filter:
        return Filter(unit, InertialState(), measurements={"y": one[n]}, deviations={"attitude": sigma})

    found = {n: fresh(n) for n in one}
    row, space = found[1].rows[0].copy(), found[1]._measured.prepared["y"].space
    reading, rest = unit.reading(one[1].function, False), np.zeros(unit.width - 3)

    def residual(eta: Any) -> Any:
        there = unit.retract(jnp.asarray(row), jnp.concatenate([eta, rest]))
        return jnp.concatenate([eta / sigma, space.difference(reading(there), jnp.asarray(y)) / (S * np.hypot(1, S))])

    eta = least_squares(tabulate(residual, np.zeros(3)), np.zeros(3), xtol=1e-14, ftol=1e-14).x
    least = unit.moved(row[None], np.concatenate([eta, rest])[None])
    arrays = fresh(8)
    arrays._engine._filters = None
    off = {}
    for n, filter in [*found.items(), ("arrays", arrays)]:
        filter.update({"y": y})
        off[n] = np.max(np.abs(filter.rows - least))
        filter.predict(0.1, {"imu": READING})
    assert off[1] > 0.01 and off[None] < 0.3 * off[1] and off[8] < 1e-6 and off["arrays"] < 1e-6
    np.testing.assert_allclose(found[8].P, arrays.P, atol=1e-9)


def test_the_noise_of_a_curved_space_tells_less_by_its_ricci_curvature():
    h = evaluate(lambda: (co.SO3().identity(), jnp.zeros(3), jnp.eye(3)[0], 0.0))
    spaces = (co.SE3(), co.Sphere(), co.SO2()), (h[:2], h[2], h[3])
    together = measured_space(*spaces, "body", None, "y")
    np.testing.assert_allclose(together.curvature, np.diag([1, 1, 1, 0, 0, 0, 1, 1, 0]), atol=1e-12)
    np.testing.assert_allclose(measured_space(co.SO3(), h[0], "body", None, "y").curvature, np.eye(3) / 2, atol=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["attitude", "directions"])
def test_filters_of_an_attitude_known_to_four_tenths_state_their_errors(kind: str):
    """After five updates of 4000 members; with R in the place of R + R Ric R the NEES is 3.2 and 3.5 of 3."""
    system = co.System(co.SO3(), lambda xi, a: 0.5 * xi @ xi, advected={"down": co.Defining(), "north": co.Defining()})
    start, s, members = system.state(a0={"down": [0, 0, 1], "north": [1, 0, 0]}), 0.4, 4000
    one = {
        "attitude": Measurement(lambda m: m.g, space=co.SO3(), deviation=s),
        "directions": Measurement(lambda m: (m.a.down, m.a.north), space=(co.Sphere(), co.Sphere()), deviation=s),
    }[kind]
    unit, random = ModelProcess(system, start), np.random.default_rng(3)
    many = Filter(unit, start, measurements={"y": one}, deviations={"g": s}, members=members, accuracy=False)
    truth = unit.moved(many.rows, np.pad(s * random.normal(size=(members, 3)), ((0, 0), (0, unit.width - 3))))
    for _ in range(5):
        many.update(many.drawn(truth, random))
    e = unit.errors(many.rows, truth)[:, :3]
    nees = np.einsum("bi,bi->b", e, np.linalg.solve(many.P[:, :3, :3], e[..., None])[..., 0])
    assert abs(nees.mean() - 3) < (0.1 if kind == "attitude" else 0.2)


@pytest.mark.long
@pytest.mark.parametrize("s", [0.01, S, 0.2])
@pytest.mark.parametrize("pitch", PITCHES)
@pytest.mark.parametrize("kind", ["body", "space", "pose", "direction", "bearing"])
def test_two_thousand_filters_state_their_errors_at_any_pitch(kind: str, pitch: float, s: float):
    """Means of NEES and NIS at single times are those of χ², up to what 0.2 rad adds by curvature, its square.

    Of 200 members the fraction of times in a band says less: NEES of neighbouring times are alike. One bearing leaves
    the turn about it open, 0.1 rad, along which 1 g drives the place 8 m away in 4 s: a place measured to 0.04 m is no
    linear function of that any more, so that `bearing` is judged for 1 s.
    """
    one = replace(KINDS[kind], covariance=None, deviation=KINDS[kind].covariance ** 0.5 * s / S)
    nees, nis, free, m = spread(2000, 40, pitch, one, 11)
    for squares, dof in ((nees, free), (nis, m)):
        off = np.abs(squares.mean(axis=1)[[0, 10] if kind == "bearing" else [0, 10, 20, 39]] / dof - 1)
        assert np.all(off < 3.3 * np.sqrt(2 / dof / 2000) + 0.5 * s**2), (off, dof)


@pytest.mark.parametrize(
    ("side", "coordinates"), [("body", None), ("space", "wxyz"), ("body", "xyzw"), ("space", "zyx"), ("body", "rpy")]
)
def test_an_error_is_that_of_its_side_in_any_coordinates(side: str, coordinates: str | None):
    random = np.random.default_rng(1)
    h, e = (co.attitude.zyx(0.3, 1.5, -0.2), random.normal(size=3)), random.normal(size=6)
    space = measured_space(co.SE3(), h, side, coordinates, "y")
    g = co.SE3()
    y = evaluate(lambda h, e: space.numbers(space.moved(h, e)), h, e)
    turn = evaluate(g.exp, e)
    theirs = evaluate(lambda *pair: space.numbers(g.compose(*pair)), *((h, turn) if side == "body" else (turn, h)))
    np.testing.assert_allclose(y, theirs, atol=1e-14)
    np.testing.assert_allclose(evaluate(space.difference, h, y), -e, atol=1e-12)
    if coordinates in ("wxyz", "xyzw"):
        np.testing.assert_allclose(evaluate(space.difference, h, np.concatenate([-y[:4], y[4:]])), -e, atol=1e-12)


@pytest.mark.parametrize("coordinates", [None, "bearing"])
@pytest.mark.parametrize("h", [[0.3, -0.4, 0.2], [0.0, 0.0, 1.0], [-1.0, 0.0, 1e-9]])
def test_an_error_of_a_direction_is_an_angle_up_to_half_a_turn(h: list[float], coordinates: str | None):
    space, direction = measured_space(co.Sphere(), np.ones(3), "body", coordinates, "y"), np.array(h)
    u = direction / np.linalg.norm(direction)
    for e in (np.array([1e-9, 0.0]), np.array([0.3, -0.4]), np.array([2.0, 2.4])):
        y = evaluate(lambda h, e: space.numbers(space.moved(h, e)), direction, e)
        off = evaluate(space.difference, direction, y)
        v = evaluate(space.value, y)
        assert np.linalg.norm(off) == pytest.approx(np.linalg.norm(e), rel=1e-9)
        assert np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v) == pytest.approx(np.linalg.norm(e), rel=1e-9)
    still = evaluate(space.numbers, direction)
    slopes = evaluate(jax.jacfwd(lambda h: space.difference(h, jnp.asarray(still))), u)
    np.testing.assert_allclose(np.asarray(slopes) @ np.asarray(slopes).T, np.eye(2), atol=1e-12)


@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize("off", [0.0, 1e-9])
def test_a_direction_opposite_to_the_estimate_is_half_a_turn_away_and_a_gate_rejects_it(native: bool, off: float):
    def fresh(gate: float | None) -> Filter:
        one = Measurement(lambda m: m.g[0], space=co.Sphere(), deviation=S, gate=gate)
        found = Filter(process(), InertialState(), measurements={"y": one}, deviations={"attitude": 0.1})
        if not native:
            found._engine._filters = None
        return found

    filter, y = fresh(0.999), np.array([-1.0, off, 0.0])
    found = filter.update({"y": y})["y"]
    assert not found.used and found.nis == pytest.approx(np.pi**2 / (0.01 + S**2), rel=1e-6)
    taken = fresh(None)
    assert taken.update({"y": y})["y"].used
    assert np.all(np.isfinite(taken.P)) and np.arccos(taken.state.rotation[0][0]) > 0.5 * np.pi * 0.01 / (0.01 + S**2)


def test_the_slope_of_a_difference_is_the_inverse_differential_of_exp():
    """∂(h ⊖ y) = J_r⁻¹(h ⊖ y) dξ of h exp(dξ), not the identity."""
    space = measured_space(co.SO3(), np.eye(3), "body", None, "y")
    h, e = co.attitude.zyx(0.3, 1.2, -0.2), np.array([0.5, -0.7, 0.3])
    y = evaluate(lambda: space.numbers(space.moved(h, e)))
    slopes = evaluate(jax.jacfwd(lambda d: space.difference(h @ co.SO3().exp(d), jnp.asarray(y))), np.zeros(3))
    ad = np.cross(-e, np.eye(3)).T
    t = np.linalg.norm(e)
    inverse = np.eye(3) + 0.5 * ad + (1 / t**2 - (1 + np.cos(t)) / (2 * t * np.sin(t))) * ad @ ad
    np.testing.assert_allclose(slopes, inverse, atol=1e-12)


def given(**options: Any) -> Any:
    """A filter with one measurement."""
    usual: dict[str, Any] = {"function": lambda m: m.g, "deviation": S, **options}
    known = {"y": Measurement(**usual)}
    return Filter(process(), InertialState(), measurements=known, deviations={"attitude": 0.1})


def quaternions() -> Any:
    return given(space=co.SO3(), coordinates="wxyz")


WRONG: dict[str, Any] = {
    "no space": (lambda: given(space="SO3"), "`space` of the measurement `y` must be a group such as co.SO3.., co.Sph"),
    "a side": (lambda: given(space=co.SO3(), error_side="left"), '`error_side` of .* must be "body" or "space"'),
    "coordinates": (lambda: given(space=co.SO3(), coordinates="wxyx"), "`coordinates` of .*: did you mean `wxyz`?"),
    "coordinates of a vector": (lambda: given(coordinates="wxyz"), '"wxyz"` of .* is of co.SO3.. or co.SE3.., but its'),
    "a bearing on SO3": (lambda: given(space=co.SO3(), coordinates="bearing"), "of co.Sphere.., but its space is SO3"),
    "a vector on SO3": (lambda: given(function=lambda m: m.q, space=co.SO3()), r"must return an element of SO3.*3,"),
    "a matrix on the sphere": (lambda: given(space=co.Sphere()), "must return a direction, a vector .3,., but"),
    "one value of two": (lambda: given(space=(None, co.SO3())), "has 2 spaces: its function returns a tuple of"),
    "nine deviations": (lambda: given(space=co.SO3(), deviation=[S] * 9), "its noise has 3 numbers, on SO3"),
    "both": (lambda: given(covariance=0.1), "either a `covariance` or a `deviation`"),
    "a negative deviation": (lambda: given(deviation=-1.0), "`deviation` of .* must be a positive number, or one for"),
    "no iterations": (lambda: given(iterations=0), "`iterations` of co.estimation.Measurement must be"),
    "a loss": (lambda: given(loss="huber"), "`loss` of .* must be co.losses.Huber.. or co.losses.Student.., but is"),
    "a threshold": (lambda: co.losses.Huber(0.0), "`threshold` of co.losses.Huber must be positive, but is 0.0"),
    "a matrix as quaternion": (lambda: quaternions().update({"y": np.eye(3)}), "`y` of `measured` is 4 numbers"),
    "no quaternion": (
        lambda: quaternions().update({"y": [1, 1, 0, 0]}),
        "a unit quaternion .w, x, y, z.: .* off it by 0.41",
    ),
    "no rotation": (lambda: given(space=co.SO3()).update({"y": np.eye(3) + 0.1}), "must be on SO3..: number 1 of 1"),
    "a row of a log": (
        lambda: quaternions().run({"y": ([1.0, 2.0], [[1, 0, 0, 0], [0, 0, 0, 0]])}, dt=1.0),
        "number 2 of 2, .0.0, 0.0, 0.0, 0.0., is off it by 1. Check order",
    ),
    "no generator": (lambda: quaternions().drawn(process().example, 3), "`random` must be np.random.default_rng"),
}  # fmt: skip


@pytest.mark.parametrize(("call", "says"), WRONG.values(), ids=WRONG)
def test_a_wrong_use_of_a_space_raises_one_sentence(call: Any, says: str):
    with pytest.raises(co.errors.ArgumentError, match=says) as caught:
        call()
    assert len(str(caught.value)) < 400 and "\n" not in str(caught.value)


@pytest.mark.long
def test_a_filter_by_a_model_smooths_attitudes_and_reads_quaternions_of_either_sign():
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ (np.array([1.0, 2.0, 3.0]) * xi))
    start = body.state(g=co.attitude.zyx(0.3, 1.55, 0.1), xi=[0.1, 0.2, -0.1])
    model = ModelProcess(body, start, noise={"torque": 0.01})
    known = {"y": Measurement(lambda m: m.g, space=co.SO3(), deviation=0.02, coordinates="wxyz", gate=0.999)}
    one = Filter(model, start, measurements=known, deviations={"g": 0.2, "xi": 0.05})
    run = co.simulate(body, start, dt=0.1, duration=2.0, monitors=False)
    y = co.attitude.to_quaternion(np.asarray(run.records.g))[1:] * np.where(np.arange(20) % 2, -1.0, 1.0)[:, None]
    found = one.run({"y": (run.dataset.time.values[1:], y)}, dt=0.1, covariances=True)
    assert found.nis["y"].used.all() and np.max(found.nis["y"].nis) < 1e-3
    smooth = co.estimation.smoothed(found)
    off = model.errors(smooth.rows, model.rows_of(run, found.t))
    assert np.max(np.abs(off)) < 1e-6 and smooth.deviations[0, 0] < found.deviations[0, 0]
