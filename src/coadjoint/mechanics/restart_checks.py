"""Restarts from a record: its origin, and the quantities that stay when the parameters change."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, get_args

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.mechanics.continuous import velocities
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.state import Origin, State, of_step
from coadjoint.mechanics.system import System

if TYPE_CHECKING:
    from coadjoint.mechanics.parameters import Parameters

Keep = Literal["momentum", "velocity"]


def continued(system: System, start: State, keep: Keep | None) -> tuple[State, str | None]:
    """The start of a run of `system`, and a sentence on the quantities that were kept, None where nothing changed.

    A record of a run with other parameters has other velocities with the same momentum: `keep="momentum"` keeps (μ, π),
    as where nothing acts while the parameters change; `keep="velocity"` keeps (ξ, ν) of the node, as where a dropped
    mass takes its momentum along. Raises ArgumentError where neither is given.
    """
    if keep is not None:
        checks.choice(keep, "keep", get_args(Keep))
    before, plain = start.origin.system, going_on(start)
    if before is None or start.from_velocities:
        if keep == "velocity" and not start.from_velocities:
            raise ArgumentError('keep="velocity" needs a record of a run: of this start only the momentum is known.')
        return plain, None
    changed = _changed(before.parameters, system.parameters)
    if not changed:
        return plain, None
    if keep is None:
        raise ArgumentError(
            f'The start is a record of a run with other parameters, {changed}: say what stays, keep="momentum" for '
            'μ and π, so that velocities change, or keep="velocity" for ξ and ν.'
        )
    kept = f"The run continues with the {keep} of a record; {changed}."
    if keep == "momentum":
        return plain, kept
    xi, nu = _velocities(before, plain)
    return plain.replace(xi=xi, nu=nu, from_velocities=True), kept


def going_on(start: State) -> State:
    """The state from which a run continues: a record that shows the velocities of the node gets those of the step
    again.

    They are Newton's next guess, with which the run continues bitwise identically to an undivided one.
    """
    if (before := of_step(start)) is not None:
        return before.replace(origin=Origin())
    plain, unknowns = start.replace(origin=Origin()), start.origin.unknowns
    if unknowns is None or start.from_velocities or traced(start):
        return plain
    shapes = [np.shape(part) for part in (start.xi, start.nu)]
    return plain.replace(xi=unknowns[0], nu=unknowns[1]) if shapes == [np.shape(part) for part in unknowns] else plain


def _velocities(system: System, state: State) -> tuple[PyTree, PyTree]:
    return evaluate(lambda s, p: velocities(replace_parameters(system, p), s), state, system.parameters)


def _changed(before: Parameters | None, after: Parameters | None) -> str:
    """Which parameters differ, in words; nothing where all are the same, or where numbers are not known."""
    if traced(before, after):
        return ""
    old, new = (
        {jax.tree_util.keystr(path, simple=True, separator="."): leaf for path, leaf in _leaves(tree)}
        for tree in (before, after)
    )
    names = [name for name in {**old, **new} if not _same(old.get(name), new.get(name))]
    return f"{', '.join(f'`{name}`' for name in names)} changed" if names else ""


def _leaves(tree: PyTree) -> PyTree:
    return jax.tree_util.tree_leaves_with_path(tree)


def _same(one: Any, other: Any) -> bool:
    try:
        return bool(np.array_equal(one, other))
    except (TypeError, ValueError):
        return False
