"""One vehicle in several forms: about another origin, with a 6×6 added mass, on SE(3), with z up."""

from __future__ import annotations

from functools import lru_cache

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint import models
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.continuous import energy, reference
from coadjoint.models import paper_form

SEED = 20260117
TIMES = np.array([1.0, 4.0, 10.0])
PAPER = {
    "mass": 123.8,
    "inertia": (5.46, 5.29, 5.72),
    "added_mass": (65.0, 70.0, 75.0, 0.0, 0.0, 0.0),
    "buoyancy": 1215.8,
    "center_of_buoyancy": (0.0, 0.0, -0.007),
}


def full(added_mass: np.ndarray) -> np.ndarray:
    """A symmetric, positive definite 6×6 with every entry occupied, near a given diagonal."""
    random = np.random.default_rng(SEED)
    A = random.normal(size=(6, 6))
    scale = np.sqrt(np.diag(added_mass))
    return added_mass + 0.1 * (A + A.T) * np.outer(scale, scale) / 2


OFFSET = np.array([0.11, -0.06, 0.04])
GENERAL = {
    **PAPER,
    "added_mass": full(np.diag([65.0, 70.0, 75.0, 2.0, 3.0, 4.0])),
    "center_of_mass": (0.02, 0.01, 0.03),
}
INITIAL = {"position": (0.3, -0.2, 1.0), "velocity": (0.3, 0.1, 0.5), "euler_zyx": (0.4, -0.3, 0.9)}
OMEGA = np.array([0.4, -0.2, 0.6])


def cross_matrix(r: np.ndarray) -> np.ndarray:
    return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


@lru_cache(maxsize=4)
def moves(form: str) -> tuple[co.System, co.State, co.State]:
    """The general vehicle in a form, its start, and its continuous motion at TIMES."""
    vehicle = models.general_vehicle(**GENERAL) if form == "SO(3)" else models.se3_vehicle(**GENERAL)
    begin = paper_form.start if form == "SO(3)" else models.se3_start
    start = begin(vehicle, **INITIAL, angular_velocity=OMEGA)
    return vehicle, start, reference(vehicle, start, TIMES)


@pytest.mark.long
def test_the_general_form_about_the_mass_centre_is_the_papers():
    special, general = models.paper_vehicle(), models.general_vehicle(**PAPER)
    random = np.random.default_rng(SEED)
    for _ in range(5):
        point = tuple(random.normal(size=(4, 3)))

        def value_and_slopes(system, *point):
            return jax.value_and_grad(system.reduced_lagrangian, argnums=(0, 1, 2, 3))(*point)

        found, expected = (evaluate(value_and_slopes, system, *point) for system in (general, special))
        for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
            assert np.max(np.abs(a - b)) <= 4e-13 * (1 + np.max(np.abs(b)))
    starts = [models.paper_start(vehicle) for vehicle in (special, general)]
    runs = [
        co.simulate(vehicle, start, dt=0.01, duration=5.0, method=co.LeftRectangle(start="velocity"), monitors=False)
        for vehicle, start in zip((special, general), starts, strict=True)
    ]
    for name in ("g", "q", "mu", "pi"):
        a, b = (np.asarray(getattr(run.final, name)) for run in runs)
        assert np.max(np.abs(a - b)) <= 1e-11 * (1 + np.max(np.abs(b))), name


@pytest.mark.long
def test_the_choice_of_the_body_origin_does_not_change_the_motion():
    """O′ = O + d: r_g and r_b shift by −d, and M_A′ = TᵀM_AT with [ν; ω] = T[ν′; ω], ν = ν′ − ω×d."""
    vehicle, start, motion = moves("SO(3)")
    T = np.eye(6)
    T[:3, 3:] = cross_matrix(OFFSET)
    shifted = models.general_vehicle(
        **{
            **GENERAL,
            "added_mass": T.T @ GENERAL["added_mass"] @ T,
            "center_of_mass": np.array(GENERAL["center_of_mass"]) - OFFSET,
            "center_of_buoyancy": np.array(GENERAL["center_of_buoyancy"]) - OFFSET,
        }
    )
    other = paper_form.start(
        shifted,
        **{**INITIAL, "position": start.q + start.g @ OFFSET},
        angular_velocity=OMEGA,
    )
    qdot = np.array(INITIAL["velocity"]) + start.g @ np.cross(OMEGA, OFFSET)
    other = shifted.state(g=start.g, q=other.q, xi=OMEGA, qdot=qdot, a0=[0, 0, 1])
    assert float(evaluate(energy, shifted, other)) == pytest.approx(float(evaluate(energy, vehicle, start)), rel=1e-13)
    moved = reference(shifted, other, TIMES)
    assert np.max(np.abs(moved.g - motion.g)) <= 1e-10
    assert np.max(np.abs(moved.q - moved.g @ OFFSET - motion.q)) <= 1e-9


