"""The isospectral midpoint rule: spectrum, orders, an independent form, gradients, memory, runs without g, refusals."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, GroupError, LagrangianError
from coadjoint.groups import matrix_elements
from coadjoint.kernels.newton.fixed_point import AGEING, FixedPoint
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.methods import isospectral_midpoint
from coadjoint.methods.isospectral_fields import moved
from coadjoint.methods.isospectral_midpoint import STEPS, _weights
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.models import fluids
from coadjoint.simulation.trajectory import computed
from systems import generator

H = 0.1


def system_on(group, **more):
    """ℋ = ½ Σ w_i μ_i² + 0.1 Σ w_i μ_i³, of no symmetry, and a start of size 1."""
    weights = np.linspace(0.5, 1.5, group.dim)

    def hamiltonian(mu, p):
        return p.scale * (0.5 * mu @ (weights * mu) + 0.1 * weights @ mu**3)

    system = co.System(group, hamiltonian=hamiltonian, parameters={"scale": 1.0}, **more)
    mu = generator("isospectral", repr(group)).normal(size=group.dim)
    return system, system.state(mu=mu / np.linalg.norm(evaluate(group.hat, mu), 2))


def matrix(group, mu):
    """W, complex (n, n)."""
    found = evaluate(group.hat, mu)
    return co.groups.complex_form(found) if isinstance(group, (co.Un, co.SUn)) else found + 0j


def path(system, start, steps, method=None, h=H):
    return co.trajectory(system, start, dt=h, steps=steps, method=method or co.IsospectralMidpoint())


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("group", [co.Un(5), co.SUn(3), co.SOn(5), co.SO3()], ids=repr)
def test_spectrum_is_kept_to_round_off_whatever_the_tolerance(group):
    system, start = system_on(group)
    for tolerance in (1e-14, 1e-5):
        found = path(system, start, 300, co.IsospectralMidpoint(tolerance=tolerance)).final.mu
        before, after = (np.linalg.eigvalsh(-1j * matrix(group, mu)) for mu in (start.mu, found))
        assert np.max(np.abs(found - start.mu)) > 0.1
        np.testing.assert_allclose(after, before, rtol=0, atol=1e-14)


@pytest.mark.long
def test_a_step_is_that_of_the_published_equations():
    """W = (1 − εP̃)W̃(1 + εP̃), W' = (1 + εP̃)W̃(1 − εP̃) with complex matrices, solved by NumPy alone."""
    group = co.Un(4)
    system, start = system_on(group)
    after = path(system, start, 1).final.mu
    W, epsilon = matrix(group, start.mu), 0.5 * H
    weights = np.linspace(0.5, 1.5, group.dim)
    middle, P = W, W
    for _ in range(60):
        mu = evaluate(group.coordinates, (middle.real, middle.imag))
        P = -matrix(group, weights * mu + 0.3 * weights * mu**2)
        middle = W + epsilon * (P @ middle - middle @ P) + epsilon**2 * P @ middle @ P
    one = np.eye(4)
    np.testing.assert_allclose((one - epsilon * P) @ middle @ (one + epsilon * P), W, atol=1e-15)
    expected = (one + epsilon * P) @ middle @ (one - epsilon * P)
    np.testing.assert_allclose(matrix(group, after), expected, rtol=0, atol=2e-15)


@pytest.mark.long
def test_carried_g_turns_the_momentum():
    """μ_k = Ad*_{g_k} of one spatial momentum, and the motion is that without g."""
    system, start = system_on(co.Un(3))
    run = co.simulate(system, start, dt=H, steps=20, method=co.IsospectralMidpoint(carry_g=True), accuracy=False)
    assert run.summary()["kelvin_noether_error_max"] < 1e-14 and run.largest("group_defect") < 1e-14
    assert run.largest("balance") < 1e-14 and run.largest("newton_residual") < 1e-13
    np.testing.assert_array_equal(run.final.mu, path(system, start, 20).final.mu)
    assert np.max(np.abs(run.final.g[0] - np.eye(3))) > 0.1


