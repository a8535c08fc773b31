"""The energy and momentum that forces and explicit time have put into a system since the start.

A ledger is an array (2, lines + dim G). Its first row: the energy that each force has put in, Σ hw(⟨T, ξ⟩ + ⟨f, ν⟩),
and explicit time, −Σ hw ∂_tℓ, over all nodes of all stages; the jumps of ℋ where held inputs, tables or internal states
enter it; and the spatial momentum Σ Ad*_{g⁻¹}Δ of Theorem 7. Its second row is the rounding error of the first (Kahan's
summation).
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, Scalar
from coadjoint.mechanics.continuous import energy
from coadjoint.mechanics.copies import replaced
from coadjoint.mechanics.forces import INPUTS, INTERNAL, TIME
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System


def energy_lines(system: System) -> tuple[str, ...]:
    """The names of the energy terms: forces, `time`, moving constraints, and held `inputs`, `internal` that reach ℓ."""
    forces = system.forces.names if system.forces is not None else ()
    time = (TIME,) if system.depends_on_time else ()
    constraints = (one.name for one in system.constraints if one.moving)
    return (*forces, *time, *constraints, *_jumping(system))


def changing_momentum(system: System) -> tuple[str, ...]:
    """The names of the forces and nonholonomic constraints, which change the Kelvin–Noether quantities."""
    forces = system.forces.names if system.forces is not None else ()
    return (*forces, *(one.name for one in system.constraints if not one.holonomic))


def _jumping(system: System) -> tuple[str, ...]:
    """The quantities that jump and enter ℓ or ℋ."""
    sources = {
        INPUTS: system.inputs is not None and (system.inputs.holds or system.inputs.jump),
        INTERNAL: system.internal is not None,
    }
    return tuple(key for key, jumps in sources.items() if jumps and system.takes(key) and system.continuous)


def with_ledger(system: System, state: State, asked: bool) -> State:
    """The state with an empty ledger; with none without monitors, or where nothing changes energy or momentum."""
    lines = len(energy_lines(system))
    needed = asked and (lines or changing_momentum(system))
    return state.replace(ledger=np.zeros((2, lines + system.group.dim)) if needed else None)


def with_jump(system: System, held: str, before: State, after: State) -> State:
    """`after`, which differs from `before` in its `held` quantities, with the change of ℋ in its ledger.

    The momenta are continuous, so that the jump adds ℋ(μ, π, n, a; after) − ℋ(μ, π, n, a; before).
    """
    if before.ledger is None or held not in _jumping(system):
        return after
    change = over_step(system, after) - over_step(system, before)
    return _with_line(system, held, after.replace(ledger=before.ledger), change)


def with_tables(system: System, before: State, after: State) -> State:
    """`after`, the end of a stage from `before`, with the changes of ℋ in its ledger by tables that jump.

    The stage moves by the tables in its middle, so that its line grows by
    ℋ(before; middle) − ℋ(before; its time) + ℋ(after; its time) − ℋ(after; middle).
    """
    inputs = system.inputs
    if after.ledger is None or inputs is None or not inputs.jump or INPUTS not in _jumping(system):
        return after
    bare, middle = replaced(system, inputs=None), 0.5 * (before.t + after.t)

    def read(state: State, tables: Scalar) -> Array:
        return over_step(bare, state.replace(inputs=inputs.at(state.t, state.inputs, tables)))

    change = read(before, middle) - read(before, before.t) + read(after, after.t) - read(after, middle)
    return _with_line(system, INPUTS, after, change)


def _with_line(system: System, name: str, state: State, change: Array) -> State:
    """The state with one line of its ledger changed by one number."""
    place = energy_lines(system).index(name)
    return state.replace(ledger=_added(state.ledger, jnp.zeros(np.shape(state.ledger)[1]).at[place].set(change)))


def over_step(system: System, state: State) -> Array:
    """ℋ(μ, π, n, a), one number, with the internal state that is read over the step from here."""
    return energy(system, state.holding(state.over_step))


def entered(ledger: Array, power: Array, momentum: Array) -> Array:
    """The ledger with the energy of forces and of time, and the spatial momentum (dim G,), of one more stage."""
    others = jnp.zeros(np.shape(ledger)[1] - len(power) - len(momentum))
    return _added(ledger, jnp.concatenate([power, others, momentum]))


def _added(ledger: Array, step: Array) -> Array:
    total, rest = ledger
    step = step + rest
    after = total + step
    return jnp.stack([after, step - (after - total)])


def energy_put_in(system: System, state: State) -> dict[str, Array]:
    """The work of each force, and of explicit time, since the start, one number each; negative where energy is lost.

    The ledger refers to the mean of the internal state over the step from here; its line refers to that at t.
    """
    found = {name: state.ledger[0, i] for i, name in enumerate(energy_lines(system))}
    if INTERNAL in _jumping(system):
        found[INTERNAL] = found[INTERNAL] - (over_step(system, state) - energy(system, state))
    return found


def momentum_put_in(system: System, state: State) -> Array:
    """Σ Ad*_{g⁻¹}Δ ∈ 𝔤*, (dim G,), by which the spatial momentum has changed since the start (Theorem 7)."""
    return state.ledger[0, len(energy_lines(system)) :]
