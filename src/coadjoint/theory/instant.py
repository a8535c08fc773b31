"""The instant of a step of the discrete theory: its start time, and the inputs and internal state held over it."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.mechanics.members import count_members
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.renewal import held
from coadjoint.spaces.named import named


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Instant:
    """The time t (s) at which a step starts, and the inputs and the internal state that are held over it.

    `inputs`: of a system driven by signals (`system.driven`) leave them out. `internal`: a dictionary like the start's,
    the mean over the step. `internal_end`: that at the end of the step, by default the same. All are None for a
    system that has none of them.

    t: one number; of a sequence of steps all have a leading axis.
    """

    t: Array | None = None
    inputs: PyTree = None
    internal: PyTree = None
    internal_end: PyTree = None

    def __post_init__(self):
        if self.internal_end is None:
            object.__setattr__(self, "internal_end", self.internal)
        for key in ("inputs", "internal", "internal_end"):
            object.__setattr__(self, key, named(getattr(self, key)))


ALWAYS = Instant()
"""The instant of every step of a system that has neither time, forces, inputs nor an internal state."""


def instants(records: State) -> Instant:
    """The instants of a state, or of the records of a run, with a leading axis."""
    return Instant(records.t, records.inputs, records.over_step, records.internal_end)


def timed(system: System) -> bool:
    """Whether the steps of a system differ by when they start: by explicit time, inputs, forces, internal states."""
    driven = system.inputs is not None or system.forces is not None or system.internal is not None
    return driven or any(map(system.takes, ("t", "inputs", "internal")))


def require_one(system: System) -> None:
    """Raise ArgumentError for a system whose parameters are those of many members."""
    if count_members(system.parameters) is not None:
        raise ArgumentError(
            "The theory is that of one system, but parameters of this one are co.each: give one member, as in "
            "system.replace(mass=130.0)."
        )


def require_instants(at: Instant, steps: int) -> None:
    """Raise ArgumentError unless the data of the steps of a sequence have a leading axis of all steps."""
    shapes = [np.shape(leaf) for leaf in jax.tree.leaves(at)]
    if any(not shape or shape[0] != steps for shape in shapes):
        raise ArgumentError(
            f"Argument `at` must hold the instants of all {steps} steps with a leading axis, which are those of the "
            f"records but the last, but has shapes {', '.join(map(str, shapes))}."
        )


def given(system: System, at: Instant) -> tuple[PyTree, PyTree, PyTree]:
    """(t, inputs, internal) as the functions of a system take them; raises ArgumentError if one is missing."""
    require_one(system)
    if at.t is None and timed(system):
        raise ArgumentError(
            "The steps of this system depend on when they start, by explicit time, forces, inputs or an internal "
            "state: give each its theory.Instant(t, inputs, internal), as theory.instants(run.records) does."
        )
    holds = system.inputs is not None and system.inputs.holds
    if at.inputs is None and (holds or (system.inputs is None and system.takes("inputs"))):
        raise ArgumentError(
            "This system takes inputs: give those that are held over the step, as in "
            "theory.Instant(t, inputs={'thrust': 1.0}), or drive it by signals, system.driven({'thrust': jnp.sin})."
            if not holds
            else "This system is driven by functions of the motion: give the first step the inputs that are held over "
            "it, as theory.instants(run.records) does."
        )
    if at.internal is None and (system.internal is not None or system.takes("internal")):
        raise ArgumentError(
            "This system has an internal state: give the one that is held over the step, as in "
            "theory.Instant(t, internal={'rudder': 0.0})."
        )
    return 0.0 if at.t is None else at.t, at.inputs, at.internal


def next_instant(system: System, at: Instant, h: Scalar, motion: tuple[Array, Array, Array, Array]) -> Instant:
    """The instant of the next step, of h as well, which starts at (n, a) after one with velocities (ξ, ν).

    motion: (ξ, n, ν, a), of shapes (dim G,), (ambient,), (ambient,) and (dim V*,). Inputs that are functions of the
    motion, and the rule of the internal state, are applied as co.simulate does; they may not read g or q = g·n, of
    which reduced equations know nothing.
    """
    if at.t is None:
        return at
    t, inputs, _ = given(system, at)
    xi, n, nu, a = motion
    nothing, ruled = np.zeros(0), system.internal is not None
    end = at.internal_end
    state = State(
        t=t + h, g=None, n=n, a=a, mu=nothing, pi=nothing, xi=xi, nu=nu, inputs=inputs, internal=end,
        internal_mean=end if ruled else None, internal_end=end if ruled else None, internal_due=1.0 if ruled else None,
        places=system.places,
    )  # fmt: skip
    return instants(held(system, state, h))
