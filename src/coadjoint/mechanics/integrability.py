"""Frobenius' theorem: whether rows on the velocities hold a function of the place."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.jumping_inputs import jumping_velocities
from coadjoint.mechanics.reactions import site
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.mechanics.state import State


def warnings_of_rows(system: ReducedFunctions, state: State) -> list[str]:
    """Sentences about rows on velocities that are integrable, or jump with an input."""
    if not system.constraints:
        return []
    found = jumping_velocities(system, state)
    held = [one for one in system.constraints if not one.holonomic]
    if held and not any(one.moving for one in held) and _integrable(system, state):
        names = " and ".join(f"`{one.name}`" for one in held)
        found.append(
            f"The rows of {names} are integrable (Frobenius): they hold a function of the place, which co.Holonomic "
            "would keep to round-off."
        )
    return found


def _integrable(system: ReducedFunctions, state: State) -> bool:
    """Whether A·[X, Y] vanishes for all fields X, Y with A·X = A·Y = 0, at random places."""
    group, Q, _ = system.places
    random = np.random.default_rng(1877)
    wrong = evaluate(
        lambda etas, shifts, s, p: jax.vmap(lambda e, w: _curvature(replace_parameters(system, p), s, e, w))(
            etas, shifts
        ),
        random.normal(scale=0.7, size=(3, group.dim)),
        random.normal(size=(3, Q.ambient(group))),
        state,
        system.parameters,
    )
    return bool(np.max(np.abs(wrong)) <= 1e-9)


def _curvature(system: ReducedFunctions, state: State, eta: Array, shift: Array) -> Array:
    """A·[X_i, X_j] of the fields X_i = (1 − A⁺A)e_i at a place off the state's, relative to A."""
    group, Q, V = system.places
    back = group.inverse(group.exp(eta))
    n, a = Q.act(group, back, state.n), V.act(group, back, state.a)
    n = n + shift * (1 + jnp.max(jnp.abs(n), initial=0.0)) if Q.flat else n
    at, dim = site(state)._replace(n=n, a=a), group.dim

    def rows(n: Array, a: Array) -> Array:
        found = jnp.concatenate(
            [one.rows(system, at._replace(n=n, a=a))[0] for one in system.constraints if not one.holonomic]
        )
        tangent = jax.vmap(lambda row: Q.project(group, n, row[dim:]))(found)
        found = jnp.concatenate([found[:, :dim], tangent], axis=1)
        return found / jnp.linalg.norm(found, axis=1, keepdims=True)

    def fields(n: Array, a: Array) -> Array:
        A = rows(n, a)
        return jnp.eye(A.shape[1]) - A.T @ jnp.linalg.solve(A @ A.T + 1e-14 * jnp.trace(A @ A.T) * jnp.eye(len(A)), A)

    kernel = fields(n, a)
    along = jax.vmap(
        lambda x: jax.jvp(
            fields,
            (n, a),
            (x[dim:] - Q.infinitesimal(group, x[:dim], n), -V.infinitesimal(group, x[:dim], a)),
        )[1]
    )(kernel.T)  # (i, component, j): D_{X_i} X_j
    along = jnp.swapaxes(along, 1, 2)

    def constant(x: Array, y: Array) -> Array:
        turned = Q.lifted(group, x[:dim], n, y[dim:]) - Q.lifted(group, y[:dim], n, x[dim:])
        return jnp.concatenate([group.ad(x[:dim], y[:dim]), turned])

    own = jax.vmap(lambda x: jax.vmap(lambda y: constant(x, y))(kernel.T))(kernel.T)
    return (along - jnp.swapaxes(along, 0, 1) + own) @ rows(n, a).T
