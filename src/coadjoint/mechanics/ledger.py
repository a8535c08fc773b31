"""What forces and explicit time have given to a system since the start: energy by name, and momentum.

A ledger is an array (2, lines + dim G): the energy that each force and explicit time have put in, Σ hw⟨T, ξ⟩ + ⟨f, ν⟩
and Σ −hw ∂_tℓ over all nodes of all stages, and the spatial momentum Σ Ad*_{g⁻¹}Δ of Theorem 7. Its second row is what
rounding has cut off the first (Kahan's summation).
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from coadjoint.groups.group import Array
from coadjoint.mechanics.forces import TIME
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System


def energy_lines(system: System) -> tuple[str, ...]:
    """The names of what changes the energy: the forces, and `time` where ℓ depends on it."""
    forces = system.forces.names if system.forces is not None else ()
    return (*forces, TIME) if system.depends_on_time else forces


def with_ledger(system: System, state: State, asked: bool) -> State:
    """The state with an empty ledger; with none where nobody asks for it, or nothing changes the energy."""
    lines = len(energy_lines(system))
    return state.replace(ledger=np.zeros((2, lines + system.group.dim)) if asked and lines else None)


def entered(ledger: Array, energy: Array, momentum: Array) -> Array:
    """The ledger with the energy (lines,) and the spatial momentum (dim G,) of one more stage."""
    total, rest = ledger
    step = jnp.concatenate([energy, momentum]) + rest
    after = total + step
    return jnp.stack([after, step - (after - total)])


def energy_put_in(system: System, state: State) -> dict[str, Array]:
    """The energy that each force, and explicit time, have put in since the start; negative where they took it."""
    return {name: state.ledger[0, i] for i, name in enumerate(energy_lines(system))}


def momentum_put_in(system: System, state: State) -> Array:
    """Σ Ad*_{g⁻¹}Δ ∈ 𝔤*, by which the spatial momentum has changed since the start (Theorem 7)."""
    return state.ledger[0, len(energy_lines(system)) :]
