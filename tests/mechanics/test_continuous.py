"""The continuous equations (P20)–(P22): Theorem 2, energy, the Hamiltonian side, pointwise and along solutions."""

from __future__ import annotations

from functools import partial

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics import continuous
from coadjoint.mechanics.discrete import Chord, Point, node
from coadjoint.mechanics.noether import isotropy_algebra, spatial_momentum, total_momentum
from coadjoint.mechanics.start import legendre
from systems import WORLDS, generator, random_system

ROUND_OFF = 1e-12
"""Of the largest entry of the result: accelerations need one solve with the mass matrix."""

FLAT = [world for world in WORLDS if "sphere" not in world and "curved" not in world]


def close(found, expected, size=1.0):
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUND_OFF * max(size, np.max(np.abs(expected), initial=0)))


def along_the_motion(system, function, state):
    """d/dt of function(state) along the vector field."""
    slope = continuous.vector_field(system, state)
    fields = ("g", "n", "a", "mu", "pi", "xi", "nu", "t")

    def at(*values):
        return function(state.replace(**dict(zip(fields, values, strict=True))))

    values = tuple(getattr(state, name) for name in fields)
    return jax.jvp(at, values, tuple(getattr(slope, name) for name in fields))[1]


@pytest.fixture(params=FLAT)
def forced(request):
    return random_system(request.param, forced=True)


@pytest.fixture(params=FLAT)
def free(request):
    return random_system(request.param)


def here(system, state):
    return node(system, state, Point(state.xi, state.n, state.nu, state.a, state.t))


@pytest.mark.cases(1)
def test_accelerations_move_the_legendre_momenta_as_the_equations_say(forced):
    """d/dt (∂_ξℓ, ∂_νℓ) along (ξ̇, ν̇, ṅ, ȧ) = (μ̇, π̇) of (P20), (P21)."""
    system, state = forced

    def both(state):
        slope = continuous.vector_field(system, state)
        return (
            along_the_motion(system, lambda s: legendre(system, s.xi, s.n, s.nu, s.a, s.t), state),
            (slope.mu, slope.pi),
        )

    found, expected = evaluate(both, state)
    close(found[0], expected[0])
    close(found[1], expected[1])


@pytest.mark.cases(1)
def test_theorem_2_holds_at_every_state(forced):
    """d/dt ⟨c, m⟩ = ⟨c, ∂_aℓ⋄a + T − f⋄n⟩ for c = Ad_{g⁻¹}c₀, every c₀ at once: d/dt of the spatial momentum."""
    system, state = forced
    group = system.group

    def both(state):
        rate = along_the_motion(system, partial(spatial_momentum, system), state)
        return rate, group.Ad_dual(group.inverse(state.g), here(system, state).source)

    close(*evaluate(both, state), size=10)


@pytest.mark.cases(1)
def test_total_body_momentum_obeys_its_equation(forced):
    """ṁ = ad*_ξ m + ∂_aℓ⋄a + T − f⋄n."""
    system, state = forced

    def both(state):
        rate = along_the_motion(system, partial(total_momentum, system), state)
        carried = system.group.ad_dual(state.xi, total_momentum(system, state))
        return rate, carried + here(system, state).source

    close(*evaluate(both, state), size=10)


@pytest.mark.cases(1)
def test_energy_changes_by_the_power_of_the_forces(forced):
    """Ė = ⟨T, ξ⟩ + ⟨f, ν⟩ − ∂_tℓ."""
    system, state = forced

    def both(state):
        rate = along_the_motion(system, lambda s: here(system, s).energy, state)
        torque, force = system.body_force(system.motion(state.xi, state.n, state.nu, state.a, state.t))
        explicit = jax.grad(lambda t: system.reduced_lagrangian(state.xi, state.n, state.nu, state.a, t))(state.t)
        return rate, torque @ state.xi + force @ state.nu - explicit

    close(*evaluate(both, state), size=10)


@pytest.mark.cases(1)
def test_velocities_invert_the_legendre_transform(free):
    system, state = free
    off = state.replace(xi=state.xi + 1e-2, nu=state.nu - 1e-2)
    xi, nu = evaluate(partial(continuous.velocities, system), off)
    close(xi, state.xi)
    close(nu, state.nu)


