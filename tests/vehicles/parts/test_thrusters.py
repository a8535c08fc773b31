"""Thrusters: force curves and their inverses, geometry, allocation, lag, and the work that they do on a craft."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.named import Named, named
from coadjoint_vehicles import Craft, Vehicle
from coadjoint_vehicles.files.file import vehicle_from_text
from coadjoint_vehicles.files.writing import vehicle_to_toml
from coadjoint_vehicles.parts import T200, Damping, Thrusters, force_curves
from coadjoint_vehicles.parts.allocator import Allocator
from coadjoint_vehicles.parts.bounded_thrusts import bounded
from coadjoint_vehicles.parts.force_curves import ForceCurve
from coadjoint_vehicles.parts.part import Flow
from coadjoint_vehicles.parts.published_curves import force_curve

S = 0.5**0.5
ONE: dict[str, Any] = {"positions": [[0, 0, 0]], "directions": [[1, 0, 0]]}

# RexROV (Manhães et al. 2016): rexrov_actuators.xacro and its published allocation matrix TAM.yaml, axes FLU.
REXROV_PLACES = [(0.890895 * x, 0.334385 * y, 0.528822) for x, y in ((-1, 1), (-1, -1), (1, 1), (1, -1))] + [
    (0.412125 * x, 0.505415 * y, 0.129) for x, y in ((-1, 1), (-1, -1), (1, 1), (1, -1))
]
REXROV_PITCH_YAW = np.radians(
    [(-74.53, -53.21), (-74.53, 53.21), (-105.47, 53.21), (-105.47, -53.21), (0, 45), (0, -45), (0, 135), (0, -135)]
)
REXROV_TAM = [
    [0.1597427, 0.1597427, -0.1597424, -0.1597424, 0.7071069, 0.7071069, -0.7071065, -0.7071065],
    [-0.2136101, 0.2136101, -0.2136098, 0.2136098, 0.7071067, -0.7071067, 0.7071070, -0.7071070],
    [0.9637702, 0.9637702, 0.9637703, 0.9637703, 0.0, 0.0, 0.0, 0.0],
    [0.4352320, -0.4352320, 0.4352319, -0.4352319, -0.0912168, 0.0912168, -0.0912168, 0.0912168],
    [0.9430935, 0.9430935, -0.9430935, -0.9430935, 0.0912168, 0.0912168, -0.0912167, -0.0912167],
    [0.1368886, -0.1368886, -0.1368884, 0.1368884, -0.6487988, 0.6487988, 0.6487987, -0.6487987],
]
# BlueROV2 Heavy (facts E2): controllers.yaml of Robotic-Decision-Making-Lab/blue, axes FRD, to three digits.
BLUEROV_TAM = np.array(
    [
        [0.707, 0.707, 0.707, 0.707, 0, 0, 0, 0],
        [-0.707, 0.707, 0.707, -0.707, 0, 0, 0, 0],
        [0, 0, 0, 0, -1, 1, 1, -1],
        [0, 0, 0, 0, -0.21805, -0.21805, 0.21805, 0.21805],
        [0, 0, 0, 0, -0.12, 0.12, -0.12, 0.12],
        [-0.1888, 0.1888, -0.1888, 0.1888, 0, 0, 0, 0],
    ]
)


def rexrov(**changes: Any) -> Thrusters:
    pitch, yaw = REXROV_PITCH_YAW.T
    axes = np.stack([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), -np.sin(pitch)], axis=1)
    given = {"curve": {"quadratic": 0.00031}, "positions": REXROV_PLACES, "directions": axes, "limit": 1000.0}
    return Thrusters("thrusters", **{**given, **changes})


def own(part: Thrusters) -> Named:
    return named(part.parameters())


CURVES = {
    "linear": force_curve({"linear": 40.0}, "x"),
    "quadratic": force_curve({"quadratic": (0.3, 0.2)}, "x"),
    "polynomial": force_curve({"polynomial": (1.0, 0.3, 0.5)}, "x"),
    "flat polynomial": force_curve({"polynomial": (0.0, 0.0, 2.0)}, "x"),
    "table": force_curve({"table": [(-5, -9), (-1, -1), (0, 0), (2, 1), (5, 20)]}, "x"),
}


@dataclass(frozen=True, eq=False)
class Cubic(ForceCurve):
    """F = c u³."""

    kind: ClassVar[str] = "cubic"
    factor: Any

    def force(self, command, own):
        return own.factor * command**3

    def command(self, force, own, limit):
        return jnp.cbrt(force / own.factor)


def test_a_curve_is_a_class_and_a_line_and_is_read_and_written_in_vehicle_files(monkeypatch):
    monkeypatch.setitem(force_curves.CURVES, "cubic", Cubic)
    rover = co.vehicles.load("bluerov2_heavy_blue")
    thrusters = next(part for part in rover.parts if isinstance(part, Thrusters))
    changed = replace(thrusters, curve={"cubic": np.float64(40.0)}, limit=(-1.0, 1.0), unit="1")
    text = vehicle_to_toml(replace(rover, parts=tuple(changed if part is thrusters else part for part in rover.parts)))
    again = next(part for part in vehicle_from_text(text).parts if isinstance(part, Thrusters))
    assert isinstance(again.curve, Cubic) and again.curve.factor == 40.0


@pytest.mark.parametrize("kind", CURVES)
def test_the_command_for_a_force_gives_that_force(kind):
    curve = CURVES[kind]
    numbers = Named(**curve.parameters())
    u = np.concatenate([np.random.default_rng(3).uniform(-5, 5, 40), [0.0, -5.0, 5.0]])
    force = evaluate(curve.force, u, numbers)
    found = evaluate(lambda F, p: curve.command(F, p, (-5.0, 5.0)), force, numbers)
    np.testing.assert_allclose(evaluate(curve.force, found, numbers), force, rtol=1e-12, atol=1e-13)
    if kind != "flat polynomial":
        np.testing.assert_allclose(found, u, rtol=1e-11, atol=1e-12)


def test_a_table_is_the_straight_lines_between_its_rows_and_constant_beyond():
    curve = CURVES["table"]
    u = np.random.default_rng(4).uniform(-8, 8, 100)
    found = evaluate(curve.force, u, Named(**curve.parameters()))
    np.testing.assert_allclose(found, np.interp(u, [-5, -1, 0, 2, 5], [-9, -1, 0, 1, 20]), atol=1e-14)


@pytest.mark.parametrize("forces", [(-0.3, 0.0, 0.5), (-2.0, -1.0, 0.0), (0.0, 0.2, 0.4)])
def test_a_table_may_push_little_or_in_one_direction_alone(forces):
    commands = np.array([-1.0, 0.0, 1.0])
    curve = force_curve({"table": list(zip(commands, forces, strict=True))}, "x")
    np.testing.assert_allclose(evaluate(curve.force, commands, Named(**curve.parameters())), forces, atol=1e-15)


def test_the_t200_at_16_volts_has_its_published_ends_and_dead_band():
    part = Thrusters("thrusters", T200, **ONE, unit="µs")
    assert part.command.start == 1500.0 and tuple(part.limit) == (1100.0, 1900.0)
    at = np.array([1100.0, 1308.0, 1472, 1500, 1528, 1624, 1728, 1840, 1900])
    published = np.array([-4.07, -1.35, 0, 0, 0, 0.87, 2.22, 4.25, 5.25]) * 9.80665
    found = evaluate(part.thrusts, at, own(part))
    np.testing.assert_allclose(found, published, atol=0.5)
    assert np.all(found[2:5] == 0.0)
    np.testing.assert_allclose(found[[0, -1]], published[[0, -1]], rtol=1e-14)
    # The command of no force is the middle of the dead band; a small force is beyond its edge.
    commands = evaluate(part.commands_for, np.array([0.0, 0.1, -0.1]), own(part))
    assert commands[0] == 1500.0 and commands[1] > 1528.0 and commands[2] < 1472.0


def test_in_its_dead_band_a_thruster_pushes_nothing_and_beyond_it_as_its_curve():
    part = Thrusters("thrusters", {"quadratic": 2.0}, **ONE, limit=10.0, dead_band=1.0)
    u = np.array([-3.0, -0.999, 0.0, 0.999, 1.0, 3.0])
    np.testing.assert_array_equal(evaluate(part.thrusts, u, own(part)), [-18, 0, 0, 0, 2, 18])
    # The nearest force that there is: none below half of that at the edge.
    wanted = np.array([0.9, 1.1, 1.9, 8.0, -0.9, -1.1])
    found = evaluate(lambda F, p: part.thrusts(part.commands_for(F, p), p), wanted, own(part))
    np.testing.assert_allclose(found, [0, 2, 2, 8, 0, -2], rtol=1e-10)


def test_thrust_at_bollard_grows_with_the_density_of_the_water():
    part = Thrusters("thrusters", {"quadratic": 2.0}, **ONE, limit=10.0, density=1000.0)
    still = Flow(*np.zeros((2, 3)), np.float64(1026.0), np.array([0.0, 0, 1]), 0.0, 0.0)  # pyright: ignore
    pushed = evaluate(part.force, still, np.array([3.0]), own(part))
    np.testing.assert_allclose(pushed.force, [18 * 1.026, 0, 0], rtol=1e-14)


def test_rexrovs_geometry_gives_its_published_allocation_matrix():
    part = rexrov()
    np.testing.assert_allclose(evaluate(part.matrix, own(part)), REXROV_TAM, atol=1e-6)


def test_bluerovs_matrix_is_that_of_eight_thrusters_at_corners():
    """|N| = 0.1888 = (x + y)/√2 of horizontal thrusters at (±x, ±y); vertical ones stand at (0.12, 0.21805) m."""
    x = y = 0.1888 * S
    corners = [(x, y), (x, -y), (-x, y), (-x, -y)]
    directions = [(S, -S, 0), (S, S, 0), (S, S, 0), (S, -S, 0), (0, 0, -1), (0, 0, 1), (0, 0, 1), (0, 0, -1)]
    upright = [(-0.12, 0.21805), (-0.12, -0.21805), (0.12, 0.21805), (0.12, -0.21805)]
    places = [(*c, 0) for c in corners] + [(*c, 0) for c in upright]
    part = Thrusters("thrusters", {"linear": 1.0}, positions=places, directions=directions)
    np.testing.assert_allclose(evaluate(part.matrix, own(part)), BLUEROV_TAM, atol=2e-4)


def test_the_reaction_of_a_propeller_turns_about_its_own_axis():
    part = Thrusters("thrusters", {"linear": 1.0}, positions=[[0, 1, 0]], directions=[[1, 0, 0]], torque=0.03)
    np.testing.assert_allclose(evaluate(part.matrix, own(part))[:, 0], [1, 0, 0, 0.03, 0, -1], atol=1e-15)
    twin = rexrov(torque=[0.02, -0.02] * 4)
    B, plain = evaluate(twin.matrix, own(twin)), evaluate(rexrov().matrix, own(rexrov()))
    np.testing.assert_allclose((B - plain)[3:], 0.02 * plain[:3] * ([1, -1] * 4), atol=1e-15)


@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", ["matrix", "geometry", "table"])
def test_allocated_commands_give_the_wrench_or_within_the_limits_its_least_squares(kind):
    part = {
        "geometry": rexrov(),
        "matrix": Thrusters("thrusters", {"linear": 40.0}, allocation=BLUEROV_TAM, limit=1.0),
        "table": Thrusters("thrusters", "T200", allocation=BLUEROV_TAM),
    }[kind]
    random, given, B = np.random.default_rng(7), [], np.asarray(part.nominal_matrix)
    for size in (1e-3, 0.3, 30.0, 5000.0):
        for _ in range(3):
            wrench = random.normal(size=6) * size
            f = np.asarray(evaluate(part.thrusts, part.allocate(wrench), own(part)))
            given.append(np.allclose(B @ f, wrench, rtol=0, atol=1e-9 * size))
            assert_least_squares(part.allocator, f, wrench)
    assert given == [True] * 6 + given[6:9] + [False] * 3


def assert_least_squares(allocator, f, wrench):
    """By the conditions of Karush, Kuhn and Tucker: a gradient of 0, or out of the limits where a thrust is at one."""
    kept = allocator.kept
    A = (np.asarray(allocator.weights) / allocator.units)[kept, None] * allocator.matrix[kept]
    y = (np.asarray(allocator.weights) / allocator.units)[kept] * wrench[kept]
    gradient = A.T @ (y - A @ f) / (np.linalg.norm(A) * np.linalg.norm(y))
    slack = 1e-9 * (allocator.high - allocator.low)
    high, low = f >= allocator.high - slack, f <= allocator.low + slack
    assert np.all((f <= allocator.high + slack) & (f >= allocator.low - slack))
    pushed = np.where(high, np.minimum(gradient, 0), np.where(low, np.maximum(gradient, 0), gradient))
    np.testing.assert_allclose(pushed, 0.0, atol=1e-9)


WEIGHTS = (1.0, 1, 1, 30, 30, 30)


def layouts() -> dict[str, tuple[Any, Any, Any]]:
    """Twenty layouts (B, lowest, highest): rounded, redundant, with one failed, and of one direction."""
    random, found = np.random.default_rng(11), {}
    for z in (0.0, 1e-3, 1e-2):
        found[f"vectored {z}"] = (np.asarray(vectored(z).nominal_matrix), np.full(6, -50.0), np.full(6, 50.0))
    for name, failed in (("heavy", []), ("one failed", [2]), ("another failed", [6])):
        B = BLUEROV_TAM.copy()
        B[:, failed] = 0.0
        found[name] = (B, np.full(8, -40.0), np.full(8, 50.0))
    found["one way"] = (BLUEROV_TAM, np.array([0, 0, -40, -40, 0, -40, -40, -40.0]), np.full(8, 50.0))
    for k in range(13):
        n = int(random.integers(3, 11))
        places, ways = random.normal(size=(n, 3)) * 0.4, random.normal(size=(n, 3))
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        low = -random.uniform(10, 60, n)
        low[random.integers(0, n, k % 3)] = 0.0
        found[f"random {k}"] = (np.vstack([ways.T, np.cross(places, ways).T]), low, random.uniform(10, 60, n))
    return found


def against_least_squares(names: Any, count: int) -> float:
    """The largest error of wrenches, relative, against bounded-variable least squares of SciPy."""
    from scipy.optimize import lsq_linear

    random, worst = np.random.default_rng(12), 0.0
    for name in names:
        B, low, high = layouts()[name]
        allocator = Allocator(B, low, high, weights=np.array(WEIGHTS))
        kept, units = allocator.kept, allocator.units
        wrenches = random.normal(size=(count, 6)) * units * 10 ** random.uniform(0, 3.5, (count, 1))
        with co.float64():
            found = np.asarray(jax.jit(jax.vmap(allocator.thrusts))(jnp.asarray(wrenches)))
        A = (np.array(WEIGHTS) / units)[kept, None] * B[kept]
        for wrench, f in zip(wrenches, found, strict=True):
            y = (np.array(WEIGHTS) / units)[kept] * wrench[kept]
            best = lsq_linear(A, y, (low, high), method="bvls", tol=1e-15, max_iter=1000).x
            assert np.all(f >= low) and np.all(f <= high)
            worst = max(worst, np.abs(B[kept] @ (f - best)).max() / max(np.abs(wrench).max(), 1.0))
    return worst


@pytest.mark.parametrize(
    ("A", "y", "low", "high"),
    [
        ([[1.0, 1, 0.3], [15, -15, 3]], [20, 30], [0, -3, -2], [4, 5, 2]),
        ([[-0.5, -0.3, 0.4], [10, -1, 14]], [-13, 70], [-1, -2, -3], [3, 2, 1]),
        ([[0.8, 0.8, 0.1], [-14, -1, -8]], [-28, 52], [-1, -2, -3], [3, 2, 1]),
    ],
    ids=["one way", "a limit that is left for the other", "a limit that is left"],
)
def test_with_weights_the_thrusts_are_bounded_least_squares(A, y, low, high):
    """By the conditions of Karush, Kuhn and Tucker: a gradient of 0, or out of the limits where a thrust is at one."""
    A, low, high = (np.array(x, dtype=float) for x in (A, low, high))
    f0 = np.linalg.pinv(A) @ np.array(y)
    f = evaluate(lambda f0: bounded(A, f0, low, high), f0)
    gradient = A.T @ A @ (f0 - f)
    assert np.all(f >= low) and np.all(f <= high) and np.any((f == high) | (f == low))
    pushed = np.where(f == high, np.minimum(gradient, 0), np.where(f == low, np.maximum(gradient, 0), gradient))
    np.testing.assert_allclose(pushed, 0.0, atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("layout", range(20))
def test_with_weights_many_random_wrenches_are_bounded_least_squares(layout):
    assert against_least_squares([list(layouts())[layout]], 500) < 1e-9


def given(part: Thrusters, wrenches: np.ndarray) -> np.ndarray:
    """The thrusts of wrenches (k, 6) by their commands, (k, n)."""

    def thrusts(wrench: Any) -> Any:
        return part.thrusts(part.commands_for(part.allocator.thrusts(wrench), own(part)), own(part))

    with co.float64():
        return np.asarray(jax.jit(jax.vmap(thrusts))(jnp.asarray(wrenches)))


def test_thrusters_to_spare_give_exactly_what_dead_bands_would_take():
    """Rounded one by one to nothing or to an edge, thrusts would miss some newtons of nearly every wrench."""
    part = Thrusters("thrusters", {"linear": 40.0}, allocation=BLUEROV_TAM, limit=1.0, dead_band=0.15)
    B, random = np.asarray(part.nominal_matrix), np.random.default_rng(4)
    wrenches = B.dot(random.uniform(-12, 12, (8, 40))).T
    f = given(part, wrenches)
    least = np.abs(wrenches @ np.linalg.pinv(B).T).min(axis=1)
    assert np.mean(least < 6) > 0.9 and np.all((f == 0) | (np.abs(f) >= 6)) and np.all(np.abs(f) <= 40)
    np.testing.assert_allclose(f @ B.T, wrenches, atol=1e-6)


@pytest.mark.long
def test_without_thrusters_to_spare_dead_bands_take_the_least_of_attitude_then_position():
    """Against bounded least squares with each thruster below its band, at rest or beyond it."""
    from itertools import product

    from scipy.optimize import lsq_linear

    pair = {"positions": [[0, 0.5, 0], [0, -0.5, 0]], "directions": [[0, 0, 1]] * 2}
    part = Thrusters("pair", {"linear": 10.0}, limit=1.0, dead_band=0.3, **pair)
    B = np.asarray(part.nominal_matrix)[[2, 3]]
    A = np.diag([1.0, 100 / 0.5]) @ B
    random = np.random.default_rng(6)
    wrenches = B.dot(random.uniform(-6, 6, (2, 30))).T
    found = given(part, np.insert(np.zeros((30, 4)), [2, 2], wrenches, axis=1))
    boxes = [
        (np.array([{-1: -10, 0: -1e-9, 1: 3}[k] for k in at]), np.array([{-1: -3, 0: 1e-9, 1: 10}[k] for k in at]))
        for at in product((-1, 0, 1), repeat=2)
    ]
    for wrench, f in zip(wrenches, found, strict=True):
        y = np.diag([1.0, 200.0]) @ wrench
        best = min(2 * lsq_linear(A, y, box, method="bvls").cost for box in boxes)
        assert np.sum((A @ f - y) ** 2) <= best * (1 + 1e-6) + 1e-6


def test_thrusts_about_dead_bands_have_the_derivative_of_the_thrusters_beyond_them():
    part = Thrusters("thrusters", {"linear": 40.0}, allocation=BLUEROV_TAM, limit=1.0, dead_band=0.15)
    wrench, small = np.array([11.0, 4.0, -9.0, 0.4, 0.3, 0.5]), 1e-5
    around = wrench + small * np.concatenate([np.eye(6), -np.eye(6)])
    f = evaluate(jax.vmap(part.allocator.thrusts), around)
    slope = evaluate(jax.jacobian(part.allocator.thrusts), wrench)
    np.testing.assert_allclose(slope, (f[:6] - f[6:]).T / (2 * small), atol=1e-6)


def test_the_check_of_a_run_and_its_steps_share_one_trace_of_the_allocation(monkeypatch):
    from coadjoint_vehicles.parts import allocator

    calls: list[int] = []
    monkeypatch.setattr(allocator, "bounded", lambda *given: calls.append(1) or bounded(*given))
    part = Thrusters("thrusters", {"linear": 40.0}, allocation=BLUEROV_TAM, limit=1.0)
    for scale in (1.0, 2.0):
        evaluate(lambda wrench: part.allocator.thrusts(scale * wrench), np.ones(6))  # noqa: B023
    assert len(calls) == 2  # of the horizontal and of the vertical thrusters


@pytest.mark.long
@pytest.mark.parametrize("dead_band", [None, 0.4])
def test_weighted_allocation_is_the_same_in_native_code_and_by_xla(dead_band):
    part = vectored(1e-3, axis_weights=WEIGHTS, limit=8.0, dead_band=dead_band)

    def keep(feedback: Any, p: Any) -> dict[str, Any]:
        force = jnp.concatenate([-40.0 * (feedback.position - 1.0), -9.0 * feedback.omega])
        return {"thrusters": part.allocate(force)}

    craft = Craft(vehicle(part, damping=(5.0,) * 6), controller=keep)
    ends = [
        co.simulate(craft.system, craft.start(), dt=0.05, steps=60, backend=backend).final.q
        for backend in ("native", "xla")
    ]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-10)


def test_where_thrusters_saturate_attitude_comes_before_position():
    """Ahead at 400 N and a turn of 6 N m, of which clipping or one scale for all would leave a part."""
    part = Thrusters("thrusters", {"linear": 50.0}, allocation=BLUEROV_TAM, limit=1.0)
    B, wrench = np.asarray(part.nominal_matrix), np.array([400.0, 0, 0, 0, 0, 6.0])
    given = B @ evaluate(part.thrusts, part.allocate(wrench), own(part))
    np.testing.assert_allclose(given[1:5], wrench[1:5], atol=1e-9)
    assert 0.999 * 6 < given[5] < 6 and 100 < given[0] < 0.9 * 4 * 0.707 * 50
    free = np.linalg.pinv(B) @ wrench
    assert (B @ np.clip(free, -50, 50))[5] < 5.9
    turned = B @ evaluate(part.thrusts, part.allocate([0, 0, 0, 0, 0, 100.0]), own(part))
    np.testing.assert_allclose(turned, [0, 0, 0, 0, 0, 4 * 0.1888 * 50], atol=1e-9)


def test_thrusters_that_push_one_way_turn_by_what_they_push_together():
    pair = {"positions": [[0, 0.5, 0], [0, -0.5, 0]], "directions": [[1, 0, 0]] * 2}
    part = Thrusters("pair", {"linear": 1.0}, limit=(0.0, 10.0), **pair)
    np.testing.assert_allclose(part.allocate([12.0, 0, 0, 0, 0, -2.0]), [8, 4], atol=1e-12)
    nearest = (30 + 100**2 * 6) / (1 + 100**2)  # of (f − 30)² + 100² (f − 6)²
    np.testing.assert_allclose(part.allocate([40.0, 0, 0, 0, 0, -2.0]), [10, nearest], atol=1e-9)
    np.testing.assert_allclose(part.allocate([-5.0, 0, 0, 0, 0, 0]), [0, 0], atol=1e-9)


def test_of_several_allocations_that_of_the_least_weighted_thrusts_is_taken_as_far_as_limits_go():
    three = {"positions": [[0, 0.5, 0], [0, 0, 0], [0, -0.5, 0]], "directions": [[1, 0, 0]] * 3}
    part = Thrusters("three", {"linear": 1.0}, limit=10.0, thruster_weights=[1.0, 0.5, 1.0], **three)
    np.testing.assert_allclose(part.allocate([12.0, 0, 0, 0, 0, 0]), [2, 8, 2], atol=1e-12)
    np.testing.assert_allclose(part.allocate([21.0, 0, 0, 0, 0, 0]), [5.5, 10, 5.5], atol=1e-9)
    with pytest.raises(co.errors.ArgumentError, match="`thruster_weights` of the thrusters `three` must be positive"):
        Thrusters("three", {"linear": 1.0}, thruster_weights=[1.0, 0.0, 1.0], **three)


def test_a_wrench_that_no_thrusters_give_becomes_the_nearest_that_they_do():
    part = Thrusters("thrusters", {"linear": 10.0}, positions=[[0, 1, 0], [0, -1, 0]], directions=[[1, 0, 0]] * 2)
    u = part.allocate([20.0, 5, -3, 1, 2, 4])
    given = evaluate(lambda u, p: part.matrix(p) @ part.thrusts(u, p), u, own(part))
    np.testing.assert_allclose(given, [20, 0, 0, 0, 0, 4], atol=1e-12)


BLUEROV2_PLACES = [(0.14, 0.092, 0), (0.14, -0.092, 0), (-0.15, 0.092, 0), (-0.15, -0.092, 0), (0, 0.109, -0.077)]


def vectored(z: float, **changes: Any) -> Thrusters:
    """Six thrusters as those of a BlueROV2, the four horizontal ones with a part z of their direction downward."""
    ways = np.array([(-S, S, z), (-S, -S, z), (S, S, z), (S, -S, z), (0, 0, 1), (0, 0, 1)])
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    given = {"positions": [*BLUEROV2_PLACES, (0, -0.109, -0.077)], "directions": ways, "limit": 50.0, "unit": "N"}
    return Thrusters("thrusters", {"linear": 1.0}, **{**given, **changes})


@pytest.mark.parametrize("z", [0.0, 1e-12, 4.1e-8, 1e-4, 1e-2])
def test_a_direction_that_thrusters_have_by_rounding_alone_is_no_direction_that_they_control(z):
    part = vectored(z)
    assert list(part.allocator.left_out) == [4]
    np.testing.assert_allclose(part.allocate([10.0, 0, 0, 0, 0, 0])[:4], np.array([-1, -1, 1, 1]) * 2.5 / S, rtol=1e-3)


def test_the_least_authority_that_counts_is_given_by_the_user():
    assert not vectored(1e-2, least_authority=1e-6).allocator.left_out
    assert list(vectored(1e-2, least_authority=0.9).allocator.left_out) != [4]


def test_an_axis_that_comes_with_another_is_left_to_the_vehicle_and_the_other_gets_what_it_asks_for():
    low = [(x, y, 0.1) for x, y, _ in BLUEROV2_PLACES[:4]]
    part = vectored(0.0, positions=[*low, BLUEROV2_PLACES[4], (0, -0.109, -0.077)])
    given = np.asarray(part.nominal_matrix) @ part.allocate([10.0, 0, 0, 0, 0, 2.0])
    np.testing.assert_allclose(given, [10, 0, 0, 0, 1.0, 2], atol=1e-12)


def test_each_thruster_may_have_its_own_curve_and_limits_and_is_written_and_read_so():
    part = Thrusters(
        "pair", {"quadratic": ([2.0, 1.0], [1.0, 0.5])}, positions=[[0, 1, 0], [0, -1, 0]],
        directions=[[1, 0, 0]] * 2, limit=[[-3.0, 0.0], [3.0, 5.0]], axis_weights=WEIGHTS,
        thruster_weights=(2.0, 1.0),
    )  # fmt: skip
    np.testing.assert_allclose(evaluate(part.thrusts, np.array([-2.0, 2.0]), own(part)), [-4, 4])
    np.testing.assert_array_equal(part.extremes, [[-9, 0], [18, 25]])
    again: Any = vehicle_from_text(vehicle_to_toml(vehicle(part))).part("pair")
    np.testing.assert_array_equal(again.limit, part.limit)
    np.testing.assert_array_equal(again.axis_weights, WEIGHTS)
    np.testing.assert_array_equal(again.thruster_weights, [2, 1])
    np.testing.assert_array_equal(again.curve.ahead, [2, 1])
    with pytest.raises(co.errors.ArgumentError, match="one for each of the 3"):
        Thrusters("three", part.curve, positions=np.eye(3), directions=np.eye(3))


def vehicle(*parts: Any, damping: Any = (0.0,) * 6) -> Vehicle:
    body = {"mass": 10.0, "inertia": (0.3, 0.4, 0.5), "added_mass": (2.0, 8.0, 9.0, 0.1, 0.2, 0.2)}
    return Vehicle(name="box", **body, parts=(*parts, Damping("damping", linear=damping)))


@pytest.mark.long
def test_a_lagging_thruster_follows_exp_of_time_exactly_whatever_the_step():
    tau = 0.7
    part = Thrusters("thrusters", {"linear": 1e-6}, positions=np.eye(3), directions=np.eye(3), limit=5.0, lag=tau)
    craft = Craft(vehicle(part))
    for h in (0.01, 0.5, 3.0):
        inputs = {"thrusters": co.Held([0.0], [[1.0, -2.0, 9.0]])}
        run = co.simulate(craft.system, craft.start(), dt=h, steps=6, inputs=inputs)
        expected = np.outer(1 - np.exp(-run.dataset.time.values / tau), [1.0, -2.0, 5.0])
        np.testing.assert_allclose(run.dataset.internal_thrusters, expected, atol=1e-13)
    narrow = co.simulate(craft.system.replace(thrusters={"limit": 0.5}), craft.start(), dt=0.5, steps=6, inputs=inputs)
    clipped = np.outer(1 - np.exp(-narrow.dataset.time.values / tau), [0.5, -0.5, 0.5])
    np.testing.assert_allclose(narrow.dataset.internal_thrusters, clipped, atol=1e-13)


@pytest.mark.long
def test_the_budgets_line_of_a_thruster_is_force_times_velocity_and_a_bollard_pull_is_its_curve():
    part = Thrusters("thrusters", {"quadratic": (0.5, 0.4)}, **ONE, limit=10.0)
    craft = Craft(vehicle(part, damping=(6.0, 0, 0, 0, 0, 0)))
    start = craft.start(actuators={"thrusters": [4.0]})
    run = co.simulate(craft.system, start, dt=0.05, duration=8.0)
    assert run.plan.backend == "native"
    time = run.dataset.time.values
    # u̇ (m + X_u̇) = F − d u from rest: u = F/d (1 − exp(−t/τ)), so that ∫ F u dt has a closed form.
    F, d, M = 8.0, 6.0, 12.0
    travelled = F / d * (time - M / d * (1 - np.exp(-d * time / M)))
    np.testing.assert_allclose(run.dataset.q[:, 0], travelled, atol=2e-4)
    np.testing.assert_allclose(run.dataset.work_thrusters, F * run.dataset.q[:, 0], atol=1e-10)
    assert run.summary()["energy_budget_error_max"] < 1e-6


@pytest.mark.long
def test_every_member_of_an_ensemble_has_its_curve_and_gradients_go_through_it():
    part = Thrusters("thrusters", {"quadratic": 0.5}, **ONE, limit=10.0, lag=0.3)
    craft = Craft(vehicle(part))
    start = craft.start()
    inputs = {"thrusters": co.Held([0.0], [[4.0]])}
    many = craft.system.replace(thrusters={"curve": {"ahead": co.each([0.4, 0.5, 0.6])}})
    speeds = co.simulate(many, start, dt=0.05, steps=40, inputs=inputs).final.pi[:, 0]
    np.testing.assert_allclose(speeds / speeds[1], [0.8, 1.0, 1.2], rtol=1e-10)

    def speed(ahead: Any) -> Any:
        system = craft.system.replace(thrusters={"curve": {"ahead": ahead}})
        return co.trajectory(system, start, dt=0.05, steps=40, inputs=inputs, backend="native").final.pi[0]

    with co.float64():
        assert jax.grad(speed)(0.5) == pytest.approx(float(speeds[1]) / 0.5, rel=1e-10)


@pytest.mark.long
def test_a_controller_may_allocate_inside_the_native_kernel():
    part = Thrusters("thrusters", "T200", allocation=BLUEROV_TAM, lag=0.1, unit="µs")

    def keep(feedback: Any, p: Any) -> dict[str, Any]:
        force = -60.0 * (feedback.depth - 1.0) * feedback.down - 60.0 * feedback.velocity
        return {"thrusters": part.allocate(jnp.concatenate([force, -5.0 * feedback.omega]))}

    craft = Craft(vehicle(part), controller=keep)
    run = co.simulate(craft.system, craft.start(), dt=0.05, duration=60.0)
    assert run.plan.backend == "native"
    assert run.final.q[2] == pytest.approx(1.0, abs=0.03)


WRONG = {
    "forces must not fall": {"curve": {"table": [(-1, -2), (0, 0), (1, -1)]}},
    "commands must grow": {"curve": {"table": [(-1, -2), (0, 0), (0, 1)]}},
    "command without force": {"curve": {"table": [(1, 2), (2, 3)]}},
    "must have shape .n, 2.": {"curve": {"table": [1.0, 2.0]}},
    "must be one of linear": {"curve": {"cubic": 1.0}},
    "published T200": {"curve": "T500"},
    "slope .* must be positive": {"curve": {"linear": -1.0}},
    "reversed direction": {"curve": {"quadratic": (1.0, -1.0)}},
    "must not fall between its limits": {"curve": {"polynomial": (1.0, 0.0, -1.0)}, "limit": 2.0},
    "must be given with a polynomial": {"curve": {"polynomial": (1.0, 0.0, 1.0)}, "limit": None},
    "unit vector, but has length 2": {"directions": [[2, 0, 0]]},
    "`directions` .* must have shape .2, 3.": {"positions": [[0, 0, 0], [0, 1, 0]]},
    "`positions` .* must have shape .n, 3.": {"positions": [0, 0, 0]},
    "must have shape .6, n.": {"positions": None, "directions": None, "allocation": np.ones((3, 2))},
    "either `positions` and `directions`, or": {"directions": None},
    "leave them out": {"allocation": np.ones((6, 1)), "directions": None},
    "must be one number or have shape .1,.": {"torque": [0.1, 0.2]},
    "must leave something": {"dead_band": 1.0, "limit": 1.0},
    "`lag` .* at least 0": {"lag": -0.1},
    "must be positive, but is .0.0": {"axis_weights": (0.0, 1, 1, 1, 1, 1)},
    "largest command, .lowest": {"limit": (1.0, 2.0)},
}


@pytest.mark.parametrize("sentence", WRONG)
def test_what_no_thrusters_can_have_is_told_in_one_sentence_with_their_name(sentence):
    given = {"curve": {"linear": 40.0}, **ONE, "limit": 1.0, **WRONG[sentence]}
    with pytest.raises(co.errors.ArgumentError, match=sentence) as told:
        Thrusters("bow_thrusters", **given)
    assert "bow_thrusters" in str(told.value)
