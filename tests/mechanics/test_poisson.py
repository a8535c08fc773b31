"""The bracket of section 4: Jacobi's identity, Hamiltonian vector fields, Poisson maps, and Casimir functions."""

from __future__ import annotations

import warnings
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.kernels.run import xla
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import continuous
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.noether import total_momentum
from coadjoint.mechanics.poisson import poisson_bracket, vector_field
from coadjoint.methods.program import Constants, StepProgram
from stepping import Stepper
from systems import GROUPS, MAPS, RULES, WORLDS, generator, pairwise_cases, random_system

FLAT = [world for world in WORLDS if "sphere" not in world and "curved" not in world]
FIELDS = ("mu", "n", "pi", "a")


def functions(state: co.State, count: int, *words: object):
    """Random nonlinear functions of (μ, n, π, a)."""
    random = generator(*words)
    size = sum(np.size(getattr(state, name)) for name in FIELDS)
    made = []
    for _ in range(count):
        w, A = random.normal(size=size) / np.sqrt(size), random.normal(size=(size, size)) / size

        def function(state, w=w, A=A):
            y = jnp.concatenate([getattr(state, name) for name in FIELDS])
            return jnp.sin(w @ y) + 0.5 * y @ A @ y

        made.append(function)
    return made


@pytest.mark.cases(1)
@pytest.mark.parametrize("world", FLAT)
def test_the_bracket_is_antisymmetric_and_satisfies_jacobi(world):
    _, state = random_system(world)
    f, k, l = functions(state, 3, "jacobi", world)

    def values(state):
        cycle = [poisson_bracket(poisson_bracket(x, y), z)(state) for x, y, z in ((f, k, l), (k, l, f), (l, f, k))]
        return jnp.stack(cycle), poisson_bracket(f, k)(state), poisson_bracket(k, f)(state)

    cycle, one, other = evaluate(values, state)
    size = np.sum(np.abs(cycle))
    print(f"{world}: Jacobi {abs(np.sum(cycle)) / size:.1e}, antisymmetry {abs(one + other) / abs(one):.1e}")
    assert size > 1e-3 and abs(one) > 1e-3
    assert abs(np.sum(cycle)) <= 1e-13 * size and abs(one + other) <= 1e-13 * abs(one)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("world", FLAT)
def test_the_vector_field_of_the_energy_is_the_motion(world):
    """X_ℋ is (P20)–(P22)."""
    system, state = random_system(world)

    def both(state):
        return vector_field(partial(continuous.energy, system), state), continuous.vector_field(system, state)

    found, expected = evaluate(both, state)
    for name in FIELDS:
        rate = getattr(expected, name)
        np.testing.assert_allclose(
            getattr(found, name), rate, rtol=0, atol=1e-12 * max(1, np.max(np.abs(rate), initial=0))
        )


def poisson_tensor(state: co.State):
    """{y_i, y_j} of the coordinates y = (μ, n, π, a)."""
    sizes = np.cumsum([np.size(getattr(state, name)) for name in FIELDS])

    def coordinates(state):
        return jnp.concatenate([getattr(state, name) for name in FIELDS])

    def column(w):
        field = vector_field(lambda s: w @ coordinates(s), state)
        return jnp.concatenate(field)

    return jax.vmap(column)(jnp.eye(sizes[-1])).T


CASES = [case for case in pairwise_cases() if case[0] in FLAT]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("world", "tau", "rule"),
    [
        pytest.param(*case, id="-".join(case), marks=() if i % 7 == 0 else pytest.mark.long)
        for i, case in enumerate(CASES)
    ],
)
def test_unforced_steps_are_poisson_maps(world, tau, rule):
    """{f∘Φ, k∘Φ} = {f, k}∘Φ for all f, k at once: DΦ Π DΦᵀ = Π∘Φ."""
    system, state = random_system(world)
    step, _ = RULES[rule](MAPS[tau]).stages[-1]
    program = StepProgram(replace_parameters(system, None), step)  # type: ignore[arg-type]

    def step_on(y, state):
        parts = dict(zip(FIELDS, jnp.split(y, splits), strict=True))
        found = xla.step(program, Constants(system.parameters, None), state.replace(**parts), 0.1, certify=False)
        return jnp.concatenate([getattr(found.after, name) for name in FIELDS]), found

    splits = np.cumsum([np.size(getattr(state, name)) for name in FIELDS])[:-1]
    y = np.concatenate([getattr(state, name) for name in FIELDS])

    def both(y, state):
        slope, moved = jax.jacfwd(step_on, has_aux=True)(y, state)
        return slope @ poisson_tensor(state) @ slope.T, poisson_tensor(moved.after), moved.code

    carried, there, code = evaluate(both, y, state)
    assert code == 0
    size = np.max(np.abs(there))
    print(f"{world}, {tau}, {rule}: {np.max(np.abs(carried - there)) / size:.1e}")
    assert size > 1e-3
    np.testing.assert_allclose(carried, there, rtol=0, atol=1e-12 * size)


