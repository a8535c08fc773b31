"""An ensemble takes the steps that its members take alone."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from vehicle import PAPER, VehicleProgram, start

from coadjoint.kernels.program import Code
from coadjoint.kernels.run import native
from coadjoint.kernels.run.ensemble import lanes, run_ensemble

H = 0.01
SEED = 11
COUNT = 2 * lanes() + 3


def fleet():
    """Vehicles of different mass with different starts, one parameter and all of the state with an axis."""
    print(f"seed {SEED}")
    random = np.random.default_rng(SEED)
    masses = PAPER.mass * random.uniform(0.9, 1.1, size=(COUNT, 1, 1))
    members = [PAPER._replace(mass=mass) for mass in masses]
    starts = [start(H, random.normal(size=3), p) for p in members]
    state = jax.tree.map(lambda *leaves: np.stack(leaves), *starts)
    axes = PAPER._replace(mass=True, inertia=False, net_weight=False, buoyancy=False, center=False), True
    return members, starts, PAPER._replace(mass=masses), state, axes


def member(tree, i):
    return jax.tree.map(lambda leaf: leaf[i], tree)


def assert_close(ours, theirs, tolerance=1e-12):
    for x, y in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True):
        np.testing.assert_allclose(x, y, rtol=tolerance, atol=tolerance * max(1.0, np.max(np.abs(y), initial=0.0)))


def test_members_take_the_steps_they_take_alone_in_every_digit():
    members, starts, p, s, axes = fleet()
    chunk = run_ensemble(VehicleProgram(), p, s, H, 4, 25, axes=axes)
    for i in range(COUNT):
        alone = native.run(VehicleProgram(), members[i], starts[i], H, 4, 25)
        assert_close(member((chunk.records, chunk.final), i), (alone.records, alone.final), 0.0)
        assert_close(member(chunk.monitors, i), alone.monitors, 1e-11)
        assert (chunk.steps[i], chunk.code[i], chunk.rows[i]) == (100, Code.CONVERGED, 4)
        assert (chunk.iterations[i], chunk.iterations_max[i]) == (alone.iterations, alone.iterations_max)
        assert_close(member(chunk.extrema["energy"], i), alone.extrema["energy"], 1e-11)
        assert chunk.extrema["spatial_momentum"][0].shape == (COUNT, 3)


def test_threads_do_not_change_a_bit():
    _, _, p, s, axes = fleet()
    one = run_ensemble(VehicleProgram(), p, s, H, 2, 10, axes=axes, threads=1)
    many = run_ensemble(VehicleProgram(), p, s, H, 2, 10, axes=axes, threads=4)
    assert_close((one.final, one.records), (many.final, many.records), 0.0)


def test_a_failed_member_stops_alone():
    members, starts, p, s, axes = fleet()
    bad = 3
    s.xi[bad] = starts[bad].xi * np.nan
    s.mu[bad + 1] *= 1e6
    chunk = run_ensemble(VehicleProgram(), p, s, H, 4, 25, axes=axes)
    assert Code(chunk.code[bad]) is Code.NOT_FINITE
    assert chunk.code[bad + 1] != Code.CONVERGED
    assert list(chunk.rows[[bad, bad + 1]]) == [0, 0]
    assert np.all(np.isnan(chunk.records.n[bad]))
    good = [i for i in range(COUNT) if i not in (bad, bad + 1)]
    assert np.all(chunk.code[good] == Code.CONVERGED)
    alone = native.run(VehicleProgram(), members[bad + 2], starts[bad + 2], H, 4, 25)
    assert_close(member(chunk.final, bad + 2), alone.final, 1e-11)
    assert_close(member(chunk.final, bad).g, starts[bad].g, 0.0)


def test_members_may_have_steps_of_their_own():
    steps = np.array([0.01, 0.005, 0.02])
    starts = [start(h) for h in steps]
    s = jax.tree.map(lambda *leaves: np.stack(leaves), *starts)
    chunk = run_ensemble(VehicleProgram(), PAPER, s, steps, 1, 10, axes=(False, True))
    np.testing.assert_allclose(chunk.final.t, 10 * steps)
    assert_close(member(chunk.final, 1), native.run(VehicleProgram(), PAPER, starts[1], 0.005, 1, 10).final)


def test_unequal_axes_are_refused():
    _, _, p, s, axes = fleet()
    with pytest.raises(ValueError, match="same members"):
        run_ensemble(VehicleProgram(), p, member(s, slice(0, 4)), H, 1, 1, axes=axes)
