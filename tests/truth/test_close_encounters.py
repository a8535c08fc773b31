"""Close encounters in their own time: Kepler's orbits by σ(ℋ − E), σ = |q|, with the time as a further variable."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co


def in_own_time(mu, n, pi):
    distance = jnp.sqrt(n.q @ n.q)
    return distance * (0.5 * pi.q @ pi.q - 1 / distance + pi.time[0])


ORBIT = co.System(
    co.Translation(0), hamiltonian=in_own_time, additional={"q": co.Trivial(2), "time": co.Trivial(1)}, name="Kepler"
)
SIXTH = co.methods.KahanLi6(co.HamiltonianMidpoint())


def start(eccentricity):
    """At the apocentre of an orbit of energy −1/2 and period 2π."""
    speed = np.sqrt((1 - eccentricity) / (1 + eccentricity))
    return ORBIT.state(q={"q": [1 + eccentricity, 0.0], "time": [0.0]}, pi=[0.0, speed, 0.5])


CASES = [(0.99, SIXTH, 1000)]
LONG = [(0.99, co.Suzuki4(co.HamiltonianMidpoint()), 4000), (0.996, SIXTH, 4000)]
LONG_CASES = [pytest.param(*case, marks=pytest.mark.long) for case in LONG]


@pytest.mark.parametrize(("eccentricity", "method", "steps"), [*CASES, *LONG_CASES])
def test_an_orbit_closes_after_its_period_with_its_energy(eccentricity, method, steps):
    begun = start(eccentricity)
    run = co.simulate(ORBIT, begun, dt=2 * np.pi / steps, steps=steps, method=method)
    q, p = run.records.n[:, :2], run.records.pi[:, :2]
    distance = np.linalg.norm(q, axis=1)
    assert np.min(distance) == pytest.approx(1 - eccentricity, rel=1e-6)
    assert np.max(np.abs((0.5 * np.sum(p**2, axis=1) - 1 / distance) / -0.5 - 1)) < 1e-6
    np.testing.assert_allclose(run.final.n, [1 + eccentricity, 0.0, 2 * np.pi], rtol=0, atol=1e-6)


@pytest.mark.long
def test_the_motion_backwards_is_that_with_reversed_momenta():
    begun, steps = start(0.99), 500
    there = co.simulate(ORBIT, begun, dt=2 * np.pi / 1000, steps=steps, method=SIXTH).final
    turned = ORBIT.state(q={"q": there.n[:2], "time": [-there.n[2]]}, pi=[*-there.pi[:2], there.pi[2]])
    back = co.simulate(ORBIT, turned, dt=2 * np.pi / 1000, steps=steps, method=SIXTH).final
    np.testing.assert_allclose(back.n, [*begun.n[:2], 0.0], rtol=0, atol=1e-10)
