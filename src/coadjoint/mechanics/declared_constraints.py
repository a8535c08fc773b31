"""The constraints that a system is given, checked when it is made."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from coadjoint.errors import ArgumentError, LagrangianError, shown
from coadjoint.mechanics.constraints import Bound, Constraint, Holonomic, Nonholonomic, Site, called, stacked
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.forces import INPUTS, INTERNAL, TIME, UNNAMED
from coadjoint.mechanics.members import member_of
from coadjoint.mechanics.reduced_functions import TRIVIAL, ReducedFunctions
from coadjoint.mechanics.signatures import keyword_only, require_signature
from coadjoint.mechanics.trace_checks import in_words


def constraints_from(given: Any) -> tuple[tuple[str, Constraint], ...]:
    """The names and constraints of a dictionary; raises ArgumentError for anything else."""
    if given is None:
        return ()
    if not isinstance(given, Mapping) or not given:
        raise ArgumentError(
            "Argument `constraints` must be a dictionary of names and constraints, such as "
            f'{{"pin": co.Holonomic(function)}}, but is {shown(given)}.'
        )
    for name, constraint in given.items():
        if not isinstance(name, str) or not name.isidentifier() or name in (TIME, INPUTS, INTERNAL, UNNAMED, "step"):
            raise ArgumentError(
                "The name of a constraint must be a word such as 'pin', other than `time`, `inputs`, `internal`, "
                f"`forces` and `step`, but is {shown(name)}."
            )
        if not isinstance(constraint, (Holonomic, Nonholonomic)):
            raise ArgumentError(
                f"The constraint `{name}` must be co.Holonomic(function) or co.Nonholonomic(rows), but is "
                f"{shown(constraint)}."
            )
    for name in given:
        if f"step_{name}" in given:
            raise ArgumentError(
                f"The constraints `{name}` and `step_{name}` would both have the variable `reaction_step_{name}`: "
                "rename one of them."
            )
    return tuple(given.items())


def require_free(system: ReducedFunctions, what: str) -> None:
    """Raise ArgumentError for a system with constraints, where `what` would leave out its reactions."""
    if system.constraints:
        raise ArgumentError(
            f"{what} would leave out the reactions of the constraints of `{system.name}`: describe the system in "
            "minimal coordinates, such as the angles of its joints, which need no constraints."
        )


def bound(system: ReducedFunctions, given: tuple[tuple[str, Constraint], ...]) -> tuple[Bound, ...]:
    """The constraints of a system, checked, with their numbers of rows; raises LagrangianError and ArgumentError."""
    if not given:
        return ()
    forces = set(system.forces.names) if system.forces is not None else set()
    found = tuple(_bound(system, name, constraint) for name, constraint in given)
    if doubled := forces.intersection(one.name for one in found):
        raise ArgumentError(
            f"A force and a constraint must have different names, but both are called `{doubled.pop()}`."
        )
    free, size = system.unknowns, sum(one.size for one in found)
    if not free:
        raise ArgumentError("A system whose group and additional space have no dimensions cannot have constraints.")
    if not system.continuous:
        raise LagrangianError(
            "Constraints need velocities at nodes: give the system a `lagrangian` or a `hamiltonian`."
        )
    if len(found) == 1 and size > free:
        raise ArgumentError(
            f"The constraint `{found[0].name}` has {size} rows, more than the {free} velocities of the system: leave "
            "out the dependent ones."
        )
    return found


def _bound(system: ReducedFunctions, name: str, constraint: Constraint) -> Bound:
    what, expected = f"The constraint `{name}`", _arguments(system)
    unsized = Bound(name, constraint, 0)
    functions, takes_inputs = unsized.functions, unsized.takes_inputs
    for function in functions:
        require_signature(function, what, expected)
        if keyword_only(inspect.signature(function).parameters, INTERNAL):
            raise LagrangianError(f"{what} cannot take `internal`: the place that it demands would jump at nodes.")
    in_time = takes_inputs or any(keyword_only(inspect.signature(f).parameters, "t") for f in functions)
    moving = in_time if isinstance(constraint, Holonomic) else constraint.right is not None
    size = constraint.size
    if size is None:
        if takes_inputs:
            raise ArgumentError(f"{what} takes `inputs`, which come with a run: give its number of rows as `size`.")
        size = _size(system, what, constraint)
    made = Bound(name, constraint, size, moving)
    if not takes_inputs:
        at = _zeros(system)
        check = made.value if made.holonomic else made.rows
        with in_words(what), jax.enable_x64(True):
            jax.eval_shape(lambda at: check(_shaped(system), at), at)
    return made


def _arguments(system: ReducedFunctions) -> list[str]:
    names = ["n"] if system.additional != TRIVIAL else []
    names += ["a"] if system.advected != TRIVIAL else []
    return names + (["p"] if system.parameters is not None else [])


def _zeros(system: ReducedFunctions) -> Site:
    group, Q, V = system.places
    return Site(np.zeros(Q.ambient(group)), np.zeros(V.ambient(group)), np.zeros(()))


def _shaped(system: ReducedFunctions) -> Any:
    """The system with the parameters of one member."""
    return replace_parameters(system, member_of(system.parameters, 0))


def _size(system: ReducedFunctions, what: str, constraint: Constraint) -> int:
    """The number of rows that a constraint returns."""
    function = constraint.function if isinstance(constraint, Holonomic) else constraint.rows
    with in_words(what), jax.enable_x64(True):
        shape = jax.eval_shape(lambda at: stacked(called(_shaped(system), function, at), what), _zeros(system)).shape
    if isinstance(constraint, Holonomic):
        if len(shape) > 1:
            raise LagrangianError(f"{what} must return a number or a row of numbers, but returns the shape {shape}.")
        size = shape[0] if shape else 1
    else:
        size = shape[0] if len(shape) == 2 else 1
    if not size:
        raise LagrangianError(f"{what} returns no numbers: leave it out.")
    return size
