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


def test_a_free_rod_that_spins_keeps_its_momentum():
    rod = rods.cosserat(**SOFT, elements=2)
    run = co.trajectory(rod, rods.start(rod, curvature=(0.1, 0.3, 0.5), **SPINNING), dt=0.01, steps=200)
    assert drift(rod, run.records) < 2e-14


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


def test_an_end_that_is_driven_slowly_takes_the_rod_along():
    def motion(t):
        return jnp.eye(2), jnp.stack([0.0 * t, 0.1 * (t - jnp.sin(t))])

    rod = rods.planar(**PLANE, elements=2, ends="clamped", motion=motion)
    run = co.trajectory(rod, rods.planar_start(rod), dt=0.01, steps=600)
    expected = 0.1 * (6 - np.sin(6.0))
    assert np.max(np.abs(rods.centerline(run.final)[:, 1] - expected)) < 0.02 * expected


def test_the_energy_of_a_short_rod_stays_in_its_band():
    rod = rods.planar(**PLANE, elements=2)
    start = rods.planar_start(rod, curvature=0.5, angular_velocity=1.0)
    run = co.simulate(rod, start, dt=0.005, steps=100_000, save_every=1000, accuracy=False)
    energy = run.dataset.energy.values
    assert np.ptp(energy) < 5e-3 * abs(energy[0])
    assert abs(np.mean(energy[50:]) - np.mean(energy[:50])) < 1e-3 * abs(energy[0])  # a band, no drift


def test_chains_on_so3_keep_their_momentum_where_nothing_pulls():
    chain = rods.pendulums(links=2, length=0.5, mass=1.0, inertia=(0.01, 0.02, 0.02), gravity=0.0)
    turned = np.stack([np.eye(3), np.asarray(co.attitude.zyx(0.3, 0.2, 0.1))])
    start = rods.pendulums_start(chain, rotation=turned, angular_velocity=[[1.0, 2.0, 0.5], [0.3, -1.0, 0.4]])
    assert drift(chain, co.trajectory(chain, start, dt=0.01, steps=200).records) < 2e-13


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
        (lambda: rods.cosserat(**SOFT, elements=0), "Argument `elements` must be a whole number from 1 of a rod"),
        (lambda: rods.cosserat(**SOFT, elements=2, ends="hinged"), "`ends` must be one of free, clamped, both clamped"),
        (lambda: rods.cosserat(**{**SOFT, "EI": -1.0}, elements=2), "Argument `EI` must be positive, but is -1."),
        (lambda: rods.cosserat(**{**SOFT, "inertia": 0.1}, elements=2), "`inertia` must have shape (3,)"),
        (lambda: rods.cosserat(**{**SOFT, "length": [1, 2, 3]}, elements=2), "`length` must have shape (2,)"),
        (lambda: rods.planar(**PLANE, elements=4, ends="ring", load=(1, 0)), "has no free end for a `load`"),
        (lambda: rods.planar(**PLANE, elements=4, motion=lambda t: t), "of a rod whose first end is clamped"),
        (lambda: rods.planar(**PLANE, elements=4, rest_curvature=(1, 2)), "must have shape () or (4,)"),
        (lambda: rods.pendulums(links=0, length=1, mass=1, inertia=(1, 1, 1)), "`links` must be a whole number"),
        (lambda: rods.points(links=2, length=1, mass=0), "Argument `mass` must be positive, but is 0."),
        (lambda: rods.planar(**PLANE, elements=2).replace(EA=-1.0), "Argument `EA` must be positive"),
        (lambda: rods.start(co.System(co.SO3(), lambda xi: xi @ xi)), "must be a rod of co.models.rods"),
    ],
)
def test_what_no_rod_can_have_is_refused_in_a_sentence(make: Callable[[], Any], says: str):
    with pytest.raises(co.ArgumentError) as caught:
        make()
    assert says in str(caught.value)