def test_carried_g_turns_the_momentum_in_its_derivatives_too():
    """μ' = Ad*_g μ of a step from μ = (1 − εP̃)W̃(1 + εP̃), along a change of W̃."""
    system, start = system_on(co.SO3())
    method, (z, along) = co.IsospectralMidpoint(carry_g=True), generator("g").normal(size=(2, 3))
    begun, none = method.begin(system, start, H), jnp.zeros(0)

    def ends(e):
        record = method.record(system, begun, H, z + e * along)
        middle = record.memory.middle
        record = record.replace(mu=middle - moved(system, record.xi, none, middle, 0.5 * H))
        after = method.advance(system, record, H)
        return after.mu, system.group.Ad_dual(after.g, record.mu), after.g

    ours, theirs = evaluate(lambda e: jax.jvp(ends, (e,), (1.0,)), np.float64(0.0))
    for mu, turned, _ in (ours, theirs):
        np.testing.assert_allclose(mu, turned, rtol=0, atol=1e-14)
    assert np.max(np.abs(theirs[2])) > 0.01
    back = evaluate(jax.grad(lambda e: ends(e)[0][0]), np.float64(0.0))  # of a record alone, by reverse mode
    assert back == pytest.approx(theirs[0][0], rel=1e-12)


@pytest.mark.parametrize("large", [isospectral_midpoint.LARGE, 0], ids=["small", "large"])
def test_a_step_from_unknowns_that_are_off_turns_the_momentum_by_g(large, monkeypatch):
    """μ' = Ad*_g μ to round-off after three iterations; a correction of large momenta is in double precision then."""
    monkeypatch.setattr(isospectral_midpoint, "LARGE", large)
    system, start = system_on(co.SO3())
    method = co.IsospectralMidpoint(carry_g=True, tolerance=1e-5)
    begun = method.begin(system, start, H)

    def ends(z):
        found: Any = None
        for _ in range(3):
            off, found = method.evaluated(system, begun, H, z)
            z = z - off
        after = method.advance(system, method.record(system, method.solved(begun, found), H, z), H)
        return after.mu, system.group.Ad_dual(after.g, begun.mu), method.residual(system, begun, H, z)

    mu, turned, off = evaluate(ends, begun.mu)
    assert np.max(np.abs(off)) > 1e-6
    np.testing.assert_allclose(mu, turned, rtol=0, atol=4e-15)
    assert np.linalg.norm(mu) == pytest.approx(np.linalg.norm(start.mu), abs=4e-15)


@pytest.mark.long
def test_runs_without_g_have_momenta_and_refuse_what_needs_g(monkeypatch):
    """On U(8), with a basis out of reach."""
    monkeypatch.setattr(matrix_elements, "LARGEST_BASIS", 0)
    system, start = system_on(co.Un(8), quantities={"enstrophy": lambda state: state.mu @ state.mu})
    method = co.IsospectralMidpoint()
    run = co.simulate(system, start, dt=H, steps=20, method=method)
    assert run.relative_change("enstrophy") < 1e-14 and run.relative_change("energy") < 1e-2
    assert "mu" in run.dataset and "real" not in run.dataset and run.final.g is None
    watching = system.watching({"turn": lambda state: state.g[0][0, 0]})
    with pytest.raises(ArgumentError, match="`turn` needs g, which this method does not compute"):
        co.simulate(watching, start, dt=H, steps=2, method=method)
    with pytest.raises(ArgumentError, match="`turned` needs g, which this method does not compute"):
        co.simulate(system, start, dt=H, steps=2, method=method, events={"turned": lambda state: state.g[0][0, 1]})
    with pytest.raises(LagrangianError, match="`wrong` raised AttributeError"):
        co.simulate(system, start, dt=H, steps=2, method=method, events={"wrong": lambda state: state.height})
    with pytest.raises(ArgumentError, match="Kelvin–Noether quantities need g"):
        co.simulate(system, start, dt=H, steps=2, method=method, kelvin_noether=co.mechanics.KelvinNoether(np.ones(64)))
    with pytest.raises(ArgumentError, match="The start has no g"):
        co.simulate(system, run.final, dt=H, steps=2, method=co.IsospectralMidpoint(carry_g=True))
    with pytest.raises(ArgumentError, match=r"The start has no g, .* or go on with co.IsospectralMidpoint"):
        co.simulate(system, run.final, dt=H, steps=2, method=co.HamiltonianMidpoint())


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("method", "order", "steps"),
    [(lambda base: base, 2, 32), (co.Suzuki4, 4, 16), (co.methods.KahanLi6, 6, 16), (co.methods.KahanLi8, 8, 16)],
    ids=["2", "4", "6", "8"],
)
def test_orders(method, order, steps):
    system, start = system_on(co.Un(4))
    exact = path(system, start, 96, co.methods.KahanLi8(co.IsospectralMidpoint()), 3.2 / 96).final.mu
    made = method(co.IsospectralMidpoint())
    errors = [np.max(np.abs(path(system, start, n, made, 3.2 / n).final.mu - exact)) for n in (steps, 2 * steps)]
    assert errors[1] > 3e-14
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


