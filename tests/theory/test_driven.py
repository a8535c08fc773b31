"""Explicit time, forces, inputs and internal states in the discrete theory: one motion with co.simulate."""

from __future__ import annotations

from functools import lru_cache, partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from discrete import at, named_point, velocity
from systems import WORLDS, World, element, flat, generator, point

H, STEPS = 0.1, 20
ROUND_OFF = 2e-13
SAME = 1e-12
"""Of 1 + the largest entry after 20 steps."""

KINDS = {
    "time": {"t"},
    "signals": {"inputs"},
    "held inputs": {"inputs", "forces"},
    "forces": {"forces"},
    "internal": {"internal", "forces"},
    "everything": {"t", "inputs", "internal", "forces", "parameters"},
}
INPUTS = {
    "signals": {"push": co.mechanics.Signal(lambda t: jnp.sin(3 * t))},
    "held inputs": {"push": lambda motion: 0.5 * jnp.sum(motion.xi) + motion.t},
    "everything": {"push": lambda motion: 0.5 * jnp.sum(motion.xi) - motion.t, "pull": co.Linear([0, 9], [0.2, 3])},
}
PLACES = {**WORLDS, "top": World(co.SO3(), None, co.Defining()), "body": World(co.SO3(), co.Defining())}


@lru_cache
def driven(world: str, kind: str):
    """A system in group form with time, inputs, internal state, parameters where `kind` has them, and its start."""
    place, random = PLACES[world], generator("driven", world)
    group, reach = place.group, KINDS[kind]
    bare = co.System(group, lambda *_: 0.0, additional=place.additional, advected=place.advected)
    Q, V = bare.additional, bare.advected
    count = group.dim + Q.ambient(group)
    lean, feel = random.normal(size=count), random.normal(size=Q.ambient(group) + V.ambient(group))

    tuned = "parameters" in reach

    def value(F, *rest, t=0.0, inputs=None, internal=None):
        h = rest[-1]
        rest, gain = ((*rest[:-2], h), rest[-2].gain) if tuned else (rest, 0.2)
        n, s = map(flat, rest[:2]) if Q.ambient(group) else (np.zeros(0), np.zeros(0))
        a = flat(rest[-2]) if V.ambient(group) else np.zeros(0)
        z = jnp.concatenate([velocity(group, F, h), (s - n) / h])
        y = jnp.concatenate([0.5 * (n + s), a])
        extra = jnp.sin(t) + sum(jax.tree.leaves(inputs), 0.0) + sum(jax.tree.leaves(internal), 0.0)
        return h * (z @ z + 0.1 * jnp.sin(lean @ z) - 0.3 * jnp.cos(feel @ y) + gain * extra * (lean @ z))

    names = [name for name in ("t", "inputs", "internal") if name in reach]
    group_lagrangian = theory.unreduced.WithKeywords(value, tuple(names))

    def forces(motion, *p):
        z = jnp.concatenate([motion.xi, flat(motion.nu)])
        held = sum(jax.tree.leaves((motion.inputs, motion.internal)), 0.0)
        total = -(p[0].drag if p else 0.4) * z + 0.3 * jnp.sin(motion.t + z) + 0.2 * held
        return co.Force(total[: group.dim], total[group.dim :])

    def rule(motion, h, *p):
        lag = motion.internal.lag
        return {"lag": lag + h * (jnp.sum(motion.xi) - lag) / (p[0].time if p else 0.7)}

    inner = "internal" in reach
    system = co.System(
        group, group_lagrangian=group_lagrangian, additional=place.additional, advected=place.advected,
        forces=forces if "forces" in reach else None, internal=rule if inner else None,
        parameters={"gain": 0.35, "drag": 0.25, "time": 0.5} if tuned else None,
    )  # fmt: skip
    start = system.state(
        g=element(group, random), q=point(Q, group, random) if Q.ambient(group) else None, t=0.3,
        xi=0.5 * random.normal(size=group.dim), a0=point(V, group, random) if V.ambient(group) else None,
        internal={"lag": 0.4} if inner else None,
    )  # fmt: skip
    return system, start


