"""Shadow energies: the energy of the modified Lagrangian whose exact motion goes through the nodes of a run."""

from __future__ import annotations

from functools import partial
from math import factorial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.errors import ArgumentError, StepError
from coadjoint.kernels.run import xla
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.theory.continuous import body_velocity
from coadjoint.theory.equations import RULES, consecutive


class ShadowEnergy(NamedTuple):
    """The shadow energy at nodes that have enough neighbours.

    t, values: (nodes,), s and the unit of the energy.
    """

    t: np.ndarray
    values: np.ndarray

    @property
    def relative_change(self) -> float:
        """The largest |H̃/H̃₀ − 1|, one number."""
        return float(np.max(np.abs(self.values - self.values[0])) / np.abs(self.values[0]))


def shadow_energy(run: Any, points: int = 9) -> ShadowEnergy:
    """H̃ = ⟨μ, ξ̃⟩ + ⟨π, ν̃⟩ − Ṡ at the nodes of a run, the energy of the modified Lagrangian L̃ with Λ = ∫L̃ dt.

    A variational method moves along exact motions of L̃ = ℓ + O(hᵖ), whose energy stays where E oscillates by O(hᵖ).
    μ and π are the momenta of L̃ at the nodes, and S = ΣΛ its action there. ξ̃ = g⁻¹ġ, ν̃ = g⁻¹q̇ and Ṡ are derivatives
    of the polynomials of degree `points` − 1 through g, q and S at a node and its neighbours, off by O(h^{points−1}).
    Of a composition S is the sum over the substeps, which are solved once more from each node.

    Arguments:
        run: a run of co.simulate that kept every step, without forces, inputs, internal states, constraints or time in
            ℓ, by a method with one Λ a step, or a composition of such methods.
        points: how many nodes a polynomial goes through, odd, from 3 to 21, by default 9. With more the values change
            less, until they show the resolution of the motion or round-off.

    Raises ArgumentError for other runs and methods, and for fewer nodes than `points`.
    Source: Engle, Skeel, Drees, Monitoring energy drift with shadow Hamiltonians, J. Comput. Phys. 206 (2005), there by
    other means and for canonical equations.
    """
    points = checks.whole(points, "points", 3, 21)
    checks.expect(points % 2 == 1, points, "points", "odd")
    records, system = consecutive(run), run.system
    if not all(isinstance(step, RULES) for step, _ in run.method.stages):
        raise ArgumentError(
            f"A shadow energy needs one discrete Lagrangian a substep, which {run.method.title} does not have: use "
            "co.Midpoint, co.Trapezoidal, another rule or a composition of it."
        )
    driven = (system.forces, system.internal, system.inputs)
    if any(part is not None for part in driven) or system.constraints or system.depends_on_time:
        raise ArgumentError(
            "A shadow energy needs a motion that conserves energy, but the system has forces, inputs, an internal "
            "state, constraints or a Lagrangian that depends on time: leave these out."
        )
    if len(records.t) < points + 1:
        raise ArgumentError(
            f"A shadow energy through {points} nodes needs {points + 1} records: {len(records.t)} are few."
        )
    half, actions = points // 2, _actions(run, records)
    count = len(records.t) - points + 1
    windows = jax.tree.map(lambda leaf: np.stack([leaf[i : i + count] for i in range(points)], axis=1), records)
    done = np.stack([actions[i : i + count] for i in range(points - 1)], axis=1)
    sums = np.concatenate([np.zeros((count, 1)), np.cumsum(done, axis=1)], axis=1)
    values = evaluate(jax.vmap(partial(_energy, system, _slopes(half) / run.dt)), windows, sums)
    return ShadowEnergy(np.asarray(records.t[half : half + count]), np.asarray(values))


def _actions(run: Any, records: State) -> np.ndarray:
    """Λ of the step from each record, (records,): the sum over its substeps."""
    constants = Constants(run.system.parameters, None)
    system, state, total = run.system, records, 0.0
    for i, (step, fraction) in enumerate(run.method.stages):
        h, program = fraction * run.dt, StepProgram(replace_parameters(system, None), step)
        if len(run.method.stages) == 1:
            record = state
        else:
            record, state, failed = evaluate(jax.vmap(partial(_substep, program, constants, h)), state)
            if np.any(failed):
                t = float(records.t[np.argmax(failed != 0)])
                raise StepError(f"Substep {i + 1} from the node at t = {t:g} s has no solution: take a smaller dt.")
        total = total + evaluate(
            jax.vmap(lambda record, step=step, h=h: step.discrete_lagrangian(system, record, h)), record
        )
    return np.asarray(total)


def _substep(program: StepProgram, constants: Constants, h: float, state: State) -> tuple[State, State, Array]:
    """The record of a substep, the state after it, and 0 if its equations are solved."""
    found = xla.step(program, constants, state, h, certify=False)
    return found.record, found.after, found.code


def _slopes(half: int) -> np.ndarray:
    """w with f′(0) = Σ w_j f(j), j = −half … half, for polynomials of degree 2 half."""
    ahead = [
        (-1) ** (j + 1) * factorial(half) ** 2 / (j * factorial(half - j) * factorial(half + j))
        for j in range(1, half + 1)
    ]
    return np.array([*(-w for w in ahead[::-1]), 0.0, *ahead])


def _energy(system: System, weights: np.ndarray, window: State, action: Array) -> Array:
    """H̃ at the node in the middle of a window; action: S at its nodes, (points,)."""
    group, Q, _ = system.places
    middle = jax.tree.map(lambda leaf: leaf[len(weights) // 2], window)
    back = group.inverse(middle.g)
    F = jax.vmap(lambda g: group.compose(back, g))(window.g)
    moved = jax.tree.map(lambda leaf: jnp.tensordot(weights, leaf, axes=1), F)
    xi = body_velocity(group, group.identity(), moved)
    nu = weights @ jax.vmap(lambda F, n: Q.act(group, F, n))(F, window.n)
    return middle.mu @ xi + middle.pi @ nu - weights @ (action - action[len(weights) // 2])