@pytest.mark.long
def test_gradients_equal_differences():
    """Of the momentum after 12 steps, in the start, forward and reverse, and in a parameter."""
    system, start = system_on(co.Un(3))
    along, weight = generator("along").normal(size=(2, 9))

    def value(mu, scale):
        found = path(system.replace(scale=scale), start.replace(mu=mu), 12).final.mu
        return weight @ found

    with co.float64():
        slope, in_scale = jax.grad(value, argnums=(0, 1))(start.mu, 1.0)
        forward = jax.jvp(lambda e: value(start.mu + e * along, 1.0), (0.0,), (1.0,))[1]
    slope, in_scale, forward = map(np.asarray, (slope, in_scale, forward))

    def difference(function, e=2e-3):
        """By Richardson's extrapolation, of order 6."""
        first, second, third = ((function(d) - function(-d)) / (2 * d) for d in (e, 2 * e, 4 * e))
        return (64 * first - 20 * second + third) / 45

    expected = difference(lambda e: value(start.mu + e * along, 1.0))
    np.testing.assert_allclose([slope @ along, forward], expected, rtol=1e-9)
    np.testing.assert_allclose(in_scale, difference(lambda e: value(start.mu, 1.0 + e)), rtol=1e-9)


@pytest.mark.long
def test_a_run_that_is_cut_goes_on_to_the_same_bits():
    """What the iteration starts from is in the state."""
    system, start = system_on(co.SUn(3))
    method = co.IsospectralMidpoint(tolerance=1e-4)
    program = StepProgram(system.replace(), method)
    given = program, Constants(system.parameters, None)
    begun = method.begin(system, start, H)
    whole = computed(*given, begun, H, (10, 1), "xla").final
    half = computed(*given, begun, H, (4, 1), "xla").final
    rest = computed(*given, half, H, (6, 1), "xla").final
    forgot = computed(*given, half.replace(memory=begun.memory), H, (6, 1), "xla").final
    np.testing.assert_array_equal(rest.mu, whole.mu)
    assert np.any(forgot.mu != whole.mu)


@pytest.mark.long
def test_energy_that_time_changes_is_counted():
    group = co.Un(3)
    weights = np.linspace(0.5, 1.5, group.dim)
    system = co.System(group, hamiltonian=lambda mu, *, t: 0.5 * mu @ (weights * mu) * (1 + 0.3 * jnp.sin(t)))
    start = system.state(mu=np.linspace(-0.5, 0.6, group.dim))
    run = co.simulate(system, start, dt=0.05, steps=20, method=co.IsospectralMidpoint(), accuracy=False)
    budget = run.dataset.energy_budget.values
    assert np.ptp(budget) < 1e-3 < 0.1 < np.ptp(run.dataset.energy.values)


