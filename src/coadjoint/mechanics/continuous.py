"""The continuous Euler–Poincaré equations (P20–P22), their energy, and solutions of high accuracy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError, StepError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.fork_safety import require_own_xla
from coadjoint.mechanics import inverse_legendre, phase_space
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.discrete import Point, node
from coadjoint.mechanics.multipliers import multipliers
from coadjoint.mechanics.rates import rates
from coadjoint.mechanics.reactions import reaction, site
from coadjoint.mechanics.start import legendre, with_own_momenta
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.traced_once import traced_once
from coadjoint.spaces.space import require_flat


def velocities(system: System, state: State) -> tuple[Array, Array]:
    """(ξ, ν), (dim G,) and (ambient,), with ∂_ξℓ = μ, ∂_νℓ = π on T_nQ, from the state's own (ξ, ν).

    See `mechanics.inverse_legendre`.
    """
    xi, nu, _ = inverse_legendre.velocities(system, state)
    return xi, nu


def energy(system: System, state: State) -> Array:
    """The Legendre energy E = ⟨μ, ξ⟩ + ⟨π, ν⟩ − ℓ of (μ, π, n, a), one number: the reduced Hamiltonian ℋ (P8)."""
    if system.hamiltonian is not None:
        return system.reduced_hamiltonian(state.mu, state.n, state.pi, state.a, state.t, state.inputs, state.internal)
    return energy_at(system, state, *velocities(system, state))


def energy_at(system: System, state: State, xi: Array, nu: Array) -> Array:
    """⟨∂_ξℓ, ξ⟩ + ⟨∂_νℓ, ν⟩ − ℓ, one number, at the place of the state with velocities ξ (dim G,) and ν (ambient,)."""
    return node(system, state.holding(state.internal), Point(xi, state.n, nu, state.a, state.t)).energy


@traced_once
def vector_field(system: System, state: State) -> State:
    """d/dt of g, n, a, μ, π, ξ, ν at (ξ, ν) of the state, on a flat Q.

    μ̇ = ad*_ξ μ + ∂_aℓ⋄a + ∂_nℓ⋄n + π⋄ν + T, π̇ = ∂_nℓ + L*_ξπ + f, ṅ = ν − ξ·n, ȧ = −ξ·a, ġ = gξ (P20–P22), with the
    reactions Aᵀλ of independent constraints in T and f.
    """
    group, size = system.group, system.group.dim
    xi, n, nu, a = state.xi, state.n, state.nu, state.a
    _, (mu_dot, n_dot, pi_dot, a_dot) = rates(system, state)
    if system.constraints:
        torque, force = reaction(system, site(state), multipliers(system, state, None))
        mu_dot, pi_dot = mu_dot + torque, pi_dot + force
    g_dot = jax.jvp(lambda f: group.compose(state.g, f), (group.identity(),), (group.tangent(xi),))[1]
    along = (jnp.zeros_like(xi), n_dot, jnp.zeros_like(nu), a_dot, jnp.ones_like(state.t))

    def momenta(xi: Array, n: Array, nu: Array, a: Array, t: Scalar):
        return jnp.concatenate(legendre(system, xi, n, nu, a, t, state.inputs, state.internal))

    drift = jax.jvp(momenta, (xi, n, nu, a, state.t), along)[1]
    mass = jax.jacfwd(lambda z: momenta(z[:size], n, z[size:], a, state.t))(jnp.concatenate([xi, nu]))
    if phase_space.linear(system, state):
        accelerations = phase_space.accelerations(system, state, n_dot, a_dot)
    else:
        accelerations = jnp.linalg.solve(mass, jnp.concatenate([mu_dot, pi_dot]) - drift)
    return state.replace(
        t=jnp.ones_like(state.t), g=g_dot, n=n_dot, a=a_dot, mu=mu_dot, pi=pi_dot,
        xi=accelerations[:size], nu=accelerations[size:],
    )  # fmt: skip


def reference(system: System, start: State, times: ArrayLike, tolerance: float = 1e-13) -> State:
    """The continuous motion from `start` at the given times, by DOP853: a record with one row a time.

    times: (k,), s, in order. tolerance: relative, by default 1e-13; g, n, a, ξ, ν are integrated with it, and μ, π
    follow by the Legendre transform. The start of a record takes (ξ, ν) from its momenta, because a record's own are
    those of a step, off by O(h). So does that of a driven system whose ℓ takes inputs: its momenta are those with the
    start's own inputs. Raises ArgumentError for a curved Q, for times out of order and for a system whose internal
    state has a rule, which is applied from step to step; StepError where the integration fails.
    """
    if system.internal is not None:
        raise ArgumentError(
            "The reference solution has no steps, but the rule of this system advances its internal state once a step: "
            "compare with small steps."
        )
    require_flat(system.additional, "The reference solution", "compare with small steps")
    at = _in_order(times, float(start.t))
    start = start if system.inputs is None else with_own_momenta(system.driven(None), start)
    xi, nu = (start.xi, start.nu) if _gives_velocities(system, start) else _velocities_of(system, start)
    moving = (start.g, start.n, start.a, xi, nu)
    flat, unflatten = _flatten(moving)

    def assemble(t: Scalar, parts: tuple[PyTree, ...], mu: Array = start.mu, pi: Array = start.pi) -> State:
        g, n, a, xi, nu = parts
        return start.replace(t=t, g=g, n=n, a=a, xi=xi, nu=nu, mu=mu, pi=pi)

    def rate(t: Scalar, y: Array, parameters: PyTree) -> Array:
        slope = vector_field(replace_parameters(system, parameters), assemble(t, unflatten(y)))
        return _flatten((slope.g, slope.n, slope.a, slope.xi, slope.nu), jnp)[0]

    require_own_xla()
    with jax.enable_x64(True):
        compiled = jax.jit(rate)
        rows = _integrate(
            lambda t, y: np.asarray(compiled(t, y, system.parameters)), float(start.t), flat, at, tolerance
        )

        def complete(t: Scalar, y: Array) -> State:
            parts = unflatten(y)
            return assemble(
                t, parts, *legendre(system, parts[3], parts[1], parts[4], parts[2], t, start.inputs, start.internal)
            )

        return jax.tree.map(np.asarray, jax.jit(jax.vmap(complete))(at, rows))


def _integrate(
    rate: Callable[[float, np.ndarray], np.ndarray], first: float, y: np.ndarray, times: np.ndarray, tolerance: float
) -> np.ndarray:
    """y at the times, a row each; the start itself where all times equal the first."""
    if times[-1] == first:
        return y[None]
    from scipy.integrate import solve_ivp  # a fifth of what co.simulate takes to load

    found = solve_ivp(
        rate, (first, float(times[-1])), y, method="DOP853", t_eval=times, rtol=max(tolerance, 2.3e-14), atol=tolerance
    )
    if not found.success:
        raise StepError(f"The reference solution failed: {found.message}")
    return found.y.T


def _gives_velocities(system: System, start: State) -> bool:
    """Whether a start has the velocities of its node; where ℓ is linear in them they follow from its place."""
    return start.from_velocities and not phase_space.linear(system, start)


def _velocities_of(system: System, state: State) -> tuple[Array, Array]:
    """Raises StepError where they are not found."""
    found = evaluate(
        lambda s, p: inverse_legendre.velocities(replace_parameters(system, p), s), state, system.parameters
    )
    if found.residual is not None and not found.residual <= inverse_legendre.SOLVED:
        raise StepError(
            "The velocities of the record could not be found from its momenta: the inverse Legendre transform did not "
            f"converge, with a residual of {found.residual:.1e}."
        )
    return found.xi, found.nu


def _in_order(times: ArrayLike, first: float) -> np.ndarray:
    """The times, all after or all before the start's, each further than the last."""
    found = float64(times, "Argument `times`")
    gaps = np.diff(found, prepend=first) if np.ndim(found) == 1 else np.zeros(0)
    forward, backward = (np.all(s * gaps[1:] > 0) and s * gaps[0] >= 0 for s in (1, -1)) if len(gaps) else (0, 0)
    if not forward and not backward:
        raise ArgumentError(
            f"Argument `times` must hold at least one time, in order and on one side of the start's t = {first:g} s: "
            "sort them."
        )
    return found


def _flatten(tree: PyTree, numpy: Any = np) -> tuple[PyTree, PyTree]:
    leaves, structure = jax.tree.flatten(tree)
    shapes = [np.shape(leaf) for leaf in leaves]
    ends = np.cumsum([0, *(int(np.prod(shape)) for shape in shapes)])

    def unflatten(y: Array) -> PyTree:
        parts = [y[a:b].reshape(s) for a, b, s in zip(ends[:-1], ends[1:], shapes, strict=True)]
        return jax.tree.unflatten(structure, parts)

    return numpy.concatenate([numpy.ravel(leaf) for leaf in leaves]), unflatten
