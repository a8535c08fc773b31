"""Galerkin's methods: order 2s, the stationary action, momentum, the two-form, symmetry, native code, and refusals."""

from __future__ import annotations

from functools import lru_cache, partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
import paper_vehicle
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.continuous import reference
from coadjoint.mechanics.noether import isotropy_algebra, spatial_momentum
from coadjoint.methods.quadrature import gauss
from coadjoint.runs.methods import method as method_of
from coadjoint.runs.sections import MethodSection
from stepping import Stepper
from systems import MAPS, WORLDS, generator, random_system
from two_form import carry, tangents

H, ROUND_OFF = 0.15, 2e-13
QUICK = [("SO3 alone", "cayley", 3), ("SO3", "exponential", 2), ("SE2", "squared", 2), ("SL2", "bent", 2)]
OTHERS = [(world, list(MAPS)[i % len(MAPS)], 2) for i, world in enumerate(WORLDS) if world != "SO3 on a sphere"]
CASES = [*QUICK, *(pytest.param(*case, marks=pytest.mark.long) for case in OTHERS if case not in QUICK)]
"""Every world with the maps in turn, a few of them always."""

cases = pytest.mark.parametrize(("world", "tau", "degree"), CASES, ids=lambda part: str(part).replace(" ", "_"))


@lru_cache
def step_of(world: str, tau: str, degree: int, forced: bool = True):
    """A system and one step of it that starts in motion: (system, leap, the largest momentum)."""
    system, start = random_system(world, forced)
    leap = Stepper(system, co.Galerkin(MAPS[tau], degree=degree)).run(start, H, 2)[-1]
    return system, leap, np.max(np.abs(np.concatenate([leap.record.mu, leap.record.pi])))


def close(found, expected, scale=1.0) -> None:
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=ROUND_OFF * max(scale, np.max(np.abs(other), initial=0.0)))


def action_and_work(system, method, record, h):
    """(dΛ + virtual work, ⟨μ₁, η₁⟩ + ⟨π₁, w₁⟩ − ⟨μ₀, η₀⟩ − ⟨π₀, w₀⟩) of a step, as covectors on all its variations.

    Written from g(t) = ḡ τ(Θ(t)), q(t) = ḡ·x(t) in the space frame and differentiated: it shares with the method only
    τ, the action of the group, ℓ and Gauss's nodes. Variations are those of ḡ, of Ω, of x₀ and of V.
    """
    group, Q, V = system.places
    rule, tau, s = gauss(method.degree), method.difference_map, method.degree
    size = s * group.dim
    omega, v = record.memory[:size].reshape(s, -1), record.memory[size:].reshape(s, -1)
    a0 = V.act(group, record.g, record.a)
    back = group.inverse(tau.tau(group, -h * (rule.half @ omega)))
    middle = group.compose(record.g, back)
    x_first = Q.act(group, group.inverse(back), record.n)

    def until(t):
        """∫₀ᵗ L_j, by the quadrature, for t in [0, 1]."""
        vandermonde = np.vander(rule.c, s, increasing=True)
        return t ** jnp.arange(1, s + 1) / jnp.arange(1, s + 1) @ np.linalg.inv(vandermonde)

    def curve(y, t):
        zeta, omega, x, v = y
        moved = group.compose(middle, tau.tau(group, zeta))
        theta = h * ((until(t / h) - until(0.5)) @ omega)
        return group.compose(moved, tau.tau(group, theta)), Q.act(group, moved, x + h * (until(t / h) @ v))

    def body(g, q, dg, dq):
        """(g⁻¹ġ, g⁻¹q̇) of velocities of the matrix of g and of q."""
        return group.vee(jnp.linalg.solve(group.matrix(g), dg)), Q.push(group, group.inverse(g), q, dq)

    def lines(y, t):
        g, q = curve(y, t)
        _, (dg, dq) = jax.jvp(lambda t: (lambda g, q: (group.matrix(g), q))(*curve(y, t)), (t,), (1.0,))
        return (g, q, *body(g, q, dg, dq))

    def point(y, t):
        g, q, xi, nu = lines(y, t)
        back = group.inverse(g)
        return xi, Q.act(group, back, q), nu, V.act(group, back, a0), record.t + t

    def action(y):
        return h * sum(b * system.reduced_lagrangian(*point(y, c * h)) for b, c in zip(rule.b, rule.c, strict=True))

    y = (jnp.zeros(group.dim), omega, x_first, v)

    def varied(d, t):
        """(g⁻¹δg, g⁻¹δq) at time t."""
        (g, q), _ = curve(y, t), None
        _, (dg, dq) = jax.jvp(lambda y: (lambda g, q: (group.matrix(g), q))(*curve(y, t)), (y,), (d,))
        return body(g, q, dg, dq)

    def work(d):
        total = 0.0
        for b, c in zip(rule.b, rule.c, strict=True):
            torque, force = system.body_force(system.motion(*point(y, c * h)))
            eta, w = varied(d, c * h)
            total = total + h * b * (torque @ eta + force @ w)
        return total

    def boundary(d, mu, pi):
        (eta0, w0), (eta1, w1) = varied(d, 0.0), varied(d, h)
        return mu @ eta1 + pi @ w1 - record.mu @ eta0 - record.pi @ w0

    zero = jax.tree.map(jnp.zeros_like, y)
    inside = jax.tree.map(jnp.add, jax.grad(action)(y), jax.grad(work)(zero))
    return inside, lambda mu, pi: jax.grad(boundary)(zero, mu, pi)


