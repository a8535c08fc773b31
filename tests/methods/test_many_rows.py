"""More coupled rows of constraints than elimination with selections takes, in native code, and redundant ones."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from mechanisms import bricard, four_bar

COUNT, DT = 13, 0.01
DOWN = np.tile([0.0, -9.81], COUNT)
QUIET = {"accuracy": False, "backend": "native"}


def string():
    """Points of 1 kg in the plane on rods of 1 m, one after the other; the first rod is held twice."""

    def rods(n):
        ends = jnp.diff(jnp.concatenate([jnp.zeros((1, 2)), n.reshape(COUNT, 2)]), axis=0)
        return 0.5 * (jnp.sum(ends**2, axis=1) - 1)

    held = {"rods": co.Holonomic(rods), "again": co.Holonomic(lambda n: n[0] ** 2 + n[1] ** 2 - 1)}
    return co.System(
        co.SO2(),
        lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu + DOWN @ n,
        additional=co.Trivial(2 * COUNT),
        constraints=held,
        verify=False,
    )


def rows(x):
    """φ (m,) of the rods and ∂φ (m, 2m)."""
    ends = np.diff(np.concatenate([[0, 0], x]).reshape(-1, 2), axis=0)
    slopes = np.zeros((COUNT, COUNT + 1, 2))
    slopes[range(COUNT), range(1, COUNT + 1)], slopes[range(COUNT), range(COUNT)] = ends, -ends
    return 0.5 * (np.sum(ends**2, axis=1) - 1), slopes[:, 1:].reshape(COUNT, -1)


def rattled(x, p):
    """A step of RATTLE by dense matrices."""
    A, strength, v = rows(x)[1], np.zeros(COUNT), p
    for _ in range(20):
        v = p + 0.5 * DT * (DOWN + A.T @ strength)
        gap, slopes = rows(x + DT * v)
        strength -= np.linalg.solve(0.5 * DT**2 * slopes @ A.T, gap)
    x = x + DT * v
    A, free = rows(x)[1], v + 0.5 * DT * DOWN
    return x, free - A.T @ np.linalg.solve(A @ A.T, A @ free)


def hung(system):
    """At rest, along an arc."""
    angles = 0.3 * np.arange(COUNT)
    return system.state(q=np.cumsum(np.stack([np.cos(angles), np.sin(angles)], axis=1), axis=0).ravel())


@pytest.mark.long
def test_a_string_of_rods_one_of_them_redundant_moves_in_native_code_as_by_dense_matrices():
    system = string()
    start = hung(system)
    run = co.simulate(system, start, dt=DT, steps=3, **QUIET, monitors=False)
    x, p = start.n, start.pi
    for k in range(4):
        assert np.abs(run.records.n[k] - x).max() < 1e-13 and np.abs(run.records.pi[k] - p).max() < 1e-12
        assert np.abs(rows(run.records.n[k])[0]).max() < 1e-14
        x, p = rattled(x, p)


@pytest.mark.long
def test_redundant_rods_share_the_least_reaction():
    system = string()
    start = hung(system)
    data = co.simulate(system, start, dt=DT, steps=3, **QUIET).dataset
    A = rows(start.n)[1]
    strength = np.linalg.solve(A @ A.T, -A @ DOWN)
    assert data.reaction_rods.values[0, 1:] == pytest.approx(strength[1:], rel=1e-9)
    assert data.reaction_rods.values[0, 0] == pytest.approx(strength[0] / 5, rel=1e-9)
    for name in ("reaction", "reaction_step"):  # of λ and μ with λ + 2μ given the least are 1 : 2
        one, other = (data[f"{name}_{key}"].values[:3, 0] for key in ("rods", "again"))
        assert other == pytest.approx(2 * one, rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("made", [four_bar, bricard], ids=lambda made: made.__name__)
def test_linkages_move_in_native_code_as_by_xla(made):
    linkage = made()
    start = linkage.state(coordinates={"A": 0.4}, speeds={"A": 9.0}) if made is four_bar else linkage.state()
    runs = [co.simulate(linkage.system, start, dt=0.005, steps=40, **QUIET | {"backend": b}) for b in ("native", "xla")]
    for name in ("g", "n", "mu", "pi"):
        one, other = (getattr(run.final, name) for run in runs)
        assert np.abs(one - other).max() < 1e-12 * max(1, np.abs(one).max())
    assert all(run.extrema["constraint_gap"][1] < 1e-14 for run in runs)
