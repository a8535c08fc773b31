"""Rods at rest under their loads, and the frequencies at which they swing about there."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.groups import Power
from coadjoint.kernels.trace.evaluate import evaluate, tabulate, traced
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.rods.shapes import curve, rod_pairs
from coadjoint.models.rods.strains import logarithm

LONGEST_STEP = 1.0
"""rad or lengths of the rod, by which one section moves at most in an iteration."""
MOST = 60
"""Iterations."""
UNBALANCED = 1e-12
"""Forces that no motion changes, beyond this fraction of the stiffness, leave no state of rest; round-off is 1e-19."""
RESTING = 1e-4
"""rad or lengths of the rod, from a state of rest up to which modes are taken."""
LARGEST = 1500
"""Unknowns, of which a dense matrix is formed."""


def equilibrium(rod: System, state: State, tolerance: float = 1e-9) -> State:
    """The state of rest that Newton's iteration finds from the shape of a state, stable or not.

    All sections hold ∂V/∂η_i = T_i, V the energy of strains, gravity and loads, T a couple at the end. The matrix is
    dense: of a chain with 100 sections on SE(3) one of 600 rows.

    rod: a rod or a chain of co.models.rods. state: of it, from which a and the shape are taken; velocities are not.
    tolerance: by how much a section moves in the last iteration at most, rad or lengths of the rod.
    Raises ArgumentError where the iteration does not end, where what acts on a rod that nothing holds does not balance,
    for a matrix of more than 1500 rows, and under jax.grad.
    """
    group = _group(rod, state)
    forces, couple, unit = _forces(rod, state), _couple(rod, group), _units(rod, group)
    a0 = evaluate(lambda g, a: rod.advected.act(group, g, a), state.g, state.a)
    size, left, unbalanced, balanced = np.inf, 0.0, 0, False
    for _ in range(MOST):
        residual, slope = forces(state.a)
        step, left = _solved(slope, couple - residual, unit)
        size = float(np.max(np.abs(step)))
        unbalanced = unbalanced + 1 if left > UNBALANCED else 0
        balanced = balanced or not unbalanced
        if not np.isfinite(size) or unbalanced == 3:
            break
        state = _moved(rod, state, a0, unit * step * min(1.0, LONGEST_STEP / max(size, LONGEST_STEP)))
        if size <= tolerance and not unbalanced:
            return state
    if not balanced:
        raise ArgumentError(
            "This rod has no state of rest: nothing holds it, and what acts on it does not balance; clamp an end, or "
            "leave out gravity, loads and couples."
        )
    raise ArgumentError(
        f"No state of rest was found: the last iteration moved a section by {size:.2g}, rad or lengths of the rod. "
        "Start from a shape that is nearer, as that of a smaller load, or take more elements, of which each turns by "
        "less than π."
    )


def modes(rod: System, state: State) -> tuple[np.ndarray, np.ndarray]:
    """ω² and the shapes of small motions about a state of rest: Kη = ω²Mη, K = ∂²V/∂η², M = ∂²ℓ/∂ξ².

    rod: a rod or a chain of co.models.rods, without a couple at its end. state: at rest, as of `equilibrium`.
    Returns ω², 1/s², from the smallest on, (n,), negative where the state is unstable and 0 for rigid motions of free
    rods, and the shapes, (n, N, dim G), with ηᵀMη = 1. Raises ArgumentError above 1500 unknowns, with a couple, under
    jax.grad, and for a state that is more than 1e-4 rad, or lengths of the rod, away from rest.
    """
    from scipy.linalg import eigh  # which takes a fifth of a second to import

    group = _group(rod, state)
    if np.any(_couple(rod, group)):
        raise ArgumentError("A rod with a couple at its end has no energy to take modes of: leave `moment` out.")
    residual, K = _forces(rod, state)(state.a)
    step, left = _solved(K, -residual, _units(rod, group))
    if left > UNBALANCED or not np.max(np.abs(step)) <= RESTING:
        raise ArgumentError("Argument `state` must be a state of rest: take rods.equilibrium(rod, state).")
    nothing = np.zeros(rod.additional.ambient(group))

    def mass(a):
        return jax.hessian(lambda xi: rod.reduced_lagrangian(xi, nothing, nothing, a, state.t))(np.zeros(group.dim))

    squares, shapes = eigh(0.5 * (K + K.T), evaluate(mass, state.a))
    return squares, shapes.T.reshape(len(squares), group.count, -1)


def _group(rod: System, state: State) -> Power:
    """The group; raises ArgumentError for no rod or chain, a state that is none of its, and derivatives."""
    group = rod.group
    if not isinstance(group, Power) or rod.additional.ambient(group):
        raise ArgumentError(f"Argument `rod` must be a rod or a chain of co.models.rods, but is {rod.name!r}.")
    checks.expect(
        isinstance(state, State) and state.places == rod.places, state, "state", f"a state of this {rod.name}"
    )
    if any(map(traced, jax.tree.leaves((rod.parameters, state.g, state.a)))):
        raise ArgumentError(
            "A state of rest and its modes have no derivatives by JAX: take differences of their numbers."
        )
    if group.dim > LARGEST:
        raise ArgumentError(
            f"A state of rest is found by a dense matrix of at most {LARGEST} unknowns, but this has {group.dim}."
        )
    return group


def _units(rod: System, group: Power) -> np.ndarray:
    """1 rad and the length of the rod, of each unknown, (n,)."""
    p: PyTree = rod.parameters
    turning = {3: 1, 6: 3}[group.factor.dim] if hasattr(p, "rest_curvature") else group.factor.dim
    one = np.full(group.factor.dim, float(np.sum(p.length)))
    one[:turning] = 1.0
    return np.tile(one, group.count)


def _solved(slope: np.ndarray, right: np.ndarray, unit: np.ndarray) -> tuple[np.ndarray, float]:
    """η in `unit` with K η = right, and how much of the right side no η balances, relative to K."""
    K, right = slope * unit * unit[:, None], right * unit
    eta = np.linalg.lstsq(K, right, rcond=1e-13)[0]
    return eta, float(np.max(np.abs(right - K @ eta)) / np.max(np.abs(K)))


def _couple(rod: System, group: Power) -> np.ndarray:
    T = np.zeros((group.count, group.factor.dim))
    p: PyTree = rod.parameters
    if hasattr(p, "moment"):
        moment = np.ravel(p.moment)
        T[-1, : len(moment)] = moment
    return np.ravel(T)


def _forces(rod: System, state: State) -> Callable[..., PyTree]:
    """a ↦ (∂V/∂η, its derivative by η) at η = 0, (n,) and (n, n), V of g exp(η)."""
    group, _, V = rod.places
    rest, nothing = np.zeros(group.dim), np.zeros(rod.additional.ambient(group))

    def seen(a, eta):
        return V.act(group, group.inverse(group.exp(eta)), a)

    def gradient(a):
        def energy(eta):
            return -rod.reduced_lagrangian(rest, nothing, nothing, seen(a, eta), state.t)

        return jax.grad(energy)(rest)

    def both(a):
        return gradient(a), jax.jacfwd(lambda eta: gradient(seen(a, eta)))(rest)

    return tabulate(both, state.a)


def _moved(rod: System, state: State, a0: PyTree, eta: np.ndarray) -> State:
    """The state at g exp(η); of a rod with a free end the state whose strains have moved as they do along η.

    Strains that add up keep a stiff rod from being stretched by a turn, which is what sections that move on their own
    do to it.
    """
    group, _, V = rod.places
    g = evaluate(lambda g, eta: group.compose(g, group.exp(eta)), state.g, eta)
    last = rod_pairs(rod)[-1] if hasattr(rod.parameters, "rest_curvature") else (0, 0)
    if last[1] == last[0] + 1:  # neither a ring nor clamped there
        g = _by_strains(rod, state, g, a0, eta)
    a = evaluate(lambda g, a0: V.act(group, group.inverse(g), a0), g, a0)
    still = np.zeros(group.dim)
    return state.replace(g=g, a=a, xi=still, mu=still)


def _by_strains(rod: System, state: State, g: PyTree, a0: PyTree, eta: np.ndarray) -> PyTree:
    """The elements of the sections one after the other, from the moved first one, or from the clamp."""
    group, _, V = rod.places
    p: PyTree = rod.parameters
    clamped = rod_pairs(rod)[0][0] < 0

    def strains(a, eta):
        def strain(eta):
            joint = V.view(group, V.act(group, group.inverse(group.exp(eta)), a)).joint
            return logarithm(joint) / p.length[:, None]

        now, change = jax.jvp(strain, (jnp.zeros_like(eta),), (eta,))
        return now + change

    def clamp(a0):  # e₀ of the first element is the inverse of its pose
        R, x = V.view(group, a0).joint
        return R[0].T, -R[0].T @ x[0]

    first = evaluate(clamp, a0) if clamped else jax.tree.map(lambda leaf: leaf[0], g)
    poses = curve(rod, first, evaluate(strains, state.a, eta))
    return jax.tree.map(lambda leaf: leaf[int(clamped) :], poses)
