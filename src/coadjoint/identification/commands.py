"""Commands that a log must hold, in the units of what they command."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.identification.log import Log
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.spaces.named import Named


def require_commands(system: System, start: State, log: Log, still: Sequence[str]) -> None:
    """Raise ArgumentError for commands in units of another kind, and for actuators without a command.

    Those named in `still` have none, because they stay where `start` has them.
    """
    units = {name.removeprefix("inputs_"): unit for name, unit in system.units if name.startswith("inputs_")}
    for name in log.inputs:
        given, wanted = log.units.get(name, "1"), units.get(name, "1")
        if name in units and given not in ("1", wanted):
            raise ArgumentError(
                f"The log's commands of `{name}` are in {given}, but `{name}` takes {wanted}: give them in that unit."
            )
    parts = start.internal.asdict() if isinstance(start.internal, Named) else {}
    commanded = [] if "controller" in parts else [name for name in parts if name in units]
    for name in commanded:
        if name in log.inputs and np.size(parts[name]) != log.inputs[name][0].size:
            raise ArgumentError(
                f"The log holds {log.inputs[name][0].size} commands of `{name}`, which takes {np.size(parts[name])}."
            )
    for name in still:
        if name not in commanded:
            raise ArgumentError(
                f"`still` names `{name}`, but what is commanded is {', '.join(commanded) or 'nothing'}."
            )
        if name in log.inputs:
            raise ArgumentError(f"`still` names `{name}`, but the log holds its commands: leave out one of them.")
    missing = [name for name in commanded if name not in log.inputs and name not in still]
    if missing:
        columns = ", ".join(f"`command_{name}` ({units[name]})" for name in missing)
        raise ArgumentError(
            f"The log holds no commands of {', '.join(missing)}: add {columns}, or say that it stays where it starts, "
            f"still={missing} or --still {' '.join(missing)}."
        )