@lru_cache
def run_of(world: str, kind: str):
    system, start = driven(world, kind)
    method = co.methods.GroupVariational(co.Exponential(), "velocity")
    run = co.simulate(system, start, dt=H, steps=STEPS, method=method, inputs=INPUTS.get(kind), monitors=False)
    a0 = evaluate(lambda s: system.advected.act(system.group, s.g, s.a), start)
    path = theory.Configuration(run.records.g, run.records.q)
    steps = at(theory.instants(run.records), slice(None, -1))
    return run, path, named_point(system, a0) if len(a0) else None, steps


def close(found, expected, within=SAME):
    for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(x, y, rtol=0, atol=within * (1 + np.max(np.abs(y), initial=0.0)))


EVERY = [("top" if i % 2 else "body", kind) for i, kind in enumerate(KINDS)]
EVERY += [(world, "everything") for world in ("SO3", "SE2", "SO3 on a sphere")]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("world", "kind"), EVERY)
def test_the_reduced_algorithm_gives_the_driven_motion(world, kind):
    """(P42)–(P44) with Lagrange–d'Alembert forces; time, inputs and internal state go on from the first link."""
    run, path, a0, steps = run_of(world, kind)
    links = theory.reduced_path(run.system.places, path, a0, steps)
    found = theory.discrete_euler_poincare_algorithm(run.system, at(links, 0), H, STEPS)
    close(found, links)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("world", "kind"), EVERY)
def test_the_unreduced_algorithm_gives_the_driven_motion(world, kind):
    """(B8) with g_k·φ⁻ and T⁻ in the space frame."""
    run, path, a0, steps = run_of(world, kind)
    L = theory.unreduce(run.system)
    found = theory.discrete_euler_lagrange_algorithm(L, at(path, 0), at(path, 1), a0, H, STEPS, at(steps, 0))
    close(found, path)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", KINDS)
def test_the_algorithm_of_the_semidirect_product_gives_the_driven_motion(kind):
    """(B13) with forces, on SO(3) Ⓢ ℝ³."""
    run, path, _, steps = run_of("body", kind)
    group, Q, _ = run.system.places
    links = evaluate(
        jax.vmap(lambda link: theory.semidirect_link(group, Q, link)),
        theory.reduced_path(run.system.places, path, None, steps),
    )
    l = theory.semidirect_lagrangian(run.system)
    close(theory.semidirect_algorithm(group, Q, l, at(links, 0), H, STEPS), links)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("parameter", ["left", "right"])
@pytest.mark.parametrize("kind", KINDS)
def test_euler_poincare_poisson_gives_the_driven_motion_and_kelvin_noether_its_change(kind, parameter):
    """(B19) with T⁻; (B25) with the work of T⁻."""
    run, path, a0, steps = run_of("top", kind)
    group = run.system.group
    links = evaluate(
        jax.vmap(lambda link: theory.poisson_link(group, link)),
        theory.reduced_path(run.system.places, path, a0, steps),
    )
    l = theory.poisson_lagrangian(run.system, parameter)
    close(theory.poisson_algorithm(l, at(links, 0), H, STEPS), links)
    K = np.swapaxes(path.g[1:-1], 1, 2) @ np.array([0.3, -0.5, 0.8])
    pairs = at(links, slice(None, -1)), at(links, slice(1, None))
    quantity, change = evaluate(jax.vmap(lambda b, n, K: theory.kelvin_noether_poisson(l, b, n, K, H)), *pairs, K)
    np.testing.assert_allclose(np.diff(quantity), change[:-1], rtol=0, atol=1e-13 * np.max(np.abs(quantity)))


@pytest.mark.cases(1)
@pytest.mark.parametrize(("world", "kind"), EVERY)
def test_the_printed_equations_hold_on_driven_runs(world, kind):
    found = theory.printed_equations(run_of(world, kind)[0])
    assert found.worst.largest < ROUND_OFF, str(found)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("kind", "given", "says"),
    [
        ("time", theory.Instant(), "depend on when they start"),
        ("signals", theory.Instant(0.3), "takes inputs"),
        ("held inputs", theory.Instant(0.3), "held over"),
        ("forces", theory.Instant(), "depend on when they start"),
        ("internal", theory.Instant(0.3), "has an internal state"),
    ],
)
@pytest.mark.parametrize("world", ["body", "top"])
def test_a_step_that_does_not_say_when_it_starts_and_what_is_held_is_refused(world, kind, given, says):
    """Every function of a step, in the sentence that names theory.Instant."""
    for call in calls(world, kind, given):
        with pytest.raises(co.errors.ArgumentError, match=says):
            call()


