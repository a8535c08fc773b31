"""The discrete Lagrange–Poincaré equations on random systems (Theorem 6.1, B35–B36)."""

from __future__ import annotations

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from bundles import (
    SIZE,
    apart,
    generator,
    largest,
    random_connection,
    random_motion,
    random_system,
    turned_connection,
    turned_start,
    turned_system,
)
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.bundle import reduced
from coadjoint.theory.principal_bundles import ReducedLagrangian
from stepping import Stepper
from systems import GROUPS, RULES

H = 0.1
CASES = [
    ("SO2", "midpoint"),
    ("SO3", "left"),
    ("SO3", "midpoint"),
    ("SE2", "trapezoidal"),
    ("SL2", "right"),
    ("Heisenberg", "midpoint"),
]
TRIVIAL = co.mechanics.DiscreteConnection(co.SO2(), 1, lambda x, x_next: jnp.eye(2))


@cache
def motion(name: str, rule: str):
    """The unreduced motion: elements, shapes and the momenta of a few steps."""
    system, start = random_system(name)
    leaps = Stepper(system, RULES[rule](co.Cayley())).run(start, H, 5)
    states = [leaps[0].record, *(leap.after for leap in leaps)]
    return jax.tree.map(lambda *rows: np.stack(rows), *((state.g, state.n, state.mu) for state in states))


# A step of the reduced algorithm is traced for each case, which takes seconds.
QUICK = [("SO3", "midpoint"), ("SE2", "trapezoidal"), ("SL2", "right")]
SOME = [case if case in QUICK else pytest.param(*case, marks=pytest.mark.long) for case in CASES]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("name", "rule"), SOME)
def test_the_reduced_algorithm_gives_the_unreduced_motion_whatever_the_connection(name, rule):
    system, start = random_system(name)
    g, x, _ = motion(name, rule)
    for index in range(2):
        found = co.theory.lagrange_poincare(
            system, start, dt=H, steps=5, method=RULES[rule](co.Cayley()), connection=random_connection(name, index)
        )
        error = max(apart(found.g, g), apart(found.x, x))
        print(f"{name} {rule} Ω{index}: {error:.1e}")
        assert error <= 2e-13 * max(1.0, largest(g))
        assert apart(found.sigma, reduced(random_connection(name, index), g, x)) <= 2e-12
        assert np.max(np.abs(found.time - start.t - H * np.arange(6))) <= 1e-15


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("name", "rule"), [CASES[0], *(pytest.param(*case, marks=pytest.mark.long) for case in CASES[1:])]
)
def test_the_residual_vanishes_on_the_motion_and_nowhere_near_it(name, rule):
    system, start = random_system(name)
    g, x, mu = motion(name, rule)
    arguments = {"dt": H, "method": RULES[rule](co.Cayley()), "connection": random_connection(name)}
    scale = np.max(np.abs(mu)) + 1.0
    x = x.copy()
    x[-1] += 1e-6 * generator("perturbed", name).normal(size=SIZE)  # an end of the last inner node's steps alone
    residual = co.theory.lagrange_poincare_residual(system, start, g=g, x=x, **arguments)
    assert residual.shape == (4, GROUPS[name].dim + SIZE)
    print(f"{name} {rule}: {np.max(np.abs(residual[:-1])) / scale:.1e}")
    assert np.max(np.abs(residual[:-1])) <= 2e-13 * scale < 1e-8 < np.max(np.abs(residual[-1]))


