"""Inputs of constraints that jump: places must not jump with them, and velocities do so with a warning."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import jax

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.jaxprs import depends
from coadjoint.mechanics.constraints import Bound
from coadjoint.mechanics.copies import replaced
from coadjoint.mechanics.inputs import Command
from coadjoint.mechanics.reactions import site
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.mechanics.signals import Signal, jumps
from coadjoint.mechanics.state import State

SMOOTH = "give a signal without jumps, such as co.Linear(times, values)"


def require_smooth_place(constraint: Bound, system: ReducedFunctions, state: State, held: PyTree) -> None:
    """Raise ArgumentError where a holonomic constraint reads an input that jumps, and its place with it.

    held: the inputs that are held over the step.
    """
    for whose, kind in _jumps(system, state, held, lambda here, s: constraint.value(here, site(s))):
        raise ArgumentError(
            f"The constraint `{constraint.name}` reads {whose}, {kind}, so that its place would jump: {SMOOTH}."
        )


def jumping_velocities(system: ReducedFunctions, state: State) -> list[str]:
    """A sentence for each nonholonomic constraint that reads an input that jumps. state: with the held inputs."""
    return [
        f"The constraint `{one.name}` reads {whose}, {kind}: velocities on it jump too, and the steps of a jump are of "
        f"order 1, whatever dt and the method; for smooth motions {SMOOTH}."
        for one in system.constraints
        if not one.holonomic and one.takes_inputs
        for whose, kind in _jumps(system, state, state.inputs, lambda here, s, one=one: one.rows(here, site(s)))
    ]


def _jumps(
    system: ReducedFunctions, state: State, held: PyTree, read: Callable[[ReducedFunctions, State], PyTree]
) -> Iterator[tuple[str, str]]:
    """The inputs on which `read` of (system, state) depends and that jump, and how they do, in words."""
    inputs = system.inputs
    if inputs is None:
        return
    now, bare = inputs.at(state.t, held), replaced(system, inputs=None)
    used = jax.tree.unflatten(
        jax.tree.structure(now), depends(lambda given: read(bare, state.replace(inputs=given)), now)
    )
    for name, source in zip(inputs.names or ("",), inputs.sources, strict=True):
        reads = any(jax.tree.leaves(used if inputs.names is None else getattr(used, name)))
        if reads and (kind := _jumping(source)):
            yield "an input" if inputs.names is None else f"the input `{name}`", kind


def _jumping(source: object) -> str:
    """How an input jumps, in words; empty for signals without jumps."""
    if isinstance(source, Signal):
        return "a co.Held that jumps" if jumps(source) else ""
    return "a command held over steps" if isinstance(source, Command) else "a function of the motion, held over steps"