def calls(world, kind, given):
    """Every function of a step of a driven system, with steps that have another instant."""
    held = kind == "held inputs"
    system = driven(world, kind)[0].driven(INPUTS[kind] if held else None)
    _, path, a0, _ = run_of(world, kind)
    links = theory.reduced_path(system.places, at(path, slice(3)), a0)
    one, two = (at(links, k)._replace(at=given) for k in (0, 1))
    L, ends = theory.unreduce(system), [at(path, k) for k in (0, 1, 2)]
    group, Q, _ = system.places
    if world == "top":
        l = theory.poisson_lagrangian(system)
        pair = [theory.poisson_link(group, link) for link in (one, two)]
        more = [
            partial(theory.discrete_euler_poincare_poisson, l, *pair, H),
            partial(theory.poisson_algorithm, l, pair[0], H, 3),
            partial(theory.kelvin_noether_poisson, l, *pair, np.ones(3), H),
        ]
    else:
        l = theory.semidirect_lagrangian(system)
        pair = [theory.semidirect_link(group, Q, link) for link in (one, two)]
        more = [
            partial(theory.discrete_euler_poincare_semidirect, group, Q, l, *pair, H),
            partial(theory.semidirect_algorithm, group, Q, l, pair[0], H, 3),
        ]
    return [
        partial(theory.left_momenta, system, one, H),
        partial(theory.right_momenta, system, one, H),
        partial(theory.discrete_euler_poincare, system, one, two, H),
        partial(theory.discrete_euler_poincare_algorithm, system, one, H, 3),
        partial(theory.reduced_action, system, jax.tree.map(lambda x: np.asarray(x)[None], one), H),
        partial(theory.discrete_euler_lagrange, L, *ends, np.zeros(3) if a0 is None else a0, H, (given, given)),
        partial(theory.discrete_euler_lagrange_algorithm, L, *ends[:2], a0, H, 3, given),
        *more,
    ]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("world", ["SO3", "SO3 on a sphere"])
def test_actions_and_their_variations_agree_on_driven_systems(world):
    """(P41), (P48): ΣL = ΣΛ at the instants of a run, and their derivatives along a variation of the nodes."""
    run, path, a0, steps = run_of(world, "everything")
    system, L = run.system, theory.unreduce(run.system)
    group, Q, V = system.places
    a0 = V.point(group, a0, "a0")
    eta, w = generator("driven variation", world).normal(size=(2, STEPS + 1, max(group.dim, Q.ambient(group))))
    eta, w = eta[:, : group.dim], w[:, : Q.ambient(group)]

    def values(path, steps):
        n = jax.vmap(lambda g, q: Q.act(group, group.inverse(g), q))(path.g, path.q)
        body = jax.vmap(lambda n, w: Q.project(group, n, w))(n, w)
        dg = jax.vmap(theory.space_velocity, in_axes=(None, 0, 0))(group, path.g, eta)
        dq = jax.vmap(lambda g, n, w: Q.push(group, g, n, w))(path.g, n, body)
        first = jax.jvp(lambda p: theory.action(L, p, a0, H, steps), (path,), (theory.Configuration(dg, dq),))
        pairs = at(path, slice(None, -1)), at(path, slice(1, None))
        links = jax.vmap(lambda x, y, i: theory.link_of(system.places, x, y, a0, i))(*pairs, steps)
        change = jax.vmap(lambda link, *v: theory.induced_variation(system, link, theory.Variation(*v)))(
            links, eta[:-1], body[:-1], eta[1:], body[1:]
        )
        return first, jax.jvp(lambda p: theory.reduced_action(system, p, H), (links,), (change,))

    unreduced, reduced = evaluate(values, path, steps)
    np.testing.assert_allclose(reduced, unreduced, rtol=1e-12)
