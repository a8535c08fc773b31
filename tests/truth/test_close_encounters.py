"""Close encounters in their own time: Kepler's orbits and two bodies by σ(ℋ − E), σ = |q|."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, LagrangianError


def energy(mu, n, pi):
    return 0.5 * pi @ pi - 1 / jnp.sqrt(n @ n)


def distance(mu, n, pi):
    return jnp.sqrt(n @ n)


KEPLER = co.System(co.Translation(0), hamiltonian=energy, additional=co.Trivial(2), name="Kepler")
SIXTH = co.methods.KahanLi6(co.HamiltonianMidpoint())


def start(eccentricity):
    """At the apocentre of an orbit of energy −1/2 and period 2π, in its own time."""
    speed = np.sqrt((1 - eccentricity) / (1 + eccentricity))
    far = KEPLER.state(q=[1 + eccentricity, 0.0], pi=[0.0, speed])
    return co.mechanics.in_own_time(KEPLER, far, distance)


CASES = [(0.99, SIXTH, 1000)]
LONG = [(0.99, co.Suzuki4(co.HamiltonianMidpoint()), 4000), (0.996, SIXTH, 4000)]
LONG_CASES = [pytest.param(*case, marks=pytest.mark.long) for case in LONG]


@pytest.mark.parametrize(("eccentricity", "method", "steps"), [*CASES, *LONG_CASES])
def test_an_orbit_closes_after_its_period_with_its_energy(eccentricity, method, steps):
    orbit, begun = start(eccentricity)
    run = co.simulate(orbit, begun, dt=2 * np.pi / steps, steps=steps, method=method)
    q, p = run.records.n[:, :2], run.records.pi[:, :2]
    far = np.linalg.norm(q, axis=1)
    assert np.min(far) == pytest.approx(1 - eccentricity, rel=1e-6)
    assert np.max(np.abs((0.5 * np.sum(p**2, axis=1) - 1 / far) / -0.5 - 1)) < 1e-6
    np.testing.assert_allclose(run.final.n, [1 + eccentricity, 0.0, 2 * np.pi], rtol=0, atol=1e-6)


@pytest.mark.long
def test_the_motion_backwards_is_that_with_reversed_momenta():
    (orbit, begun), steps = start(0.99), 500
    there = co.simulate(orbit, begun, dt=2 * np.pi / 1000, steps=steps, method=SIXTH).final
    turned = orbit.state(q={"q": there.n[:2], "time": [-there.n[2]]}, pi=[*-there.pi[:2], there.pi[2]])
    back = co.simulate(orbit, turned, dt=2 * np.pi / 1000, steps=steps, method=SIXTH).final
    np.testing.assert_allclose(back.n, [*begun.n[:2], 0.0], rtol=0, atol=1e-10)


@pytest.mark.long
def test_two_bodies_pass_at_a_small_distance_and_keep_energy_and_momentum():
    """Masses 0.6 and 0.4, relative orbit of e = 0.996 and period 2π, its centre of mass in motion."""
    m, steps = np.array([0.6, 0.4]), 4000

    def pair(mu, n, pi):
        gap = n.one - n.two
        return 0.5 * pi.one @ pi.one / m[0] + 0.5 * pi.two @ pi.two / m[1] - m[0] * m[1] / jnp.sqrt(gap @ gap)

    def gap(mu, n, pi):
        return jnp.sqrt((n.one - n.two) @ (n.one - n.two))

    bodies = co.System(
        co.Translation(0), hamiltonian=pair, additional={"one": co.Trivial(2), "two": co.Trivial(2)}, name="pair"
    )
    speed, drift = np.sqrt(0.004 / 1.996), np.array([0.1, -0.05])
    p = m[0] * m[1] * np.array([0.0, speed])
    far = bodies.state(
        q={"one": [0.4 * 1.996, 0], "two": [-0.6 * 1.996, 0]}, pi=[*(p + m[0] * drift), *(-p + m[1] * drift)]
    )
    own, begun = co.mechanics.in_own_time(bodies, far, gap)
    run = co.simulate(own, begun, dt=2 * np.pi / steps, steps=steps, method=SIXTH)
    q, p = run.records.n, run.records.pi
    apart = np.linalg.norm(q[:, :2] - q[:, 2:4], axis=1)
    energies = 0.5 * np.sum(p[:, :2] ** 2, 1) / 0.6 + 0.5 * np.sum(p[:, 2:4] ** 2, 1) / 0.4 - 0.24 / apart
    assert np.min(apart) == pytest.approx(0.004, rel=1e-6)
    assert np.max(np.abs(energies / energies[0] - 1)) < 1e-6
    np.testing.assert_allclose(p[:, :2] + p[:, 2:4], p[:1, :2] + p[:1, 2:4] + np.zeros((steps + 1, 1)), atol=1e-14)
    expected = [*(np.array([0.4 * 1.996, 0]) + 2 * np.pi * drift), *(np.array([-0.6 * 1.996, 0]) + 2 * np.pi * drift)]
    np.testing.assert_allclose(run.final.n, [*expected, 2 * np.pi], rtol=0, atol=1e-6)


@pytest.mark.long
def test_a_top_in_its_own_time_has_the_states_of_the_top_at_their_times_and_explicit_time_is_read():
    inverse = np.diag([1.0, 0.5, 1 / 1.5])

    def top(mu, a, *, t):
        return 0.5 * mu @ inverse @ mu + (1 + 0.3 * jnp.sin(t)) * a[2]

    plain = co.System(co.SO3(), hamiltonian=top, advected=co.Defining(), name="top")
    begun = plain.state(mu=[0.3, 1.0, 1.5], a0=[0.2, 0, 1], t=0.4)
    own, first = co.mechanics.in_own_time(plain, begun, lambda mu, a: 1 / (1 + mu @ mu))
    run = co.simulate(own, first, dt=0.02, steps=100, method=SIXTH)
    time = run.final.n[0] - 0.4
    expected = co.trajectory(plain, begun, dt=time / 200, steps=200, method=co.methods.KahanLi6(co.Midpoint())).final
    np.testing.assert_allclose(run.final.mu, expected.mu, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.final.g, expected.g, rtol=0, atol=1e-9)


def test_systems_and_paces_that_do_not_fit_raise():
    free = co.System(co.Translation(0), lambda xi, n, nu: 0.5 * nu @ nu, additional=co.Trivial(2))
    timed = co.System(
        co.Translation(0), hamiltonian=lambda mu, n, pi: 0.5 * pi.time @ pi.time, additional={"time": co.Trivial(2)}
    )
    at = KEPLER.state(q=[1, 0])
    pushed = KEPLER.with_forces({"rub": lambda motion: co.Force(force=-motion.nu)})
    transform = co.mechanics.in_own_time
    cases = [
        (lambda: transform(free, free.state(q=[1, 0]), distance), ArgumentError, "made of ℋ"),
        (lambda: transform(pushed, at, distance), ArgumentError, "has ℋ alone"),
        (lambda: transform(timed, timed.state(q={"time": [1, 0]}), distance), ArgumentError, "`time` holds t"),
        (lambda: transform(KEPLER, timed.state(q={"time": [1, 0]}), distance), ArgumentError, "`start` must be one"),
        (lambda: transform(KEPLER, KEPLER.state(q=co.each([[1, 0], [2, 0]])), distance), ArgumentError, "`start` must"),
        (lambda: transform(KEPLER, at, lambda mu, n: n[0]), LagrangianError, r"The pace.*must take \(mu, n, pi\)"),
        (lambda: transform(KEPLER, at, lambda mu, n, pi: n), ArgumentError, "`pace` must be a function to one"),
        (lambda: transform(KEPLER, at, lambda mu, n, pi: -n[0]), ArgumentError, "`pace` must be a function to one"),
        (lambda: transform(3, at, distance), ArgumentError, "`system` must be"),
    ]
    for call, kind, says in cases:
        with pytest.raises(kind, match=says):
            call()
