"""Rods and chains in motion: momentum, energy, resumed runs, driven ends, closed rings, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.run import xla
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.models import rods

SOFT: dict[str, Any] = {
    "length": 1.0,
    "EI": 1.0,
    "GJ": 0.8,
    "EA": 400.0,
    "GA": 200.0,
    "mass": 1.0,
    "inertia": (0.02, 0.01, 0.01),
}
PLANE: dict[str, Any] = {"length": 1.0, "EI": 1.0, "EA": 400.0, "GA": 200.0, "mass": 1.0, "inertia": 0.01}
SPINNING: dict[str, Any] = {"angular_velocity": (1.0, 2.0, 3.0), "velocity": (0.1, 0.2, 0.3)}


def drift(rod: co.System, records: Any) -> float:
    """The largest change of the total spatial momentum, relative."""

    def total(state):
        group: Any = rod.group
        return jnp.sum(group.view(group.Ad_dual(group.inverse(state.g), state.mu)), axis=0)

    seen = np.asarray(records.each(total))
    return float(np.max(np.abs(seen - seen[0])) / np.max(np.abs(seen)))


@pytest.mark.long
def test_a_free_rod_that_spins_keeps_its_momentum():
    rod = rods.cosserat(**SOFT, elements=2)
    run = co.trajectory(rod, rods.start(rod, curvature=(0.1, 0.3, 0.5), **SPINNING), dt=0.01, steps=200)
    assert drift(rod, run.records) < 2e-14


@pytest.mark.long
def test_a_long_rod_keeps_its_momentum_and_a_run_in_two_pieces_is_the_same_to_the_bit():
    rod, method = rods.cosserat(**SOFT, elements=20), co.Midpoint()
    begun = method.begin(rod, rods.start(rod, curvature=(0.1, 0.3, 0.5), **SPINNING), 0.002)
    program = StepProgram(replace_parameters(rod, None), method, version="rod")

    def run(state: co.State, steps: int) -> Any:
        return xla.run(program, Constants(rod.parameters, None), state, 0.002, steps, 1, False)

    whole = run(begun, 200)
    assert whole.code == 0
    assert drift(rod, whole.records) < 2e-14
    rest = run(run(begun, 80).final, 120)
    for ours, theirs in zip(*map(jax.tree.leaves, (whole.final, rest.final)), strict=True):
        assert np.array_equal(ours, theirs)


@pytest.mark.long
def test_a_ring_turns_and_breathes_and_stays_closed():
    ring = rods.planar(**PLANE, elements=6, ends="ring")
    start = rods.planar_start(ring, curvature=2 * np.pi, angular_velocity=2.0)
    run = co.trajectory(ring, start, dt=0.01, steps=200)
    assert drift(ring, run.records) < 2e-14
    x = rods.centerline(run.final)
    sides = np.linalg.norm(np.roll(x, -1, axis=0) - x, axis=1)
    assert np.ptp(sides) < 1e-10  # it keeps its symmetry
    away = np.linalg.norm(x - x.mean(axis=0), axis=1)
    assert np.mean(away) > np.linalg.norm(rods.centerline(start)[0] - rods.centerline(start).mean(axis=0))


@pytest.mark.long
def test_an_end_that_is_driven_slowly_takes_the_rod_along():
    def motion(t):
        return jnp.eye(2), jnp.stack([0.0 * t, 0.1 * (t - jnp.sin(t))])

    rod = rods.planar(**PLANE, elements=2, ends="clamped", motion=motion)
    run = co.trajectory(rod, rods.planar_start(rod), dt=0.01, steps=600)
    expected = 0.1 * (6 - np.sin(6.0))
    assert np.max(np.abs(rods.centerline(run.final)[:, 1] - expected)) < 0.02 * expected


@pytest.mark.long
def test_an_end_that_is_turned_slowly_turns_the_rod_about_where_it_began():
    """The clamp at g₀(A, y)(t), so sections near g₀(A, y)g₀⁻¹g_i(0)."""

    def motion(t):
        angle = 0.1 * (t - jnp.sin(t))
        c, s = jnp.cos(angle), jnp.sin(angle)
        return jnp.stack([jnp.stack([c, -s]), jnp.stack([s, c])]), jnp.stack([0.5 * angle, -0.3 * angle])

    rod = rods.planar(**{**PLANE, "EI": 20.0}, elements=2, ends="clamped", motion=motion)
    start = rods.planar_start(rod, position=(1.0, 2.0), angle=0.7, curvature=0.0)
    end = co.trajectory(rod, start, dt=0.01, steps=600).final
    (A, y), R = map(np.asarray, motion(6.0)), np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    along = (rods.centerline(start) - [1.0, 2.0]) @ R  # from the clamp, in its axes
    expected = np.array([1.0, 2.0]) + (along @ A.T + y) @ R.T
    assert np.max(np.abs(rods.centerline(end) - expected)) < 0.01 and np.max(np.abs(A - np.eye(2))) > 0.3


def test_a_rigid_motion_has_the_velocities_momenta_and_energy_of_its_sections():
    """ẋ_i = v + ω × (x_i − x̄), R_iω_i = ω; ½ Σ s_i(m|ẋ_i|² + ω·R_iJR_iᵀω), s = L/8, L/4, …, L/8 of four elements."""
    rod = rods.cosserat(**SOFT, elements=4)
    v, omega = np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 3.0])
    start = rods.start(rod, euler_zyx=(0.4, 0.3, 0.2), curvature=(0.5, 1.0, -0.7), velocity=v, angular_velocity=omega)
    R, x = map(np.asarray, start.g)
    xi = np.reshape(start.xi, (5, 6))
    moving = v + np.cross(omega, x - x.mean(axis=0))
    np.testing.assert_allclose(np.einsum("nij,nj->ni", R, xi[:, 3:]), moving, atol=1e-14)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", R, xi[:, :3]), np.tile(omega, (5, 1)), atol=1e-14)
    share, J = np.array([0.5, 1, 1, 1, 0.5]) / 4, np.array(SOFT["inertia"])
    turning = np.einsum("nij,i->nj", R, omega)
    kinetic = 0.5 * share @ (np.sum(moving**2, axis=1) + turning**2 @ J)
    assert 0.5 * start.mu @ start.xi == pytest.approx(kinetic, rel=1e-12)
    none = np.zeros(0)
    found = evaluate(lambda xi, a: rod.reduced_lagrangian(xi, none, none, a, 0.0), start.xi, start.a)
    bent = 0.5 * (0.8 * 0.5**2 + 1.0**2 + 0.7**2)  # ½(GJκ₁² + EI(κ₂² + κ₃²))
    assert float(found) == pytest.approx(kinetic - bent, rel=1e-12)
    np.testing.assert_allclose(np.reshape(start.mu, (5, 6))[:, :3], share[:, None] * J * turning, atol=1e-14)


@pytest.mark.long
def test_a_couple_at_the_end_turns_the_last_section_first():
    """From rest, μ_N = T t at first, in space and in the plane."""
    couple = np.array([0.1, -0.2, 0.3])
    rod = rods.cosserat(**SOFT, elements=2, ends="clamped", moment=couple)
    mu = np.reshape(co.trajectory(rod, rods.start(rod), dt=1e-5, steps=10).final.mu, (2, 6))
    np.testing.assert_allclose(mu[1, :3], 1e-4 * couple, rtol=1e-2)
    assert np.max(np.abs(mu[0])) < 1e-2 * np.max(np.abs(mu[1]))
    rod = rods.planar(**PLANE, elements=2, ends="clamped", moment=0.3)
    mu = np.reshape(co.trajectory(rod, rods.planar_start(rod), dt=1e-5, steps=10).final.mu, (2, 3))
    assert mu[1, 0] == pytest.approx(0.3e-4, rel=1e-2) and np.max(np.abs(mu[0])) < 1e-2 * mu[1, 0]


@pytest.mark.long
def test_the_energy_of_a_short_rod_stays_in_its_band():
    rod = rods.planar(**PLANE, elements=2)
    start = rods.planar_start(rod, curvature=0.5, angular_velocity=1.0)
    run = co.simulate(rod, start, dt=0.005, steps=100_000, save_every=1000, accuracy=False)
    energy = run.dataset.energy.values
    assert np.ptp(energy) < 5e-3 * abs(energy[0])
    assert abs(np.mean(energy[50:]) - np.mean(energy[:50])) < 1e-3 * abs(energy[0])  # a band, no drift


@pytest.mark.long
def test_chains_on_so3_keep_their_momentum_where_nothing_pulls():
    chain = rods.pendulums(links=2, length=0.5, mass=1.0, inertia=(0.01, 0.02, 0.02), gravity=0.0)
    turned = np.stack([np.eye(3), np.asarray(co.attitude.zyx(0.3, 0.2, 0.1))])
    start = rods.pendulums_start(chain, rotation=turned, angular_velocity=[[1.0, 2.0, 0.5], [0.3, -1.0, 0.4]])
    assert drift(chain, co.trajectory(chain, start, dt=0.01, steps=200).records) < 2e-13


@pytest.mark.long
def test_points_on_rods_and_thin_links_on_so3_move_alike():
    q, rates = np.array([[0.6, 0.0, -0.8], [0.0, 0.6, -0.8]]), np.array([[0.0, 1.0, 0.0], [0.5, 0.0, 0.0]])
    points = rods.points(links=2, length=0.5, mass=(1.0, 0.7))
    first = co.trajectory(points, rods.points_start(points, directions=q, rates=rates), dt=0.002, steps=250)
    links = rods.pendulums(links=2, length=0.5, mass=(1.0, 0.7), center=0.5, inertia=(0.1, 0.0, 0.0))
    side = np.cross(q, [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    R = np.stack([q, side, np.cross(q, side)], axis=2)
    omega = np.einsum("nij,ni->nj", R, np.cross(q, rates))
    start = rods.pendulums_start(links, rotation=R, angular_velocity=omega, down=(0.0, 0.0, -1.0))
    second = co.trajectory(links, start, dt=0.002, steps=250)
    found: Any = second.final.g
    assert np.max(np.abs(np.reshape(first.final.n, (2, 3)) - found[:, :, 0])) < 2e-5


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: rods.cosserat(**SOFT, elements=0), "of a rod with ends 'free' must be a whole number from 1"),
        (
            lambda: rods.cosserat(**SOFT, elements=2, ends="hinged"),
            '`ends` must be "free", "clamped", "both clamped" or',
        ),
        (lambda: rods.cosserat(**{**SOFT, "EI": -1.0}, elements=2), "Argument `EI` must be positive, but is -1."),
        (lambda: rods.cosserat(**{**SOFT, "inertia": 0.1}, elements=2), "`inertia` must have shape (3,)"),
        (lambda: rods.cosserat(**{**SOFT, "length": [1, 2, 3]}, elements=2), "`length` must have shape (2,)"),
        (lambda: rods.planar(**PLANE, elements=4, ends="ring", load=(1, 0)), "has no free end for a `load`"),
        (
            lambda: rods.planar(**PLANE, elements=4, motion=lambda t: t),
            "moves a clamped first end, but this rod has ends 'free'",
        ),
        (lambda: rods.planar(**PLANE, elements=4, rest_curvature=(1, 2)), "must be one number or have shape (4,)"),
        (lambda: rods.pendulums(links=0, length=1, mass=1, inertia=(1, 1, 1)), "`links` must be a whole number"),
        (lambda: rods.points(links=2, length=1, mass=0), "Argument `mass` must be positive, but is 0."),
        (lambda: rods.planar(**PLANE, elements=2).replace(EA=-1.0), "Argument `EA` must be positive"),
        (lambda: rods.start(co.System(co.SO3(), lambda xi: xi @ xi)), "must be a rod of co.models.rods"),
    ],
)
def test_what_no_rod_can_have_is_refused_in_a_sentence(make: Callable[[], Any], says: str):
    with pytest.raises(co.errors.ArgumentError) as caught:
        make()
    assert says in str(caught.value)