@pytest.mark.long
def test_the_bracket_of_a_curved_space_is_refused():
    system, state = random_system("SO3 on a sphere")
    with pytest.raises(ArgumentError, match="flat space"):
        poisson_bracket(partial(continuous.energy, system), lambda s: s.mu[0])(state)


# Powers of (m, a) and coefficients would say less than the formulas of the textbooks.
KNOWN = {
    "SO2": ["m0"],
    "SO3": ["m0^2 + m1^2 + m2^2"],
    "SE2": ["m1^2 + m2^2"],
    "SE3": ["m0 m3 + m1 m4 + m2 m5", "m3^2 + m4^2 + m5^2"],
    "SO3_R3": ["m0 m3 + m1 m4 + m2 m5", "m3^2 + m4^2 + m5^2"],
    "R3": ["m0", "m1", "m2"],
    "SO3xSE2": ["m0^2 + m1^2 + m2^2", "m4^2 + m5^2"],
    "SL2": ["m0^2 + 4 m1 m2"],
    "Heisenberg": ["m2"],
    "SO4": ["m0^2 + m1^2 + m2^2 + m3^2 + m4^2 + m5^2", "m0 m5 − m1 m4 + m2 m3"],
}


def formulas(system: co.System) -> list[str]:
    return [str(casimir) for casimir in co.mechanics.casimirs(system).values()]


@pytest.mark.parametrize("name", KNOWN)
def test_the_casimirs_of_every_group_are_those_of_the_textbooks(name):
    assert formulas(co.System(GROUPS[name], lambda xi: 0.0)) == KNOWN[name]


def symplectic_algebra(n: int) -> list[np.ndarray]:
    """sp(2n): 𝕁S for symmetric S."""
    J = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
    pairs = [(i, j) for i in range(2 * n) for j in range(i, 2 * n)]
    return [
        J @ (np.eye(2 * n)[[i]].T @ np.eye(2 * n)[[j]] + np.eye(2 * n)[[j]].T @ np.eye(2 * n)[[i]]) for i, j in pairs
    ]


def test_a_group_of_the_user_has_its_casimirs_too():
    """sp(4) has one of degree 2 and one of degree 4: tr X² and tr X⁴."""
    found = co.mechanics.casimirs(co.System(co.MatrixGroup(symplectic_algebra(2)), lambda xi: 0.0))
    assert [sum(c.exponents[0]) for c in found.values()] == [2, 4]


def test_the_casimirs_of_the_heavy_top_and_of_its_underwater_relative():
    top = co.System(co.SO3(), lambda xi, a: 0.0, advected=co.Defining())
    assert set(formulas(top)) == {"a0^2 + a1^2 + a2^2", "m0 a0 + m1 a1 + m2 a2"}


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("world", WORLDS)
def test_casimirs_commute_with_everything_and_are_kept_by_every_step(world):
    """{C, k} = 0 for every k, which is ad*_{∂C}μ = 0 where only μ is; steps move (m, a) on coadjoint orbits."""
    system, state = random_system(world)
    found = co.mechanics.casimirs(system)
    assert found
    stepper = Stepper(system, co.Trapezoidal(co.Cayley()))
    after = stepper.final(state, 0.1, 3)
    m = float(np.max(np.abs(evaluate(partial(total_momentum, system), state))))
    tensor = evaluate(poisson_tensor, state) if system.additional.flat else np.zeros((0, 0))
    for name, casimir in found.items():
        values = [float(evaluate(casimir, s)) for s in (state, after)]
        size = 1 + max(m, float(np.max(np.abs(state.a), initial=0.0)), 1.0) ** sum(casimir.exponents[0])
        print(f"{world}: {str(casimir)[:40]} changes by {abs(values[1] - values[0]) / size:.1e}")
        assert abs(values[1] - values[0]) <= 1e-12 * size * len(casimir.exponents), name
        if tensor.size:
            slope = evaluate(jax.grad(lambda s, c=casimir: c(s), allow_int=True), state.replace(t=0.0))
            row = np.concatenate([getattr(slope, field) for field in FIELDS])
            np.testing.assert_allclose(row @ tensor, 0, atol=1e-11 * size * np.max(np.abs(tensor)))