@pytest.mark.long
def test_on_se3_the_continuous_motion_is_that_on_so3_times_r3():
    _, start, motion = moves("SO(3)")
    _, posed, poses = moves("SE(3)")
    assert np.max(np.abs(poses.g[0] - motion.g)) <= 1e-10
    assert np.max(np.abs(poses.g[1] - motion.q)) <= 1e-9
    depth = poses.a[:, 3]
    assert np.max(np.abs(depth - motion.q[:, 2])) <= 1e-9
    assert np.max(np.abs(posed.xi - np.concatenate([OMEGA, start.nu]))) <= 1e-14


@pytest.mark.long
@pytest.mark.parametrize(
    "method", [co.Midpoint(co.Cayley()), co.methods.LeftRight(co.Exponential())], ids=lambda m: m.title
)
def test_on_se3_steps_approach_that_motion_and_conserve_horizontal_momentum_and_the_vertical_moment(method):
    vehicle, start, poses = moves("SE(3)")
    errors = []
    for steps in (500, 1000):
        run = co.simulate(vehicle, start, dt=10.0 / steps, steps=steps, method=method, save_every=steps // 10)
        R, x = (np.abs(found[[1, 4, 10]] - exact) for found, exact in zip(run.records.g, poses.g, strict=True))
        errors.append(max(R.max(), x.max()))
        momentum = run.monitors["kelvin_noether"]
        assert momentum.shape == (11, 3)
        change = np.max(np.abs(run.extrema["kelvin_noether"] - momentum[0])) / np.linalg.norm(momentum[0])
        print(f"{method.title}, {steps} steps: error {errors[-1]:.2e}, momenta {change:.1e}")
        assert change <= 2e-13
        assert run.largest("group_defect") <= 1e-12
    assert abs(np.log2(errors[0] / errors[1]) - 2) <= 0.1
    # The three are the momentum along x and y and the moment about z, of m in the space frame.
    spatial = evaluate(lambda s: co.SE3().Ad_dual(co.SE3().inverse(s.g), s.mu), run.final)
    assert np.max(np.abs(spatial[[2, 3, 4]] - run.monitors["kelvin_noether"][-1])) <= 1e-10
    begun = evaluate(lambda s: co.SE3().Ad_dual(co.SE3().inverse(s.g), s.mu), start)
    assert abs(spatial[5] - begun[5]) > 1.0


def test_with_z_up_the_run_is_the_mirror_image_turned():
    """Half a turn about x takes axes that point down to axes that point up: q, R and ω follow, body vectors stay."""
    vehicle = models.paper_vehicle()
    turn = np.diag([1.0, -1.0, -1.0])
    R = co.attitude.zyx(0.4, -0.3, 0.9)
    q, qdot = np.array([0.3, -0.2, 1.0]), np.array([0.3, 0.1, 0.5])
    common = {"angular_velocity": OMEGA}
    below = paper_form.start(vehicle, position=q, velocity=qdot, rotation=R, **common)
    above = paper_form.start(
        vehicle, position=turn @ q, velocity=turn @ qdot, rotation=turn @ R, down=(0, 0, -1), **common
    )
    down, up = (co.simulate(vehicle, start, dt=0.05, duration=20.0, monitors=False) for start in (below, above))
    assert np.max(np.abs(up.records.q - down.records.q @ turn)) <= 1e-11
    assert np.max(np.abs(up.records.g - turn @ down.records.g)) <= 1e-12


def test_small_pitch_swings_with_the_period_of_the_righting_moment():
    """T = 2π√(J₂/(Bl)) for a neutrally buoyant vehicle; the amplitude θ lengthens it by 1 + θ²/16."""
    lever, angle = 0.007, 0.02
    vehicle = paper_form.vehicle(
        mass=123.8, added_mass=(65, 70, 75), inertia=(5.46, 5.29, 5.72), center_of_buoyancy=(0, 0, -lever)
    )
    start = paper_form.start(vehicle, euler_zyx=(0.0, angle, 0.0))
    run = co.simulate(vehicle, start, dt=0.01, duration=100.0, method=co.Suzuki4(co.Midpoint()))
    pitch, t = -np.arcsin(run.records.g[:, 2, 0]), run.records.t
    down = np.flatnonzero((pitch[:-1] > 0) & (pitch[1:] <= 0))
    crossings = t[down] + 0.01 * pitch[down] / (pitch[down] - pitch[down + 1])
    period = np.mean(np.diff(crossings))
    expected = 2 * np.pi * np.sqrt(5.29 / (123.8 * 9.81 * lever)) * (1 + angle**2 / 16)
    print(f"period {period:.9f} s, closed form {expected:.9f} s, {len(crossings)} crossings")
    assert len(crossings) > 5 and period == pytest.approx(expected, rel=1e-7)