def _hamiltonian_gradients(system, state):
    """(∂_μ, ∂_π, ∂_n, ∂_a) of ℋ(μ, π, n, a) (P8)."""

    def hamiltonian(mu, pi, n, a):
        return continuous.energy(system, state.replace(mu=mu, pi=pi, n=n, a=a))

    return jax.jacfwd(hamiltonian, argnums=(0, 1, 2, 3))(state.mu, state.pi, state.n, state.a)


@pytest.mark.cases(1)
def test_gradients_of_the_reduced_hamiltonian(free):
    """ξ = ∂_μℋ, ν = ∂_πℋ, ∂_nℓ = −∂_nℋ, ∂_aℓ = −∂_aℋ (P6–P9)."""
    system, state = free

    def both(state):
        slopes = jax.grad(system.reduced_lagrangian, argnums=(1, 3))(state.xi, state.n, state.nu, state.a, state.t)
        by_mu, by_pi, by_n, by_a = _hamiltonian_gradients(system, state)
        return (by_mu, by_pi, -by_n, -by_a), (state.xi, state.nu, *slopes)

    for found, expected in zip(*evaluate(both, state), strict=True):
        close(found, expected)


@pytest.mark.long
@pytest.mark.cases(1)
def test_motion_is_generated_by_the_bracket(free):
    """ḟ = {f, ℋ} for a random linear f of (μ, π, n, a)."""
    system, state = free
    group, Q, V = system.places
    random = generator("bracket", system.name)
    f = [random.normal(size=x.shape) for x in (state.mu, state.pi, state.n, state.a)]

    def both(state):
        slope = continuous.vector_field(system, state)
        k = _hamiltonian_gradients(system, state)
        (f_mu, f_pi, f_n, f_a), (k_mu, k_pi, k_n, k_a) = f, k
        n, a = state.n, state.a
        act, lift, move = Q.infinitesimal, Q.lifted, V.infinitesimal
        bracket = (
            -state.mu @ group.ad(f_mu, k_mu)
            + f_n @ k_pi
            - k_n @ f_pi
            - f_n @ act(group, k_mu, n)
            + k_n @ act(group, f_mu, n)
            + state.pi @ (lift(group, k_mu, n, f_pi) - lift(group, f_mu, n, k_pi))
            - f_a @ move(group, k_mu, a)
            + k_a @ move(group, f_mu, a)
        )
        return f_mu @ slope.mu + f_pi @ slope.pi + f_n @ slope.n + f_a @ slope.a, bracket

    close(*evaluate(both, state), size=10)


ALONG = ["SO3", "SE3", "SL2"]


@pytest.mark.long
@pytest.mark.parametrize("world", ALONG)
def test_theorem_2_and_energy_along_an_exact_solution(world):
    """I(T) − I(0) = ∫⟨c, Δ⟩dt by Gauss–Legendre quadrature; E is constant; the reference is good to 1e-12."""
    system, start = random_system(world)
    nodes, weights = np.polynomial.legendre.leggauss(64)
    duration = 1.5
    times = np.concatenate([[0.0], 0.5 * duration * (1 + nodes), [duration]]) + float(start.t)
    motion = continuous.reference(system, start, times)
    records = [jax.tree.map(lambda rows, i=i: rows[i], motion) for i in range(len(times))]
    group = system.group

    def observed(state):
        source = group.Ad_dual(group.inverse(state.g), here(system, state).source)
        return spatial_momentum(system, state), source, here(system, state).energy

    observe = tabulate(observed, records[0])
    momenta, sources, energies = (np.array(x) for x in zip(*map(observe, records), strict=True))
    scale = np.max(np.abs(momenta))
    impulse = 0.5 * duration * weights @ sources[1:-1]
    assert np.max(np.abs(impulse)) > 1e-2 * scale
    np.testing.assert_allclose(momenta[-1] - momenta[0], impulse, rtol=0, atol=1e-11 * scale)
    np.testing.assert_allclose(energies, energies[0], rtol=1e-11)


@pytest.mark.long
@pytest.mark.cases(4)
@pytest.mark.parametrize("world", ["SO4", "Heisenberg", "R3", "SO2", "SO3 alone"])
def test_momenta_of_the_isotropy_algebra_are_conserved_along_an_exact_solution(world):
    system, start = random_system(world)
    directions = isotropy_algebra(system, start)
    assert len(directions) > 0
    end = jax.tree.map(lambda rows: rows[-1], continuous.reference(system, start, [float(start.t), float(start.t) + 1]))
    first, last = (directions @ evaluate(partial(spatial_momentum, system), s) for s in (start, end))
    np.testing.assert_allclose(last, first, rtol=0, atol=1e-11 * max(1.0, np.max(np.abs(first))))


