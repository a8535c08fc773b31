"""Systems given by ℋ: the motion is that of ℓ, steps are symplectic and keep momenta, and what cannot be is refused."""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import LagrangianError
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics import continuous
from coadjoint.mechanics.legendre import Place, quadratic
from coadjoint.mechanics.noether import isotropy_algebra, spatial_momentum
from coadjoint.mechanics.start import legendre
from stepping import Stepper
from systems import MAPS, RULES, WORLDS, flat, generator, pairwise_cases, random_system
from two_form import carry, tangents

H, STEPS = 0.1, 3
ROUND_OFF = 1e-12
CURVED = ("SO3 on a sphere", "curved and flat")


def given_both_ways(world: str) -> tuple[co.System, co.System, co.State, co.State]:
    """ℋ = ½(p − A)·G(p − A) + V and ℓ = ½ z·G⁻¹z + A·z − V, p = (μ, π), with G, A, V functions of n, a."""
    setting = WORLDS[world]
    sample, start = random_system(world)
    group, Q, V = sample.places
    random = generator("hamiltonian", world)
    size, places = group.dim + Q.ambient(group), Q.ambient(group) + V.ambient(group)
    M = random.normal(size=(size, size))
    p = {
        "G": 0.5 * np.eye(size) + 0.2 * M @ M.T / size,
        "pull": 0.3 * random.normal(size=(size, places)),
        "w": random.normal(size=places) / np.sqrt(max(places, 1)),
    }

    def parts(n, a, p):
        y = jnp.concatenate([flat(n), flat(a)])
        return p.G * (1 + 0.3 * jnp.tanh(p.w @ y)), p.pull @ jnp.sin(y), jnp.cos(p.w @ y)

    def spread(x, rest):
        has_q = Q.ambient(group) > 0
        n, y = rest[:2] if has_q else (jnp.zeros(0), jnp.zeros(0))
        a = rest[-2] if V.ambient(group) else jnp.zeros(0)
        return jnp.concatenate([x, flat(y)]), parts(n, a, rest[-1])

    def hamiltonian(mu, *rest):
        momentum, (G, A, potential) = spread(mu, rest)
        return 0.5 * (momentum - A) @ G @ (momentum - A) + potential

    def lagrangian(xi, *rest):
        z, (G, A, potential) = spread(xi, rest)
        return 0.5 * z @ jnp.linalg.solve(G, z) + A @ z - potential

    spaces = {"additional": setting.additional, "advected": setting.advected, "parameters": p}
    by_h, by_l = co.System(group, hamiltonian=hamiltonian, **spaces), co.System(group, lagrangian, **spaces)

    def of(system):
        mu, pi = evaluate(partial(legendre, system), start.xi, start.n, start.nu, start.a)
        return start.replace(mu=mu, pi=pi)

    return by_h, by_l, of(by_h), of(by_l)


FLAT_CASES = [case for case in pairwise_cases() if case[0] not in CURVED]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("world", "tau", "rule"),
    [
        pytest.param(*case, id="-".join(case), marks=() if i % 4 == 0 else pytest.mark.long)
        for i, case in enumerate(FLAT_CASES)
    ],
)
def test_the_hamiltonian_and_its_lagrangian_move_alike_by_every_rule(world, tau, rule):
    by_h, by_l, start_h, start_l = given_both_ways(world)
    method = RULES[rule](MAPS[tau])
    ends = [Stepper(s, method).final(start, H, STEPS) for s, start in ((by_h, start_h), (by_l, start_l))]
    for name in ("n", "a", "mu", "pi", "xi", "nu"):
        found, expected = (getattr(end, name) for end in ends)
        size = max(1.0, np.max(np.abs(expected), initial=0.0))
        np.testing.assert_allclose(found, expected, rtol=0, atol=ROUND_OFF * size, err_msg=name)


def relativistic(mu, a, p):
    """ℋ = Σ √(m² + μ²) + w·a, of which ℓ = −Σ m√(1 − ξ²) − w·a."""
    return jnp.sum(jnp.sqrt(p.m**2 + mu**2)) + p.w @ a


def relativistic_lagrangian(xi, a, p):
    return -jnp.sum(p.m * jnp.sqrt(1 - xi**2)) - p.w @ a


def relativistic_top(**how) -> tuple[co.System, co.State]:
    top = co.System(co.SO3(), advected=co.Defining(), parameters={"m": [1.0, 2, 3], "w": [0.2, 0, 0.3]}, **how)
    return top, top.state(xi=[0.3, 0.9, 0.2], a0=[0, 0.6, 0.8])


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("rule", RULES)
def test_a_hamiltonian_that_is_not_quadratic_moves_as_its_lagrangian(rule):
    """2000 native steps from ξ near 1, the speed that nothing reaches, where μ is large."""
    ends = []
    for how in ({"hamiltonian": relativistic}, {"lagrangian": relativistic_lagrangian}):
        top, start = relativistic_top(**how)
        run = co.simulate(top, start, dt=0.01, steps=2000, save_every=100, method=RULES[rule](co.Cayley()))
        assert run.plan.backend == "native"
        assert run.largest("newton_residual") <= 1e-11 and run.relative_change("kelvin_noether") <= 1e-12
        ends.append(run.final)
    assert np.max(np.abs(ends[0].xi)) > 0.5
    np.testing.assert_allclose(ends[0].mu, ends[1].mu, rtol=0, atol=1e-12)
    np.testing.assert_allclose(ends[0].g, ends[1].g, rtol=0, atol=1e-12)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("rule", ["left", "midpoint", "trapezoidal"])