@pytest.mark.long
def test_what_does_not_fit_is_refused():
    system, start = system_on(co.Un(3))
    wrong: Any = (
        ({"tolerance": 1.0}, "`tolerance` must be a number over 0 and below 0.001, but is 1.0"),
        ({"carry_g": 1}, "`carry_g` must be True or False, but is 1"),
        ({"start": "velocity"}, "starts from momenta"),
    )
    for arguments, sentence in wrong:
        with pytest.raises(ArgumentError, match=sentence):
            co.IsospectralMidpoint(**arguments)
    one = lambda group, **more: co.System(group, hamiltonian=lambda mu, *rest: mu @ mu, **more)  # noqa: E731
    for made, sentence in (
        (one(co.SE3()), "needs co.SOn, co.SO3, co.Un or co.SUn, or copies of one, but got SE3"),
        (co.System(co.SO3(), lambda xi: 0.5 * xi @ xi), "needs a system with a `hamiltonian`"),
        (one(co.SO3(), forces=lambda motion: co.Force(torque=-motion.xi)), "takes no forces"),
        (one(co.SO3(), additional=co.Defining()), "takes no additional dynamics"),
    ):
        with pytest.raises(ArgumentError, match=sentence):
            co.IsospectralMidpoint().require_fit(made)
    with pytest.raises(GroupError, match="does not map the algebra"):
        co.IsospectralMidpoint(carry_g=True).require_fit(one(co.SUn(3)))
    with pytest.raises(ArgumentError, match="made of the Cayley transform"):
        co.IsospectralMidpoint(co.Exponential()).require_fit(system)
    with pytest.raises(ArgumentError, match='backend="xla"'):
        co.simulate(system, start, dt=H, steps=2, method=co.IsospectralMidpoint(), backend="native")
    with pytest.raises(co.errors.StepError, match="take a smaller dt: the iteration needs"):
        co.simulate(system, start, dt=30.0, steps=3, method=co.IsospectralMidpoint(), accuracy=False)
    with pytest.raises(co.errors.StepError, match=r"A step of the trajectory failed: its numbers .* take a smaller dt"):
        co.trajectory(system, start, dt=30.0, steps=3, method=co.IsospectralMidpoint())


@pytest.mark.long
def test_the_step_that_is_named_where_one_was_too_long_is_the_longest_half_that_is_solved():
    system, start = system_on(co.Un(3))
    method = co.IsospectralMidpoint()

    def run(dt):
        return co.simulate(system, start, dt=dt, steps=1, method=method, accuracy=False, progress=False)

    with pytest.raises(co.errors.StepError) as caught:
        run(30.0)
    named = float(str(caught.value).split("and a step of ")[1].split(" s")[0])
    assert np.log2(30.0 / named) == pytest.approx(round(np.log2(30.0 / named)), abs=1e-5)
    assert run(named).good_steps == 1
    with pytest.raises(co.errors.StepError):
        run(2 * named)


def test_the_fixed_point_ends_where_it_diverges():
    """A contraction converges, and what is none fails with a code, as does what is not finite."""

    def root(slope):
        return FixedPoint().root(lambda z: z - slope * z - 1, jnp.ones(2), jnp.asarray(0.1), (2,))[:3]

    for slope, code in ((0.5, 0), (-2.0, 1), (np.nan, 2)):
        assert evaluate(root, slope)[2] == code
    np.testing.assert_allclose(evaluate(root, 0.5)[0], 2.0, rtol=1e-13)


def test_the_fixed_point_expects_what_the_step_before_has_seen():
    """From where one iteration is enough if r shrinks by 0.2 with h = 0.1; a rate that it did not measure grows."""

    def root(carried, h):
        found = FixedPoint(1e-6).root(lambda z: z - 2 * h * z - 1, jnp.ones(2) / (1 - 2 * h) + 4e-6, h, (2,), carried)
        return found.iterations, found.code, found.carried

    def blind(h):
        return FixedPoint(1e-6).root(lambda z: z - 2 * h * z - 1, jnp.ones(2) / (1 - 2 * h) + 4e-6, h, (2,)).iterations

    assert evaluate(blind, 0.1) == 2
    iterations, code, carried = evaluate(root, 2.0, 0.1)
    assert (iterations, code) == (1, 0) and carried == pytest.approx(AGEING * 2.0, rel=1e-12)
    for expected in (8.0, 1e30):
        iterations, code, carried = evaluate(root, expected, 0.1)
        assert (iterations, code) == (2, 0) and carried == pytest.approx(2.0, rel=1e-6)


