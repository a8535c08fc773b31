"""The discrete two-form (mathematics: 5), carried through a step with two tangents."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

import coadjoint as co
from coadjoint.kernels.run import xla
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods import Step
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.theory import PhaseVariation, two_form


def carry(system: co.System, step: Step, state: co.State, h, d1: PhaseVariation, d2: PhaseVariation):
    """A step with two tangents through it: record, state after, code, and the two-form before and after."""
    group, Q, V = system.places
    program = StepProgram(replace_parameters(system, None), step)  # type: ignore[arg-type]
    constants = Constants(system.parameters, None)

    def map_(g, n, a, mu, pi):
        moved = xla.step(program, constants, state.replace(g=g, n=n, a=a, mu=mu, pi=pi), h, certify=False)
        after = moved.after
        return (group.matrix(after.g), after.n, after.mu, after.pi), moved

    at = (state.g, state.n, state.a, state.mu, state.pi)

    def through(d: PhaseVariation):
        dg = jax.jvp(lambda f: group.compose(state.g, f), (group.identity(),), (group.tangent(d.eta),))[1]
        dn, da = d.w - Q.infinitesimal(group, d.eta, state.n), -V.infinitesimal(group, d.eta, state.a)
        (g, n, _, _), (dg, dn, dmu, dpi), moved = jax.jvp(map_, at, (dg, dn, da, d.mu, d.pi), has_aux=True)
        eta = group.vee(jnp.linalg.solve(g, dg))
        return PhaseVariation(eta, dn + Q.infinitesimal(group, eta, n), dmu, dpi), moved

    ends, moved = jax.vmap(through, out_axes=(0, None))(jax.tree.map(lambda x, y: jnp.stack([x, y]), d1, d2))
    first, last = (jax.tree.map(lambda x, i=i: x[i], ends) for i in (0, 1))
    before = two_form(system, state, d1, d2)
    after = two_form(system, moved.after, first, last)
    return moved.record, moved.after, moved.code, (before[0], after[0], before[1] + after[1])


def tangents(system: co.System, state: co.State, random: np.random.Generator) -> PhaseVariation:
    """Random ones; on a curved Q, w is tangent to Q and δπ to T*Q: π = Pπ for the projection P at n."""
    Q, group = system.additional, system.group
    w, pi = random.normal(size=(2, Q.ambient(group)))
    eta, mu = random.normal(size=(2, group.dim))

    def along(n, at, eta, w, pi):
        w = Q.project(group, n, w)
        dn = w - Q.infinitesimal(group, eta, n)
        return w, Q.project(group, n, pi) + jax.jvp(lambda x: Q.project(group, x, at), (n,), (dn,))[1]

    w, pi = evaluate(along, state.n, state.pi, eta, w, pi)
    return PhaseVariation(eta, w, mu, pi)
