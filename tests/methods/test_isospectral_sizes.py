"""Casimirs of small fields and small copies stay to round-off of their own size, beside large ones."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from systems import generator

SMALL = [1.0, 1e-6, 1e-12]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("size", SMALL)
@pytest.mark.parametrize("tolerance", [1e-14, 1e-8])
def test_what_is_carried_keeps_its_spectrum_whatever_its_size(size, tolerance):
    group, random = co.SOn(5), generator("small fields")
    w, u = random.uniform(0.5, 1.5, size=(2, group.dim))

    def hamiltonian(mu, a):
        return 0.5 * mu @ (w * mu) + 0.5 * a @ (u * a) + 0.3 * jnp.sin(a @ mu)

    system = co.System(group, hamiltonian=hamiltonian, advected=co.Coadjoint())
    mu, a = random.normal(size=(2, group.dim))
    start = system.state(mu=mu, a0=size * a)
    method = co.IsospectralMidpoint(tolerance=tolerance)
    run = co.simulate(system, start, dt=0.1, steps=300, save_every=300, method=method, accuracy=False)
    first, last = (np.sort(np.linalg.eigvals(evaluate(group.hat, run.records.a[k])).imag) for k in (0, -1))
    assert np.max(np.abs(last - first)) < 2e-14 * np.max(np.abs(first))


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("size", SMALL)
def test_a_weak_vortex_stays_on_its_sphere_beside_a_strong_one(size):
    from coadjoint.models import point_vortices

    system = point_vortices.sphere(circulations=[1.0, size, size], radius=1.0)
    places = generator("weak vortices").normal(size=(3, 3))
    places /= np.linalg.norm(places, axis=1)[:, None]
    start = point_vortices.sphere_start(system, positions=places)
    method = co.IsospectralMidpoint()
    run = co.simulate(system, start, dt=0.3, steps=500, save_every=500, method=method, accuracy=False)
    mu = run.records.mu.reshape(2, 3, 3)
    lengths = np.linalg.norm(mu, axis=2)
    assert np.max(np.abs(lengths[1] / lengths[0] - 1)) < 2e-14