def test_without_forces_alone_casimirs_are_kept():
    """So the test above can fail: a torque moves |μ|²."""
    body = co.System(co.SO3(), lambda xi: xi @ xi, forces=lambda motion: co.Force(torque=-motion.xi))
    start = body.state(xi=[1.0, 2, 3])
    (casimir,) = co.mechanics.casimirs(body).values()
    after = Stepper(body, co.Midpoint(co.Cayley())).final(start, 0.1, 3)
    assert float(evaluate(casimir, after)) < 0.9 * float(evaluate(casimir, start))


def test_the_bracket_refuses_what_is_no_function_on_the_reduced_space():
    """It has no derivative along g, so that {g, k} would be zero and {gn, k} too small."""
    system = co.System(co.SO3(), lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.Defining())
    state = system.state(q=[1, 2, 3], qdot=[0.4, 0.5, 0.6], xi=[0.1, 0.2, 0.3])

    def energy(s):
        return 0.5 * s.mu @ s.mu + 0.5 * s.pi @ s.pi

    for function, name in (
        (lambda s: s.g[0, 1], "g"),
        (lambda s: s.q[0], "g"),
        (lambda s: s.xi[0], "xi"),
        (lambda s: s.nu @ s.pi, "nu"),
    ):
        for pair in ((function, energy), (energy, function)):
            with pytest.raises(ArgumentError, match=f"by mu, n, pi and a, but changes with {name}"):
                co.mechanics.poisson_bracket(*pair)(state)
    with pytest.raises(LagrangianError, match="Poisson bracket must return one number"):
        co.mechanics.poisson_bracket(lambda s: s.mu, energy)(state)
    with pytest.raises(LagrangianError, match="Poisson bracket cannot be differentiated"):
        co.mechanics.poisson_bracket(lambda s: np.sin(s.mu[0]), energy)(state)
    with pytest.raises(ArgumentError, match="must be a function of a state"):
        co.mechanics.poisson_bracket(3, energy)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="must be a state"):
        co.mechanics.poisson_bracket(energy, energy)([0, 0, 1])  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="must be a dictionary of names"):
        system.watching([energy])  # type: ignore[arg-type]


def test_casimirs_that_were_not_looked_for_are_announced():
    """so(6) has invariants of degree 2, 3 and 4; the quartic has too many monomials. so(5) has all of its own."""
    with pytest.warns(UserWarning, match="of degree 4 and more were not looked for"):
        assert len(co.mechanics.casimirs(co.System(co.SOn(6), lambda *_: 0.0))) == 2
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(co.mechanics.casimirs(co.System(co.SOn(5), lambda *_: 0.0))) == 2


def test_traces_of_powers_are_those_of_numpy_and_do_not_change_where_the_group_moves_their_matrices():
    random, group = np.random.default_rng(5), co.groups.SOn(4)
    system = co.System(group, hamiltonian=lambda mu, a: mu @ mu + mu @ a, advected=co.Coadjoint())
    mu, a = random.normal(size=(2, group.dim))
    state = system.state(mu=mu, a0=a)
    found = co.mechanics.trace_casimirs(system, 4)
    assert list(found) == ["trace_a_2", "trace_a_4", "trace_mu_a_2", "trace_mu_a_4"]
    g = evaluate(group.exp, random.normal(size=group.dim))
    moved = state.replace(mu=evaluate(group.Ad_dual, g, mu), a=evaluate(group.Ad_dual, g, a))
    values, after = evaluate(lambda *states: [[f(s) for f in found.values()] for s in states], state, moved)
    W, A = (np.asarray(evaluate(group.hat, x)) for x in (mu, state.a))
    sign = np.sign(values[0] * np.trace(A @ A))
    expected = [np.trace(A @ A), np.trace(A @ A @ A @ A), np.trace(W @ A), np.trace(W @ A @ A @ A)]
    np.testing.assert_allclose(values, [-expected[0], expected[1], -expected[2], expected[3]], rtol=1e-12)
    np.testing.assert_allclose(after, values, rtol=1e-11)
    assert sign == -1 and str(found["trace_mu_a_4"]) == "tr(W Θ^3)" and str(found["trace_a_2"]) == "tr(Θ Θ^1)"