def test_steps_of_a_hamiltonian_are_symplectic_and_keep_the_momentum(rule):
    """Two tangents through a step: Newton inside and outside is differentiated."""
    top, state = relativistic_top(hamiltonian=relativistic)
    random = generator("relativistic")
    (step, fraction), *_ = RULES[rule](co.Exponential()).stages
    arguments = (state, fraction * H, tangents(top, state, random), tangents(top, state, random))
    _, after, code, (before, end, size) = tabulate(partial(carry, top, step), *arguments)(*arguments)
    assert code == 0 and abs(before) > 1e-4 * size
    assert abs(end - before) <= 2e-13 * size
    directions = isotropy_algebra(top, state)
    first, last = (directions @ evaluate(partial(spatial_momentum, top), s) for s in (state, after))
    assert len(directions) == 1
    np.testing.assert_allclose(last, first, rtol=0, atol=1e-14)


@pytest.mark.long
@pytest.mark.cases(2)
@pytest.mark.parametrize(("rule", "order"), [("right", 1), ("midpoint", 2), ("trapezoidal", 2)])
def test_a_rule_of_a_hamiltonian_has_its_order(rule, order):
    top, start = relativistic_top(hamiltonian=relativistic)
    exact = jax.tree.map(lambda rows: rows[-1], continuous.reference(top, start, [0.0, 1.0]))
    errors = []
    for steps in (80, 160):
        end = co.trajectory(top, start, dt=1 / steps, steps=steps, method=RULES[rule](co.Cayley())).final
        errors.append(np.max(np.abs(end.mu - exact.mu)))
    assert abs(np.log2(errors[0] / errors[1]) - order) <= 0.1


def test_momenta_velocities_and_energy_are_those_of_the_hamiltonian():
    """ξ = ∂_μℋ, ν = ∂_πℋ and E = ℋ by both descriptions (P6–P9)."""
    by_h, by_l, start, other = given_both_ways("SE3")
    np.testing.assert_allclose(start.mu, other.mu, rtol=0, atol=ROUND_OFF * np.max(np.abs(other.mu)))
    for system in (by_h, by_l):
        xi, nu = evaluate(partial(continuous.velocities, system), start)
        np.testing.assert_allclose(xi, start.xi, rtol=0, atol=1e-11)
        np.testing.assert_allclose(nu, start.nu, rtol=0, atol=1e-11)
    found, expected = (float(evaluate(partial(continuous.energy, s), start)) for s in (by_h, by_l))
    assert found == pytest.approx(expected, rel=1e-12)


def test_derivatives_of_the_lagrangian_of_a_hamiltonian_to_third_order():
    """ℓ = −Σ m√(1 − ξ²) − w·a, differentiated three times through Newton's iteration."""
    by_h, start = relativistic_top(hamiltonian=relativistic)
    by_l, _ = relativistic_top(lagrangian=relativistic_lagrangian)

    def third(system):
        def value(xi):
            return system.reduced_lagrangian(xi, start.n, start.nu, start.a)

        return evaluate(jax.jacfwd(jax.hessian(value)), start.xi)

    np.testing.assert_allclose(third(by_h), third(by_l), rtol=1e-10, atol=1e-10)


@pytest.mark.long
def test_on_a_sphere_the_momentum_is_tangent_and_energy_is_kept_at_second_order():
    """A weight on a sphere whose mass differs with height: E is bounded, at half the step four times smaller."""

    def hamiltonian(mu, n, pi, a, p):
        return 0.5 * mu @ (mu / p.J) + 0.5 * pi @ pi / (p.m * (1 + 0.3 * n @ a)) + p.weight * n @ a

    numbers = {"J": [1.0, 2, 3], "m": 0.7, "weight": 2.0}
    spaces = {"additional": co.Sphere(), "advected": co.Defining()}
    body = co.System(co.SO3(), hamiltonian=hamiltonian, parameters=numbers, **spaces)
    start = body.state(q=[0.6, 0, 0.8], qdot=[0.4, 0.9, -0.3], xi=[0.2, 0.5, 0.1], a0=[0, 0, 1])
    np.testing.assert_allclose(start.pi, 0.7 * (1 + 0.3 * 0.8) * np.array([0.4, 0.9, -0.3]), atol=1e-14)
    errors = []
    for steps in (1000, 2000):
        run = co.simulate(body, start, dt=20 / steps, steps=steps, method=co.Midpoint(co.Cayley()))
        assert np.max(np.abs(np.sum(run.records.pi * run.records.n, axis=1))) <= 1e-13
        assert run.relative_change("kelvin_noether") <= 1e-12
        errors.append(run.relative_change("energy"))
    assert 3.6 <= errors[0] / errors[1] <= 4.4 and errors[1] <= 1e-3