def test_what_the_fixed_point_found_last_is_that_at_its_last_iterate():
    """r of that leads to the solution, which is to half of the tolerance then; it has no derivatives."""

    def root(right, finds):
        def residual(z):
            off = z - 0.2 * z - right
            return (off, {"at": z, "twice": 2 * z}) if finds else off

        h, carried = jnp.asarray(0.1), jnp.asarray(2.0)
        return FixedPoint(1e-6, finds=finds).root(residual, right / 0.8 + 1.2e-5, h, (2,), carried)

    right = np.array([1.0, 2.0])
    end, plain = (evaluate(lambda right, finds=finds: root(right, finds), right) for finds in (True, False))
    assert (end.iterations, plain.iterations, plain.found) == (2, 1, ())
    last = end.found["at"]
    np.testing.assert_array_equal(end.found["twice"], 2 * last)
    np.testing.assert_allclose(last - (0.8 * last - right), end.unknowns, rtol=1e-15)
    assert 1e-6 < np.max(np.abs(last - end.unknowns)) < 3e-6
    slope = evaluate(lambda right, along: jax.jvp(lambda x: root(x, True), (right,), (along,))[1], right, right)
    np.testing.assert_allclose(slope.unknowns, right / 0.8, rtol=1e-13)
    assert not np.any(slope.found["at"])


def test_a_guess_is_the_polynomial_through_as_many_steps_as_are_not_wild():
    """Of degree 6 through seven equal steps; of steps back and forth fewer, of which none is wild."""
    times = 0.4 - 0.1 * np.arange(1.0, STEPS + 1)
    for degree in range(STEPS):
        weights = evaluate(_weights, times, np.float64(0.4))
        assert weights @ (times**degree) == pytest.approx(0.4**degree, rel=1e-9)
    for back in ([0.0, 0.1, 0.0, 0.1, 0.05, 0.2, 0.3], [0.0, 0.1, 0.001, 0.101, 0.05, 0.2, 0.25]):
        weights = evaluate(_weights, np.array(back), np.float64(0.3))
        np.testing.assert_allclose(weights, [-2.0, 3.0, *np.zeros(STEPS - 2)], atol=1e-12)


@pytest.mark.long
def test_the_rates_of_steps_leave_a_guess_that_one_iteration_ends():
    """With weights of 127: they are those of the corrected momentum, to round-off of the momentum."""
    fluid = fluids.euler(8)
    start = fluids.start(fluid, fluids.random_vorticity(1, 5))
    method, steps = co.IsospectralMidpoint(), 400
    run = co.trajectory(fluid, start, dt=0.05, steps=steps, method=method)
    assert np.sum(run.iterations) < 1.4 * steps
    rates, z = run.final.memory.rates, np.asarray(run.records.memory.middle)[-2]  # of the last step
    difference = (z - run.records.mu[-2]) / 0.05
    assert 0 < np.max(np.abs(rates[0] - difference)) < 1e-14 * np.max(np.abs(z)) / 0.05


@pytest.mark.long
def test_a_step_is_the_same_with_and_without_what_its_iteration_found():
    """By `advance` of a record alone, and of one that has it, of which the spectrum is kept as well."""
    system, start = system_on(co.Un(4))
    method = co.IsospectralMidpoint(tolerance=1e-6)
    state = path(system, start, 9, method).final

    def both(state):
        guess, rate = method.guess(system, state, H), state.memory.shrinks
        root = method.structure(system).root(lambda z: method.evaluated(system, state, H, z), guess, H, (16,), rate)
        given = method.solved(state, root.found)
        return [method.advance(system, method.record(system, s, H, root.unknowns), H) for s in (state, given)]

    alone, given = evaluate(both, state)
    assert jax.tree.structure(alone) == jax.tree.structure(given) == jax.tree.structure(state)
    assert 0 < np.max(np.abs(alone.mu - given.mu)) < 1e-6
    for end in (alone, given):
        before, after = (np.linalg.eigvalsh(-1j * matrix(co.Un(4), mu)) for mu in (start.mu, end.mu))
        np.testing.assert_allclose(after, before, rtol=0, atol=1e-14)