@pytest.mark.long
def test_with_the_trivial_connection_they_are_the_equations_of_the_core():
    """Ω = e, the paper's last remark: σ = F⁻¹, Ad*_{F⁻¹}D^R_σ l = −μ_k."""
    system, start = random_system("SO3")
    e = co.mechanics.DiscreteConnection(co.SO3(), SIZE, lambda x, x_next: jnp.eye(3))
    found = co.theory.lagrange_poincare(system, start, dt=H, steps=5, method=co.Midpoint(co.Cayley()), connection=e)
    g, _, _ = motion("SO3", "midpoint")
    assert apart(found.g, g) <= 2e-13
    assert apart(found.sigma, np.swapaxes(g[1:], 1, 2) @ g[:-1]) <= 2e-13


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("name", "rule"), [("SO3", "midpoint"), ("SE2", "left"), ("SL2", "trapezoidal")])
def test_the_first_variation_of_the_action_is_the_residual_on_any_sequence(name, rule):
    """Theorem 6.1, 1 ⇔ 3 ⇔ 4: with g_ε = g e^{εη}, x_ε = x + εδx and fixed ends,

    d/dε Σ Λ(g_k⁻¹g_{k+1}, x_k, x_{k+1}) = Σ ⟨(B35)_k, η_k⟩ + ⟨(B36)_k, δx_k⟩.
    """
    system, start = random_system(name)
    group, method, steps = GROUPS[name], RULES[rule](co.Cayley()), 4
    connection = random_connection(name)
    g, x = random_motion(name, steps, scale=0.1)
    eta, dx = generator("variation", name).normal(size=(2, steps - 1, max(group.dim, SIZE)))
    eta, dx = eta[:, : group.dim], dx[:, :SIZE]
    l = ReducedLagrangian(system, method, connection, H)

    def action(epsilon):
        """The action of the varied motion, with ξ found from F by Newton's method."""
        total, here = 0.0, []
        for k in range(steps + 1):
            at, shape = jax.tree.map(lambda leaf, k=k: jnp.asarray(leaf)[k], g), x[k]
            if 0 < k < steps:
                at = group.compose(at, co.Cayley().tau(group, epsilon * eta[k - 1]))
                shape = shape + epsilon * dx[k - 1]
            here.append((at, shape))
        for k in range(steps):
            (g0, x0), (g1, x1) = here[k], here[k + 1]
            F = group.compose(group.inverse(g0), g1)
            sigma = group.compose(group.inverse(F), connection.increment(x0, x1))
            now = start.replace(t=start.t + k * H, n=x0)
            unknowns = jnp.concatenate([l.velocity(now, x0, sigma, x1), (x1 - x0) / H])
            total = total + method.discrete_lagrangian(system, method.record(system, now, H, unknowns), H)
        return total

    slope = evaluate(jax.grad(action), 0.0)
    residual = co.theory.lagrange_poincare_residual(system, start, dt=H, method=method, connection=connection, g=g, x=x)
    expected = np.sum(residual[:, group.dim :] * dx) + np.sum(residual[:, : group.dim] * eta)
    print(name, rule, slope, expected)
    assert abs(slope - expected) <= 1e-12 * max(1.0, np.max(np.abs(residual)))


@cache
def driven(name: str) -> tuple[co.System, co.State]:
    """ℓ and forces that see time, a signal, an input that is held over each step, and an internal state."""
    plain, _ = random_system(name)
    group = plain.group

    def lagrangian(xi, x, v, *, t, inputs, internal):
        extra = jnp.sin(t) + inputs.push + inputs.pull + internal.lag
        return plain.reduced_lagrangian(xi, x, v, np.zeros(0)) + 0.2 * extra * (jnp.sum(xi) + v[0])

    def forces(motion):
        extra = jnp.cos(motion.t) + motion.inputs.push - motion.inputs.pull + motion.internal.lag
        return co.Force(0.3 * extra - 0.5 * motion.xi, 0.2 * extra * jnp.sin(motion.n) - 0.3 * motion.nu)

    def rule(motion, h):
        return {"lag": motion.internal.lag + h * (motion.xi[0] - motion.internal.lag)}

    system = co.System(group, lagrangian, additional=co.Trivial(SIZE), forces=forces, internal=rule)
    random = generator("driven", name)
    start = system.state(
        xi=0.5 * random.normal(size=group.dim), q=0.5 * random.normal(size=SIZE), qdot=random.normal(size=SIZE), t=0.4,
        inputs={"push": 0.0, "pull": 0.0}, internal={"lag": 0.3},
    )  # fmt: skip
    return system, start


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "rule"), [pytest.param("SE2", "trapezoidal", marks=pytest.mark.long), ("SO3", "midpoint")]
)
def test_forces_time_inputs_and_internal_states_give_the_driven_motion(name, rule):
    """Lagrange–d'Alembert–Poincaré: (B35), (B36) with (T∓, φ∓), whatever the connection, against co.simulate."""
    system, start = driven(name)
    inputs = {
        "push": co.mechanics.Signal(lambda t: jnp.sin(2 * t)),
        "pull": lambda motion: 0.5 * motion.xi[0] + motion.t,
    }
    method, connection = RULES[rule](co.Cayley()), random_connection(name)
    run = co.simulate(system, start, dt=H, steps=5, method=method, inputs=inputs, monitors=False)
    g, x, given = run.records.g, run.records.n, {"dt": H, "method": method, "connection": connection}
    found = co.theory.lagrange_poincare(run.system, start, steps=5, **given)
    assert max(apart(found.g, g), apart(found.x, x)) <= 2e-13 * max(1.0, largest(g))
    scale = np.max(np.abs(run.records.mu)) + 1.0
    residual = co.theory.lagrange_poincare_residual(run.system, start, g=g, x=x, **given)
    assert np.max(np.abs(residual)) <= 2e-13 * scale
    still = co.theory.lagrange_poincare_residual(run.system.unforced, start, g=g, x=x, **given)
    assert np.min(np.max(np.abs(still), axis=1)) > 1e-3, "forces that do nothing prove nothing"