@pytest.mark.long
@pytest.mark.cases(1)
@cases
def test_a_step_makes_the_action_with_the_forces_work_stationary(world, tau, degree):
    system, leap, scale = step_of(world, tau, degree)

    def both(record, h, mu, pi):
        inside, boundary = action_and_work(system, leap.step, record, h)
        return inside, boundary(mu, pi)

    inside, boundary = evaluate(both, leap.record, leap.h, leap.after.mu, leap.after.pi)
    size = 1 + np.max(np.abs(leap.record.n), initial=0.0)
    close(inside, boundary, scale * size)
    assert np.max(np.abs(inside[0])) > 1e-3 * scale, "an action of nothing proves nothing"


@pytest.mark.long
@pytest.mark.cases(3)
@cases
def test_theorem_7_holds_to_round_off(world, tau, degree):
    system, leap, _ = step_of(world, tau, degree)

    def certificate(record, h, after):
        balance = leap.step.balance(system, record, h, after)
        return balance, leap.step.newton_residual(system, record, h, after), leap.step.sources(system, record, h)[0]

    balance, residual, source = evaluate(certificate, leap.record, leap.h, leap.after)
    assert balance <= ROUND_OFF
    assert residual <= ROUND_OFF
    assert np.max(np.abs(source)) > 1e-4


@pytest.mark.long
@pytest.mark.cases(1)
@cases
def test_a_step_back_undoes_a_step(world, tau, degree):
    system, leap, scale = step_of(world, tau, degree)
    back = Stepper(system, co.Galerkin(MAPS[tau], degree=degree)).leaps(leap.after, -H)[-1].after
    for name in ("t", "g", "n", "a"):
        close(getattr(back, name), getattr(leap.record, name))
    close((back.mu, back.pi), (leap.record.mu, leap.record.pi), scale)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("world", "tau", "degree"), QUICK[:2], ids=lambda part: str(part).replace(" ", "_"))
def test_unforced_steps_keep_the_two_form_and_momentum(world, tau, degree):
    system, start = random_system(world)
    method, random = co.Galerkin(MAPS[tau], degree=degree), generator("tangents", world)
    state = method.begin(system, start, H)
    pair = tangents(system, state, random), tangents(system, state, random)
    record, after, code, (before, later, size) = evaluate(partial(carry, system, method), state, H, *pair)
    assert code == 0
    assert abs(before) > 1e-4 * size, "a two-form of nothing proves nothing"
    assert abs(later - before) <= ROUND_OFF * size
    directions = isotropy_algebra(system, record)
    momentum = tabulate(partial(spatial_momentum, system), record)
    close(directions @ momentum(after), directions @ momentum(record), 10 * np.max(np.abs(momentum(record))))


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("world", "tau"), [("SO3", "cayley"), ("SL2", "squared")])
def test_degree_1_is_the_midpoint_rule(world, tau):
    system, start = random_system(world, forced=True)
    one, other = (
        Stepper(system, method).run(start, H, 2)[-1]
        for method in (co.Galerkin(MAPS[tau], degree=1), co.Midpoint(MAPS[tau]))
    )
    for name in ("g", "n", "a", "mu", "pi"):
        close(getattr(one.after, name), getattr(other.after, name))
    close((one.record.xi, one.record.nu), (other.record.xi, other.record.nu))


# (world, map, forced, degree, steps a second): errors from 1e-5 to 1e-12, above the round-off of the reference.
ORDERS = [
    ("SO3", "cayley", True, 2, 8),
    pytest.param("SE2", "squared", False, 2, 8, marks=pytest.mark.long),
    pytest.param("SO3", "exponential", True, 3, 5, marks=pytest.mark.long),
    ("SE2", "cayley", False, 3, 5),
    ("SO3", "cayley", True, 4, 6),
    ("SO3 alone", "cayley", False, 4, 4),
]


@lru_cache
def exact(world: str, forced: bool):
    system, start = random_system(world, forced)
    return coordinates(system, jax.tree.map(lambda x: x[-1], reference(system, start, [float(start.t) + 1])))