def test_reference_refuses_a_curved_space():
    system, start = random_system("SO3 on a sphere")
    with pytest.raises(ArgumentError, match="flat space"):
        continuous.reference(system, start, [0.0, 1.0])


@pytest.mark.parametrize("times", [[], [1.0, 0.5], [0.1, 0.1], [-0.1, 0.2], 3.0, [[0.1]]], ids=str)
def test_reference_refuses_times_out_of_order(times):
    system, start = random_system("SO3 alone")
    with pytest.raises(ArgumentError, match="in order and on one side"):
        continuous.reference(system, start.replace(t=np.float64(0)), times)


def test_reference_at_the_start_alone_is_the_start():
    system, start = random_system("SO3 alone")
    found = continuous.reference(system, start, [float(start.t)])
    close(found.mu[0], start.mu)
    close(found.xi[0], start.xi)


@pytest.mark.long
def test_reference_from_a_record_goes_on_with_its_momenta():
    """(ξ, ν) of a record are the velocities of its momenta; those of its step are off by O(h)."""
    system, start = random_system("SO3")
    record = co.trajectory(system, start, dt=0.01, steps=3).final
    found = continuous.reference(system, record, [float(record.t), float(record.t) + 0.1])
    xi, _ = evaluate(partial(continuous.velocities, system), record)
    close(xi, record.xi)
    assert np.max(np.abs(xi - record.origin.unknowns[0])) > 1e-5
    close(found.mu[0], record.mu)
    close(found.pi[0], record.pi)


def test_equations_of_the_paper_s_vehicle():
    """(P65): Jω̇ = Jω×ω − B r×a + Mν×ν, Mν̇ = (mg − B)a − ω×Mν."""
    J, M, r = np.diag([5.46, 5.29, 5.72]), np.diag([188.8, 193.8, 198.8]), np.array([0, 0, -0.007])
    weight, B = -1.322, 1215.8

    def lagrangian(xi, n, nu, a):
        return 0.5 * nu @ M @ nu + 0.5 * xi @ J @ xi + weight * n @ a - B * r @ a

    system = co.System(co.SO3(), lagrangian, additional=co.Defining(), advected=co.Defining())
    g = co.attitude.zyx(0.3, 0.2, 0.1)
    state = system.state(g=g, q=[1, 2, 3], xi=[0.2, 0.1, 0.3], qdot=[0.1, 0.2, 0.8], a0=[0, 0, 1])
    slope = evaluate(partial(continuous.vector_field, system), state)
    omega, nu, a, cross = state.xi, state.nu, state.a, np.cross
    angular = cross(J @ omega, omega) - B * cross(r, a) + cross(M @ nu, nu)
    close(J @ slope.xi, angular, 100)
    close(M @ slope.nu, weight * a - cross(omega, M @ nu), 100)
    close(slope.n, nu - cross(omega, state.n), 10)
    close(slope.a, -cross(omega, a))


def test_a_node_of_a_chord_has_the_torque_of_both_of_its_ends():
    """(1 − w) ∂_nℓ × x + w ∂_nℓ × y + (π × y − π × x)/h + T, and f alike in the source, on SO(3) and ℝ³."""
    torque, force, field = np.array([0.3, -0.1, 0.2]), np.array([0.5, 0.4, -0.7]), np.array([0.2, 0.9, -0.4])
    system = co.System(
        co.SO3(), lambda xi, n, nu: 0.5 * xi @ xi + nu @ nu + field @ n, additional=co.Defining(),
        forces=lambda motion: co.Force(torque, force),
    )  # fmt: skip
    x, y, w, h = np.array([0.1, 0.7, -0.3]), np.array([0.4, 0.5, 0.2]), 0.3, 0.1
    state = system.state(q=x)
    point = Point(np.array([0.2, 0.1, 0.4]), x + w * (y - x), (y - x) / h, np.zeros(0), 0.0)
    found = evaluate(lambda s, p, x, y: node(system, s, p, Chord(x, y, w, h)), state, point, x, y)
    mean, pi = (1 - w) * x + w * y, 2 * (y - x) / h
    np.testing.assert_allclose(found.torque, np.cross(field, mean) + np.cross(pi, y - x) / h + torque, atol=1e-13)
    np.testing.assert_allclose(found.source, torque - np.cross(force, mean), atol=1e-14)
    np.testing.assert_allclose(found.force, field + force, atol=1e-15)