def push(motion) -> co.Force:
    """Of the velocities, on the group, on a direction and on a vector that turns."""
    n, nu = motion.n, motion.nu
    pull = {"direction": jnp.cross(n.direction, motion.a) - 0.3 * nu.direction, "place": 0.4 * jnp.sin(n.place)}
    return co.Force(torque=0.3 * motion.a - 0.5 * motion.xi, force=pull)


@pytest.mark.long
@pytest.mark.cases(2)
@pytest.mark.parametrize("rule", ["left", "right", "midpoint", "trapezoidal"])
def test_curved_shapes_vectors_that_turn_and_advected_parameters_give_the_driven_motion(rule):
    """The bundle G × Q → Q with Q = S² × ℝ³, on which G turns ℝ³, under forces, whatever the connection."""
    (system, _), start = turned_system(forces=push), turned_start(forces=push)
    method = RULES[rule](co.Cayley())
    run = co.simulate(system, start, dt=H, steps=5, method=method, monitors=False)
    for index in range(2):
        given = {"dt": H, "method": method, "connection": turned_connection(index)}
        found = co.theory.lagrange_poincare(system, start, steps=5, **given)
        assert max(apart(found.g, run.records.g), apart(found.x, run.records.n)) <= 2e-13
        residual = co.theory.lagrange_poincare_residual(system, start, g=run.records.g, x=run.records.n, **given)
        assert residual.shape == (4, 8) and np.max(np.abs(residual)) <= 2e-13 * (np.max(np.abs(run.records.mu)) + 1)


@pytest.mark.long
def test_the_discrete_mechanical_connection_does_not_see_forces():
    system, _ = driven("SO2")
    free = co.System(
        co.SO2(), lambda xi, x, v: xi @ xi + v @ v + xi[0] * v[0] * jnp.cos(x[0]), additional=co.Trivial(1)
    )
    pushed = co.System(
        co.SO2(), free.lagrangian, additional=co.Trivial(1), forces=lambda motion: co.Force([3.0], [2.0])
    )
    both = [co.theory.discrete_mechanical_connection(s, co.Midpoint(), H)([0.3], [0.5]) for s in (free, pushed)]
    assert apart(*both) == 0.0
    with pytest.raises(co.errors.ArgumentError, match="alone, but this one takes `t`"):
        co.theory.discrete_mechanical_connection(system, co.Midpoint(), H)


def test_what_does_not_fit_is_refused_in_one_sentence():
    system, start = random_system("SO3")
    good = {"dt": H, "steps": 2, "method": co.Midpoint(), "connection": random_connection("SO3")}
    for change, says in (
        ({"connection": random_connection("SE2")}, "The connection is on SE2() with 2 shape coordinates"),
        ({"connection": None}, "must be a co.mechanics.DiscreteConnection"),
        ({"dt": -0.1}, "must be a positive number"),
        ({"steps": 0}, "`steps` must be a whole number from 1"),
        ({"method": co.methods.LeftRight()}, "needs a variational rule of one stage"),
        ({"method": None}, "must be a method such as co.Midpoint()"),
    ):
        with pytest.raises(co.errors.ArgumentError, match=says.replace("(", "\\(").replace(")", "\\)")):
            co.theory.lagrange_poincare(system, start, **{**good, **change})


@pytest.mark.long
def test_a_step_that_has_no_solution_says_so():
    """Midpoint steps of ẍ = eˣ from rest at x = 0: v = ½h exp(½hv) has no root at h = 2."""
    system = co.System(co.SO2(), lambda xi, x, v: 0.5 * (xi @ xi + v @ v) + jnp.exp(x[0]), additional=co.Trivial(1))
    with pytest.raises(co.errors.StepError, match="no solution at step 0, t = 0 s, that"):
        co.theory.lagrange_poincare(
            system, system.state(q=[0.0]), dt=2.0, steps=3, method=co.Midpoint(), connection=TRIVIAL
        )