def coordinates(system, state):
    return np.concatenate([np.ravel(evaluate(system.group.matrix, state.g)), state.n, state.a, state.mu, state.pi])


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("world", "tau", "forced", "degree", "steps"), ORDERS)
def test_order_is_twice_the_degree(world, tau, forced, degree, steps):
    system, start = random_system(world, forced)
    method, errors = co.Galerkin(MAPS[tau], degree=degree), []
    stepper = Stepper(system, method)
    counts = [steps, round(steps * 2**0.5)]
    for count in counts:
        end = coordinates(system, stepper.final(start, 1 / count, count))
        errors.append(np.max(np.abs(end - exact(world, forced))))
    assert errors[-1] > 5e-13
    order = np.log(errors[0] / errors[1]) / np.log(counts[1] / counts[0])
    assert order == pytest.approx(method.order, abs=0.2)


def vehicle_run(method, **keywords):
    vehicle = paper_vehicle.system()
    return co.simulate(vehicle, paper_vehicle.start(vehicle), dt=0.05, duration=5, method=method, **keywords)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("degree", [2, 3])
def test_native_steps_are_the_steps_of_the_reference(degree):
    vehicle, method = paper_vehicle.system(), co.Galerkin(degree=degree)
    start = paper_vehicle.start(vehicle)
    one, other = (Stepper(vehicle, method, compiled).run(start, 0.05, 4)[-1] for compiled in (True, False))
    close(one.record, other.record, 200.0)
    close(one.after, other.after, 200.0)


@pytest.mark.long
def test_a_vehicle_s_run_is_certified():
    """Energy within the band of order 6, where the midpoint rule's is 4e-7."""
    run = vehicle_run(co.Galerkin(degree=3), backend="native")
    assert run.largest("balance") <= 1e-13
    assert run.largest("newton_residual") <= 1e-13
    assert run.newton_iterations_mean <= 3
    assert run.relative_change("energy") <= 1e-12
    assert run.relative_change("kelvin_noether") <= 1e-13


@pytest.mark.long
def test_gradients_of_a_trajectory():
    """d(q_z)/d(mass) by native code against a difference of two runs."""
    vehicle = paper_vehicle.system()
    start = paper_vehicle.start(vehicle)

    def depth(mass):
        moved = vehicle.replace(mass=mass)
        return co.trajectory(moved, start, dt=0.05, steps=8, method=co.Galerkin(degree=2)).final.n[2]

    with co.float64():
        slope = float(jax.grad(depth)(123.8))
    assert slope == pytest.approx((depth(123.9) - depth(123.7)) / 0.2, rel=1e-5)


@pytest.mark.long
def test_an_ensemble_is_its_members():
    vehicle, method = paper_vehicle.system(), co.Galerkin(degree=2)
    masses = [120.0, 123.8, 130.0]
    fleet = co.simulate(
        vehicle.replace(mass=co.each(masses)), paper_vehicle.start(vehicle), dt=0.05, duration=1, method=method
    )
    one = co.simulate(vehicle.replace(mass=130.0), paper_vehicle.start(vehicle), dt=0.05, duration=1, method=method)
    np.testing.assert_allclose(fleet.dataset.q.values[2], one.dataset.q.values, rtol=0, atol=1e-12)


@pytest.mark.long
def test_a_run_goes_on_from_its_last_record_with_another_degree():
    vehicle = paper_vehicle.system()
    first = vehicle_run(co.Galerkin(degree=2))
    for method in (co.Galerkin(degree=2), co.Galerkin(degree=3), co.Midpoint()):
        co.simulate(vehicle, first.final, dt=0.05, duration=0.1, method=method)


def test_a_run_file_gives_the_degree():
    assert method_of(MethodSection(name="galerkin", map="squared cayley", degree=3)) == co.Galerkin(
        co.difference_maps.Squared(co.Cayley()), degree=3
    )
    with pytest.raises(ArgumentError, match="degree belongs to Galerkin"):
        method_of(MethodSection(name="Midpoint", degree=3))


@pytest.mark.long
def test_newton_starts_from_the_last_curve_as_its_new_frame_sees_it():
    """Two iterations a step where constant velocities would need three; the guess is off by O(h^s)."""
    vehicle = paper_vehicle.system()
    start = paper_vehicle.start(vehicle)
    misses = []
    for h in (0.1, 0.05):
        step = co.Galerkin(degree=3)
        after = Stepper(vehicle, step).final(start, h, 4)
        guess = evaluate(partial(step.guess, vehicle), after, h)
        leap = Stepper(vehicle, step).leaps(after, h)[-1]
        misses.append(np.max(np.abs(guess - leap.record.memory)))
    assert np.log2(misses[0] / misses[1]) > 2.5


def test_what_galerkin_refuses():
    with pytest.raises(ArgumentError, match="`degree` must be 1, 2, 3 or 4"):
        co.Galerkin(degree=5)
    with pytest.raises(ArgumentError, match="Galerkin starts from momenta"):
        co.Galerkin(start="velocity")
