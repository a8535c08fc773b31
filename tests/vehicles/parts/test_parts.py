"""Parts of vehicles: forces against closed forms, and the symmetries that they must have."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.named import Named
from coadjoint_vehicles import Flow, Part
from coadjoint_vehicles.parts import Airfoil, Damping, Derivatives, Fin, Hull, Propeller
from coadjoint_vehicles.parts.fin import lift_and_drag

RHO = 1026.0


def pushed(part: Part, v: Any, omega: Any = (0.0, 0.0, 0.0), actual: Any = None) -> np.ndarray:
    """(F, T) of a part in a flow."""

    def force(v, omega, actual, own):
        down = jnp.array([0.0, 0.0, 1.0])
        found = part.force(Flow(v, omega, jnp.asarray(RHO), down, jnp.zeros(()), jnp.zeros(())), actual, own)
        return jnp.concatenate([found.force, found.torque])

    values = [np.asarray(x, dtype=float) for x in (v, omega)]
    own = co.Parameters(**part.parameters())
    return evaluate(force, *values, None if actual is None else np.asarray(actual, dtype=float), own)


def test_damping_is_linear_fading_quadratic_and_with_forward_speed():
    random = np.random.default_rng(1)
    D, E, C = random.normal(size=(3, 6, 6))
    sigma, V = random.uniform(0, 2, 6), random.normal(size=6)
    part = Damping("damping", linear=D, quadratic=E, forward=C, fading=sigma)
    speed = np.linalg.norm(V[:3])
    expected = -np.exp(-sigma * speed) * (D @ V) - E @ (np.abs(V) * V) - abs(V[0]) * C @ V
    np.testing.assert_allclose(pushed(part, V[:3], V[3:]), expected, rtol=1e-13)
    diagonal = Damping("damping", quadratic=np.diag(E))
    np.testing.assert_allclose(pushed(diagonal, V[:3], V[3:]), -np.diag(E) * np.abs(V) * V, rtol=1e-13)


def test_hull_strips_have_the_drag_of_pure_sway_heave_and_turning():
    hull = Hull("hull", axial_drag=0.3, axial_area=0.2, crossflow_drag=(0.5, 0.6), width=0.4, height=0.3, length=2.0)
    np.testing.assert_allclose(pushed(hull, [-0.5, 0, 0])[0], 0.5 * RHO * 0.3 * 0.2 * 0.25, rtol=1e-14)
    assert pushed(hull, [0, 0.4, 0])[1] == pytest.approx(-0.5 * RHO * 0.5 * 0.3 * 2.0 * 0.16, rel=1e-14)
    assert pushed(hull, [0, 0, 0.4])[2] == pytest.approx(-0.5 * RHO * 0.6 * 0.4 * 2.0 * 0.16, rel=1e-14)
    # ∫ |x|³ dx over −L/2 … L/2 = L⁴/32.
    turning = pushed(hull, [0, 0, 0], [0, 0.3, 0]), pushed(hull, [0, 0, 0], [0, 0, 0.3])
    assert turning[0][4] == pytest.approx(-0.5 * RHO * 0.6 * 0.4 * 2.0**4 / 32 * 0.09, rel=1e-14)
    assert turning[1][5] == pytest.approx(-0.5 * RHO * 0.5 * 0.3 * 2.0**4 / 32 * 0.09, rel=1e-14)
    # Turning about a pivot at x = p, inside: ∫|x−p|(x−p) dx and ∫|x−p|(x−p)x dx over −1 … 1.
    for p in (0.0, 0.37, -0.8):
        force = pushed(hull, [0, -0.3 * p, 0], [0, 0, 0.3])
        sway = ((1 - p) ** 3 - (1 + p) ** 3) / 3
        yaw = ((1 - p) ** 4 + (1 + p) ** 4) / 4 + p * sway
        rest = -0.5 * RHO * 0.5 * 0.3 * 0.09 * np.array([sway, yaw])
        np.testing.assert_allclose(force[[1, 5]], rest, rtol=1e-13, atol=1e-12)
    # A hull whose middle is ahead of O turns away from the flow that pushes it sideways: N = x_c Y.
    ahead = Hull("hull", **{**hull.parameters(), "center": 0.7})
    force = pushed(ahead, [0, 0.4, 0])
    assert force[5] == pytest.approx(0.7 * force[1], rel=1e-13)


def fin(normal: Any, position: Any = (-0.8, 0.0, 0.0), **more: Any) -> Fin:
    numbers = {"area": 0.01, "lift_slope": 3.12, "stall": np.radians(20), "limit": 0.3}
    return Fin("fin", position=position, normal=normal, **{**numbers, **more})


def test_a_fin_pushes_against_its_normal_by_its_lift_and_turns_the_craft_by_its_arm():
    delta, u = 0.05, 1.5
    lift = 3.12 * np.sin(delta) * np.cos(delta)
    drag = 0.02 + lift**2 * (2 * np.pi - 3.12) / (2 * np.pi * 3.12)
    half = 0.5 * RHO * 0.01 * u**2
    place = np.array([-0.8, 0.1, -0.2])
    found = pushed(fin((0, 1, 0), place, drag=0.02, stall=1.2), [u, 0, 0], actual=delta)
    expected = half * np.array([-drag, -lift, 0.0])
    np.testing.assert_allclose(found[:3], expected, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(found[3:], np.cross(place, found[:3]), rtol=1e-12, atol=1e-13)


def test_an_airfoil_has_the_lines_of_its_lift_and_drag_also_from_behind():
    """½ρA|w|²(C_L across, C_D along) with C_L = ±(0.8 − 1.1·0.1) and C_D = 0.05 + 0.03·0.1 + 0.5α² past stall."""
    numbers = {"area": 0.02, "lift_slope": 4.0, "stall": 0.2, "drag_slope": 0.25, "drag_square": 0.5}
    numbers |= {"stalled_lift_slope": -1.1, "stalled_drag_slope": 0.03}
    foil = Airfoil("foil", position=(0, 0, 0), chord=(1, 0, 0), normal=(0, 1, 0), **numbers)
    half = 0.5 * RHO * 0.02 * 2.25
    for alpha in (0.1, 0.3, -0.3):
        size = abs(alpha)
        lift = np.sign(alpha) * (4.0 * size if size < 0.2 else 0.8 - 1.1 * 0.1)
        drag = (0.25 * size if size < 0.2 else 0.05 + 0.03 * 0.1) + 0.5 * alpha**2
        sine, cosine = np.sin(alpha), np.cos(alpha)
        expected = half * np.array([lift * sine - drag * cosine, -lift * cosine - drag * sine, 0.0])
        found = pushed(foil, 1.5 * np.array([cosine, sine, 0.0]))[:3]
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(pushed(foil, -1.5 * np.array([cosine, sine, 0.0]))[:3], -expected, atol=1e-12)
    one_way = Airfoil("foil", position=(0, 0, 0), chord=(1, 0, 0), normal=(0, 1, 0), **numbers, reversible=0.0)
    assert not np.any(pushed(one_way, [-1.5, 0.2, 0]))
    swept = Airfoil("foil", position=(0, 0, 0), chord=(1, 0, 0), normal=(0, 1, 0), **numbers, swept=1.0)
    flow = [1.5 * np.cos(0.1), 1.5 * np.sin(0.1), 1.5]
    np.testing.assert_allclose(pushed(swept, flow), 0.5 * pushed(foil, flow), rtol=1e-12)


def test_a_fin_lifts_by_its_slope_stalls_and_is_a_plate_across_the_flow():
    def at(angle, drag=0.0):
        return evaluate(lift_and_drag, np.cos(angle), np.sin(angle), 3.12, np.radians(20), drag)

    lift, drag = at(1e-3)
    assert lift == pytest.approx(3.12e-3, rel=2e-3) and drag == pytest.approx(0.0, abs=1e-5)
    assert at(0.0, 0.02)[1] == pytest.approx(0.02, rel=1e-4)
    assert at(np.radians(16))[0] > at(np.radians(21))[0]
    np.testing.assert_allclose(at(np.pi / 2, 0.02), [0, 2], atol=1e-9)
    np.testing.assert_allclose(at(-0.2), np.array(at(0.2)) * [-1, 1], rtol=1e-12)


SHELDAHL_KLIMAS = {
    30: (0.855, 0.57),
    35: (0.98, 0.745),
    40: (1.035, 0.92),
    45: (1.05, 1.075),
    50: (1.02, 1.215),
    60: (0.875, 1.47),
    70: (0.63, 1.665),
    80: (0.365, 1.78),
    90: (0.09, 1.80),
    135: (-0.93, 1.085),
    150: (-0.77, 0.575),
}
"""(C_L, C_D) of NACA 0015 at Re = 3.6e5 by degrees, SAND80-2114, as in SNL-WaterPower/CACTUS at 4ae4faf."""


def test_beyond_stall_a_fin_has_the_lift_and_drag_of_published_sections():
    for degrees, (lift, drag) in SHELDAHL_KLIMAS.items():
        angle = np.radians(degrees)
        found = evaluate(lift_and_drag, np.cos(angle), np.sin(angle), 3.12, np.radians(20), 0.0)
        assert found[0] == pytest.approx(lift, abs=0.1), degrees
        assert found[1] == pytest.approx(drag, abs=0.2), degrees


@pytest.mark.parametrize(("slope", "stall"), [(3.12, 20.0), (4.13, 9.7), (6.0, 15.0), (2.0, 30.0), (np.pi, 8.0)])
@pytest.mark.parametrize("least", [0.0, 0.02, 0.1])
def test_the_drag_of_a_fin_grows_through_stall(slope, stall, least):
    angles = np.radians(np.linspace(0.0, 90.0, 361))
    drag = jax.vmap(lambda c, n: lift_and_drag(c, n, slope, np.radians(stall), least)[1])
    assert np.all(np.diff(evaluate(drag, np.cos(angles), np.sin(angles))) > 0)


def test_a_fin_and_its_flow_that_are_rolled_together_feel_the_force_rolled():
    random = np.random.default_rng(2)
    for _ in range(4):
        R = co.attitude.zyx(0.0, 0.0, random.uniform(-3, 3))
        r, v, omega = random.normal(size=(3, 3))
        n = np.append(0.0, random.normal(size=2))
        n /= np.linalg.norm(n)
        force = pushed(fin(n, r), v, omega, 0.1)
        rolled = pushed(fin(R @ n, R @ r), R @ v, R @ omega, 0.1)
        np.testing.assert_allclose(rolled, np.concatenate([R @ force[:3], R @ force[3:]]), rtol=1e-11, atol=1e-12)


def test_an_x_tail_with_its_fins_together_steers_as_a_rudder_with_the_root_of_two_times_the_lift():
    diagonal = np.sqrt(0.5)
    v = [1.5, 0, 0]
    tail = sum(pushed(fin((0, diagonal, side * diagonal)), v, actual=0.1) for side in (1, -1))
    rudder = pushed(fin((0, 1, 0)), v, actual=0.1)
    np.testing.assert_allclose(tail[[1, 5]], np.sqrt(2) * rudder[[1, 5]], rtol=1e-13)
    np.testing.assert_allclose(tail[[2, 3, 4]], 0, atol=1e-13)
    assert tail[0] == pytest.approx(2 * rudder[0], rel=1e-13)


def test_a_propeller_off_the_axis_turns_the_craft_and_one_across_it_pushes_sideways():
    numbers = {"diameter": 0.1, "thrust": (0.4, -0.3), "torque": (0.05, -0.03), "thrust_deduction": 0.1}
    numbers = {**numbers, "wake_fraction": 0.2, "torque_fraction": 0.5, "limit": 30.0}
    v, omega, n = np.array([1.2, 0.3, 0.0]), np.array([0.0, 0.0, 0.4]), 20.0
    found = pushed(Propeller("propeller", position=(0.5, 0.2, 0), axis=(1, 0, 0), **numbers), v, omega, n)
    ahead = 0.8 * (1.2 - 0.4 * 0.2)
    thrust = 0.9 * RHO * 1e-4 * n * (0.4 * n - 0.3 * ahead / 0.1)
    torque = 0.5 * RHO * 1e-5 * n * (0.05 * n - 0.03 * ahead / 0.1)
    np.testing.assert_allclose(found, [thrust, 0, 0, torque, 0, -0.2 * thrust], rtol=1e-12, atol=1e-12)
    across = pushed(Propeller("propeller", position=(0.5, 0, 0), axis=(0, 1, 0), **numbers), [0, 0, 0], actual=-n)
    bollard = -0.9 * RHO * 1e-4 * 0.4 * n * n
    np.testing.assert_allclose(across[[1, 5]], [bollard, 0.5 * bollard], rtol=1e-12)


def test_derivatives_are_sums_of_monomials_with_signs_as_written():
    V, delta = np.array([1.1, -0.3, 0.2, 0.4, -0.5, 0.6]), 0.1
    u, v, w, p, q, r = V
    given = {"Y_vr": 1.0, "Y_v|v|": -2.0, "Z_|u|w": 3.0, "M_q": -4.0, "X_u|u|": -5.0, "K_p|p|": -0.5, "N_vvr": 0.7}
    found = pushed(Derivatives("derivatives", coefficients=given), V[:3], V[3:])
    expected = [-5 * u * abs(u), v * r - 2 * v * abs(v), 3 * abs(u) * w, -0.5 * p * abs(p), -4 * q, 0.7 * v * v * r]
    np.testing.assert_allclose(found, expected, rtol=1e-13)
    given = {"N_uu_rudder": -6.0, "X_uu_rudder_rudder": -7.0, "Y_uv": -1.0}
    rudder = Derivatives("rudder", coefficients=given, limit=0.3)
    expected = [-7 * u * u * delta**2, -u * v, 0, 0, 0, -6 * u * u * delta]
    np.testing.assert_allclose(pushed(rudder, V[:3], V[3:], delta), expected, rtol=1e-13)


def test_dimensionless_derivatives_scale_with_half_the_density_and_their_power_of_the_length():
    L, u, v, p, q, r = 5.3, 1.5, 0.2, 0.1, -0.2, 0.3
    given = {"Y_uv": -0.1, "Y_ur": 0.03, "Y_pq": 0.004, "N_uv": -0.0074, "N_ur": -0.016, "N_pq": -0.021}
    found = pushed(Derivatives("derivatives", coefficients=given, length=L), [u, v, 0], [p, q, r])
    sway = 0.5 * RHO * L**2 * (-0.1 * u * v + L * 0.03 * u * r + L**2 * 0.004 * p * q)
    yaw = 0.5 * RHO * L**3 * (-0.0074 * u * v - L * 0.016 * u * r - L**2 * 0.021 * p * q)
    np.testing.assert_allclose(found[[1, 5]], [sway, yaw], rtol=1e-13)


def drags() -> list[Part]:
    random = np.random.default_rng(3)
    A = random.normal(size=(6, 6))
    normals = [np.append(0.0, [np.cos(a), np.sin(a)]) for a in random.uniform(0, 6, 3)]
    hull = {"axial_drag": 0.3, "axial_area": 0.2, "crossflow_drag": (0.5, 0.9), "width": 0.4, "height": 0.3}
    return [
        Damping("linear", linear=A @ A.T, fading=0.7 * np.ones(6)),
        Damping("quadratic", quadratic=random.uniform(0, 1, 6), forward=random.uniform(0, 1, 6)),
        Hull("hull", **hull, length=2.0, center=0.3),
        *(fin(n, random.normal(size=3), drag=0.01) for n in normals),
        fin((0.3, np.sqrt(1 - 0.09), 0.0)),
        Derivatives("derivatives", coefficients={"Y_v|v|": -1.0, "N_r|r|": -2.0, "Z_w|v|": -0.3}),
    ]


@pytest.mark.parametrize("part", drags(), ids=lambda part: type(part).__name__)
def test_parts_that_brake_never_put_energy_in(part):
    random = np.random.default_rng(4)
    V, angles = 2 * random.normal(size=(300, 6)), random.uniform(-0.5, 0.5, 300)
    own = co.Parameters(**part.parameters())

    def power(V, angle):
        flow = Flow(V[:3], V[3:], jnp.asarray(RHO), V[:3], jnp.zeros(()), jnp.zeros(()))
        found = part.force(flow, None if part.command is None else angle, own)
        return found.force @ V[:3] + found.torque @ V[3:]

    powers = evaluate(jax.vmap(power), V, angles)
    assert np.all(powers <= 0) and np.min(powers) < -1e-3


def test_every_part_is_at_rest_without_force_and_its_force_has_a_finite_slope_there():
    numbers = {"diameter": 0.1, "thrust": (0.4, -0.3), "torque": (0.05, -0.03), "thrust_deduction": 0.1}
    propeller = Propeller("propeller", **numbers, wake_fraction=0.2, torque_fraction=0.5, limit=30.0)
    for part in (*drags(), propeller):
        own = co.Parameters(**part.parameters())

        def force(V, part=part, own=own):
            flow = Flow(V[:3], V[3:], jnp.asarray(RHO), V[:3], jnp.zeros(()), jnp.zeros(()))
            found = part.force(flow, None if part.command is None else jnp.zeros(()), own)
            return jnp.concatenate([found.force, found.torque])

        assert np.all(evaluate(force, np.zeros(6)) == 0)
        assert np.all(np.isfinite(evaluate(jax.jacfwd(force), np.zeros(6))))


def followed(part: Part, command: float, h: float, steps: int) -> list[float]:
    own, actual, found = co.Parameters(**part.parameters()), np.float64(0.0), [0.0]
    for _ in range(steps):
        actual = evaluate(part.advance, actual, np.float64(command), np.float64(h), own).end
        found.append(float(actual))
    return found


def test_an_actuator_saturates_lags_and_never_moves_faster_than_its_rate():
    t = 0.05 * np.arange(41)
    lagging = followed(fin((0, 1, 0), lag=0.1), 1.0, 0.05, 40)
    np.testing.assert_allclose(lagging, 0.3 * (1 - np.exp(-t / 0.1)), atol=1e-13)
    limited = followed(fin((0, 1, 0), rate=0.2), -1.0, 0.05, 40)
    np.testing.assert_allclose(limited, -np.minimum(0.2 * t, 0.3), atol=1e-13)
    both = np.diff(followed(fin((0, 1, 0), lag=0.1, rate=0.5), 1.0, 0.05, 40))
    np.testing.assert_allclose(both[:6], 0.5 * 0.05, rtol=1e-12)
    assert 0 < both[-1] < both[20] < both[10] < 0.5 * 0.05


@pytest.mark.cases(2)
@pytest.mark.parametrize("lag", [None, 0.1])
@pytest.mark.parametrize("rate", [None, 0.2, 5.0])
@pytest.mark.parametrize("x", [-0.25, 0.29, 0.3])
def test_over_a_step_an_actuator_is_what_many_short_steps_make_of_it(lag, rate, x):
    """ẋ = clip((u − x)/τ, ±rate) by the midpoint rule: where it ends, and its mean over the step."""
    part, h, steps = fin((0, 1, 0), lag=lag, rate=rate), 0.7, 20_000
    own = co.Parameters(**part.parameters())
    found = evaluate(part.advance, np.float64(x), np.float64(1.0), np.float64(h), own)
    most = np.inf if rate is None else rate
    path = [0.3 if lag is None and rate is None else x]
    for _ in range(steps):
        gap = 0.3 - path[-1]
        speed = np.clip(gap / lag, -most, most) if lag else most * np.sign(gap) if rate else 0.0
        late = np.clip((gap - 0.5 * speed * h / steps) / lag, -most, most) if lag else speed
        path.append(path[-1] + np.clip(late * h / steps, -abs(gap), abs(gap)))
    assert float(found.begin) == path[0]
    assert float(found.end) == pytest.approx(path[-1], abs=1e-7)
    assert float(found.mean) == pytest.approx(np.mean(0.5 * (np.array(path[1:]) + path[:-1])), abs=1e-7)


@pytest.mark.long
def test_an_actuator_that_is_at_its_command_answers_a_small_change_of_it():
    part = fin((0, 1, 0), lag=0.1, rate=5.0)
    own = co.Parameters(**part.parameters())
    with co.float64():
        slope = jax.grad(lambda u: part.advance(jnp.zeros(()), u, jnp.asarray(0.05), own).end)(0.0)
    assert float(slope) == pytest.approx(1 - np.exp(-0.5), rel=1e-12)


def test_a_fin_may_be_made_inside_of_a_derivative():
    def pushed(area: Any) -> Any:
        part = fin((0, 1, 0), area=area)
        flow = Flow(*np.array([[1.5, 0.1, 0.0], [0, 0, 0]]), np.float64(RHO), jnp.ones(3), jnp.zeros(()), jnp.zeros(()))
        return part.force(flow, jnp.zeros(()), Named(**part.parameters())).force[1]

    value, slope = evaluate(jax.value_and_grad(pushed), 0.02)
    assert float(value) < 0 and float(slope) == pytest.approx(float(value) / 0.02, rel=1e-13)


def wrong(**coefficients: float):
    return lambda: Derivatives("rudder", coefficients=coefficients)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Damping("damping", linear=np.eye(3)), r"`linear` .*shape \(6, 6\) or \(6,\), but has shape \(3, 3\)"),
        (lambda: Damping("my damping"), "must be a word such as 'rudder', but is 'my damping'"),
        (lambda: fin((0, 1, 1)), "unit vector, but has length 1.41421"),
        (lambda: fin((1, 0, 0)), "must not point along the hull"),
        (lambda: fin((0, 1, 0), lift_slope=7.0), "below 2π per rad"),
        (lambda: fin((0, 1, 0), lag=-0.1), "`lag` of the fin `fin` must be at least 0"),
        (lambda: fin((0, 1, 0), area=-1.0), "`area` of the fin `fin` must be at least 0"),
        (wrong(N_uu_rudder=1.0), "needs a deflection: give the derivatives `rudder` a `limit`"),
        (wrong(Y_vx=1.0), "'Y_vx' .* must be an axis X Y Z K M N, an underscore and factors"),
        (wrong(Q_vv=1.0), "'Q_vv'"),
        (wrong(Y_vdot=1.0), "'Y_vdot'"),
        (lambda: Derivatives("hull", coefficients={"Y_v": 1.0}, length=2.0), "must have two velocities, but has 1"),
        (lambda: Derivatives("hull", coefficients={}), "must be a dictionary"),
    ],
)
def test_what_no_part_can_have_is_said(make, sentence):
    with pytest.raises(co.errors.ArgumentError, match=sentence):
        make()
