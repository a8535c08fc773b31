"""Phase-space Lagrangians, ℓ = ⟨ϑ(n, a), (ξ, ν)⟩ − H(n, a): linear in the velocities, so that their equations are of
first order, ω (ξ, ν) = ∇H − f with ω = dϑ (mathematics: P20–P22 with μ, π = ϑ)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.jaxprs import depends
from coadjoint.mechanics.copies import replace_parameters, replaced
from coadjoint.mechanics.coupling import jacobian_solve
from coadjoint.mechanics.reduced_functions import ReducedFunctions, added
from coadjoint.mechanics.state import State

SINGULAR = 1e-12
"""The smallest singular value of the scaled two-form that round-off cannot explain."""

GIVEN = 1e-6
"""Up to which relative difference velocities and momenta of a start count as those of its place."""


class FirstOrder(NamedTuple):
    """(ξ, ν) of a place, and the residual of (μ, π) = ϑ(n, a), relative to ϑ and its change along n.

    xi: (dim G,). nu: (ambient,). residual: one number.
    """

    xi: Array
    nu: Array
    residual: Array


def linear(system: ReducedFunctions, state: State) -> bool:
    """Whether ∂ℓ/∂(ξ, ν), as traced, is independent of (ξ, ν)."""
    if system.lagrangian is None:
        return False

    def momenta(velocities: tuple[Array, Array]) -> tuple[Array, Array]:
        xi, nu = velocities
        return system.momenta(xi, state.n, nu, state.a, state.t, state.inputs, state.internal)

    return not any(depends(momenta, (np.zeros(np.shape(state.xi)), np.zeros(np.shape(state.nu)))))


def _theta(system: ReducedFunctions, state: State, n: Array, a: Array, t: Scalar) -> Array:
    """ϑ(n, a) = (∂_ξℓ, ∂_νℓ), (dim G + ambient,)."""
    still = jnp.zeros_like(state.xi), jnp.zeros_like(state.nu)
    return jnp.concatenate(system.momenta(still[0], n, still[1], a, t, state.inputs, state.internal))


def mismatch(system: ReducedFunctions, state: State) -> Callable[[Array], Array]:
    """z = (ξ, ν) ↦ dϑ/dt − (ad*_ξμ + ∂_aℓ⋄a + ∂_nℓ⋄n + π⋄ν + T, ∂_nℓ + L*_ξπ + f), both (dim G + dim Q,), on a flat Q.

    Affine, with the two-form ω as matrix, unless forces depend on velocities otherwise.
    """
    group, Q, V = system.places
    n, a, t, held = state.n, state.a, state.t, (state.inputs, state.internal)

    def equations(z: Array) -> Array:
        xi, nu = z[: group.dim], z[group.dim :]
        along = jax.grad(system.reduced_lagrangian, argnums=(0, 1, 2, 3))(xi, n, nu, a, t, *held)
        mu, along_n, pi, along_a = along
        torque, force = added(system, system.body_forces(system.motion(xi, n, nu, a, t, *held, (mu, pi))))
        turning = V.diamond(group, along_a, a) + Q.diamond(group, along_n, n) + Q.lifted_diamond(group, pi, n, nu)
        carried = jax.vjp(lambda w: Q.lifted(group, xi, n, w), jnp.zeros_like(n))[1](pi)[0]
        moving = nu - Q.infinitesimal(group, xi, n), -V.infinitesimal(group, xi, a), jnp.ones_like(t)
        drift = jax.jvp(lambda n, a, t: _theta(system, state, n, a, t), (n, a, jnp.asarray(t)), moving)[1]
        rates = group.ad_dual(xi, mu) + turning + torque, along_n + carried + force
        return drift - jnp.concatenate(rates)

    return equations


def two_form(system: ReducedFunctions, state: State) -> Array:
    """The matrix of `mismatch`, (dim G + dim Q, dim G + dim Q)."""
    return jax.jacfwd(mismatch(system, state))(jnp.concatenate([jnp.zeros_like(state.xi), jnp.zeros_like(state.nu)]))


def velocities(system: ReducedFunctions, state: State) -> FirstOrder:
    """(ξ, ν) with ω (ξ, ν) = ∇H − f at the place of the state, on a flat Q: one linear solve."""
    equations, rest = mismatch(system, state), jnp.concatenate([jnp.zeros_like(state.xi), jnp.zeros_like(state.nu)])
    z = -jacobian_solve(system.places, equations, rest, equations(rest))
    theta, change = jax.jvp(lambda n: _theta(system, state, n, state.a, state.t), (state.n,), (state.n,))
    size = jnp.max(jnp.abs(theta) + jnp.abs(change), initial=0.0)
    error = jnp.max(jnp.abs(theta - jnp.concatenate([state.mu, state.pi])), initial=0.0)
    return FirstOrder(z[: system.group.dim], z[system.group.dim :], error / jnp.where(size > 0, size, 1.0))


class Survey(NamedTuple):
    """ω of a place, with forces and without them, and the velocities of the place.

    form, bare: (dim G + dim Q, dim G + dim Q). velocities: see there.
    """

    form: Array
    bare: Array
    velocities: FirstOrder


def surveyed(system: ReducedFunctions, state: State) -> Survey:
    """The two-forms and the velocities at the place of a state."""
    form = two_form(system, state)
    bare = form if system.forces is None else two_form(replaced(system, forces=None), state)
    return Survey(form, bare, velocities(system, state))


def accelerations(system: ReducedFunctions, state: State, n_dot: Array, a_dot: Array) -> Array:
    """(ξ̇, ν̇), (dim G + dim Q,), of `velocities` along ṅ (ambient,) and ȧ (dim V*,)."""

    def at(n: Array, a: Array, t: Array) -> Array:
        return jnp.concatenate(velocities(system, state.replace(n=n, a=a, t=t))[:2])

    return jax.jvp(at, (state.n, state.a, jnp.asarray(state.t)), (n_dot, a_dot, jnp.ones_like(state.t)))[1]


def require_singular_apart(system: ReducedFunctions, state: State) -> None:
    """Raise LagrangianError where ℓ is linear in the velocities, which a method for other ℓ was given."""
    if linear(system, state):
        raise LagrangianError(
            "The Legendre transform must be regular, but this Lagrangian is degenerate, linear in the velocities: "
            "integrate it with method=co.methods.ProjectedMidpoint(), or co.Suzuki4(co.methods.ProjectedMidpoint())."
        )


def require_first_order(system: ReducedFunctions, start: State) -> list[str]:
    """Raise unless the velocities of a linear ℓ follow from its place, and those of the start are these; no warnings.

    Other Lagrangians pass.
    """
    Q = system.additional
    if not Q.flat or not linear(system, start):
        return []
    equations, rest = mismatch(system, start), np.zeros(len(start.xi) + len(start.nu))
    if any(depends(jax.jacfwd(equations), rest)):
        raise LagrangianError(
            "Forces on a Lagrangian that is linear in the velocities must be affine in them, so that the velocities "
            "follow from the place: leave out drag that is quadratic."
        )
    if any(depends(lambda held: _theta(system, start.replace(inputs=held[0], internal=held[1]), start.n, start.a,
                                       start.t), (start.inputs, start.internal))):  # fmt: skip
        raise LagrangianError(
            "The momenta ϑ of a Lagrangian that is linear in the velocities must not depend on `inputs` or `internal`, "
            "which jump from step to step: let H or forces read them."
        )
    _require_own(jax.tree.map(lambda leaf: leaf[None], evaluate(lambda state: surveyed(system, state), start)), start)
    return []


def require_members(system: ReducedFunctions, parameters: PyTree, axes: PyTree, starts: State) -> None:
    """`require_first_order` of all members, of which the first has been checked.

    parameters: a tree with an axis of members where `axes`, a tree like it, is 0. starts: one, or (members, …) each.
    """

    def survey(parameters: PyTree, state: State) -> Survey:
        return surveyed(replace_parameters(system, parameters), state)

    many = 0 if np.ndim(starts.t) else None
    _require_own(evaluate(jax.vmap(survey, in_axes=(axes, many)), parameters, starts), starts)


def require_momenta(found: FirstOrder, whose: str = "a start") -> None:
    """Raise ArgumentError where momenta are not those of their place; found: (members, …) each."""
    off = np.max(found.residual)
    if not off <= GIVEN:
        raise ArgumentError(
            f"The momenta of {whose} must be those of its place, ϑ(n, a), because the Lagrangian is linear in the "
            f"velocities, but differ from them by {off:.1e}: give the place alone."
        )


def _require_own(found: Survey, starts: State) -> None:
    """Raise where ω is singular, or velocities or momenta are not those of the place; found: (members, …) each."""
    _require_two_form(np.asarray(found.form), np.asarray(found.bare))
    if not starts.from_velocities:
        require_momenta(found.velocities)
        return
    z = np.concatenate([found.velocities.xi, found.velocities.nu], axis=-1)
    given = np.concatenate([starts.xi, starts.nu], axis=-1)
    off, size = (np.max(np.abs(part), axis=-1) for part in (given - z, z))
    wrong = np.any(given, axis=-1) & (off > GIVEN * size)
    if np.any(wrong):
        raise ArgumentError(
            "The velocities of a start follow from its place, because the Lagrangian is linear in them: leave out `xi` "
            f"and `qdot`, or give (ξ, ν) = {np.round(z[np.argmax(wrong)], 6).tolist()}."
        )


def _singular(forms: np.ndarray) -> np.ndarray | None:
    """The direction that a singular one of several matrices ω maps to zero, None if all are regular.

    In units in which each row has the size 1.
    """
    scale = np.sqrt(np.max(np.abs(forms), axis=-1, initial=0.0))
    scale = np.where(scale > 0, scale, 1.0)
    _, sizes, ways = np.linalg.svd(forms / scale[..., None] / scale[:, None, :])
    worst = np.argmin(sizes[:, -1])
    if sizes[worst, -1] > SINGULAR:
        return None
    direction = ways[worst, -1] / scale[worst]
    return np.round(direction / direction[np.argmax(np.abs(direction))], 3)


def _require_two_form(forms: np.ndarray, bare: np.ndarray) -> None:
    """Raise LagrangianError where ω is singular, with the forces or without them, (members, size, size) each."""
    if not np.all(np.isfinite(forms)):
        raise LagrangianError(
            "The two-form ω = dϑ of a Lagrangian that is linear in the velocities must be finite at the start, but is "
            "not: look for a root at zero or a division by zero in ϑ, or in the forces."
        )
    if (direction := _singular(bare)) is not None:
        raise LagrangianError(
            "The two-form ω = dϑ of a Lagrangian that is linear in the velocities must be regular, but motion along "
            f"(ξ, ν) = {direction.tolist()} does not enter the equations: leave that variable out, give it a "
            "conjugate one, or, for ⟨μ₀, ξ⟩ − H on a coadjoint orbit, give ℋ(μ) and use co.HamiltonianMidpoint()."
        )
    if (direction := _singular(forms)) is not None:
        raise LagrangianError(
            "Forces on a Lagrangian that is linear in the velocities must not cancel its two-form ω = dϑ, but do so "
            f"for motion along (ξ, ν) = {direction.tolist()}: the velocities do not follow from the place."
        )