def test_a_quadratic_hamiltonian_is_known_as_such():
    """One linear solve is exact then; anything else takes Newton's iteration."""
    body = co.System(co.SO3(), hamiltonian=lambda mu: 0.5 * mu @ jnp.linalg.solve(jnp.diag(jnp.arange(1.0, 4)), mu))
    top, start = relativistic_top(hamiltonian=relativistic)
    none = np.zeros(0)
    with jax.enable_x64(True):
        assert quadratic(Place(body, np.zeros(3), none, none, 0.0, None, None))
        assert not quadratic(Place(top, start.xi, start.n, start.a, 0.0, None, None))


REFUSED = {
    "a momentum that moves nothing": (lambda mu: 0.5 * mu[2] ** 2, "∂²ℋ/∂\\(μ, π\\)² is singular.*along"),
    "a speed that is not reached": (lambda mu: jnp.sqrt(1 + mu @ mu), "none were found"),
    "two numbers": (lambda mu: mu[:2], "The Hamiltonian must return one number"),
    "other arguments": (lambda mu, a: mu @ mu, "The Hamiltonian of this system must take \\(mu\\)"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_refused_in_one_sentence(case):
    hamiltonian, says = REFUSED[case]
    with pytest.raises(LagrangianError, match=says):
        co.System(co.SO3(), hamiltonian=hamiltonian).state(xi=[2.0, 0, 1.0])


def test_a_degenerate_lagrangian_is_refused():
    system = co.System(co.SO2(), lambda xi, n, nu: n @ nu + xi[0] ** 2, additional=co.Trivial(2))
    with pytest.raises(LagrangianError, match="carries no kinetic energy"):
        system.check(system.state(q=[1.0, 2.0]))


def test_one_of_lagrangian_and_hamiltonian():
    with pytest.raises(LagrangianError, match="not by both"):
        co.System(co.SO3(), lambda xi: xi @ xi, hamiltonian=lambda mu: mu @ mu)


@pytest.mark.long
def test_a_hamiltonian_driven_by_inputs_moves_as_its_lagrangian():
    """The Legendre transform carries the whole system as a tree, its inputs included: ℋ = ½μ·μ/J + u μ₁."""

    def hamiltonian(mu, p, *, inputs):
        return 0.5 * mu @ (mu / p.J) + inputs.u * mu[0]

    def lagrangian(xi, p, *, inputs):
        z = xi - inputs.u * jnp.array([1.0, 0, 0])
        return 0.5 * z @ (p.J * z)

    ends, turned = [], []
    both: list[dict[str, Any]] = [{"hamiltonian": hamiltonian}, {"lagrangian": lagrangian}]
    for how in both:
        body = co.System(co.SO3(), parameters={"J": [1.0, 2, 3]}, **how)
        start = body.state(xi=[0.3, 1.0, 0.2], inputs={"u": 0.0})
        run = co.simulate(
            body, start, dt=0.01, steps=200, inputs=lambda motion: {"u": jnp.sin(motion.t)}, monitors=False
        )
        ends.append(run.final.mu)
        turned.append(np.max(np.abs(run.final.mu - start.mu)))
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-13)
    assert min(turned) > 1e-2


def test_momenta_change_with_the_place_as_their_closed_form_says():
    """ℋ = ½ (1 + n²) μ² has μ = ξ/(1 + n²), and ℋ = ½ (1 + n²) μ² + ¼ μ⁴ its root; both along (ξ̇, ṅ)."""
    xi, n, along = np.array([0.7]), np.array([0.5]), (np.array([0.3]), np.array([-0.4]))
    for quartic in (0.0, 1.0):
        system = co.System(
            co.SO2(), hamiltonian=lambda mu, n, pi, k=quartic: 0.5 * (1 + n @ n) * mu @ mu + 0.25 * k * (mu @ mu) ** 2
            + 0.5 * pi @ pi, additional=co.Trivial(1),
        )  # fmt: skip

        def momentum(xi, n, system=system):
            return legendre(system, xi, n, jnp.zeros(1), jnp.zeros(0), 0.0, (), ())[0]

        mu, slope = evaluate(lambda xi, n: jax.jvp(momentum, (xi, n), along), xi, n)
        assert (1 + n @ n) * mu + quartic * mu**3 == pytest.approx(xi)
        assert (1 + n @ n + 3 * quartic * mu**2) * slope == pytest.approx(along[0] - 2 * n * along[1] * mu)
