"""Inputs of a log: commands in the units of their actuators, and the current."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.identification.log import Log
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.spaces.named import Named

STILL = 0.01
"""m/s, the root mean square below which a current, or a difference of currents, is negligible."""

SAME = 0.1
"""The part of the current that the model may lack."""


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
                f"`still` names `{name}`, but the commanded actuators are {', '.join(commanded) or 'none'}."
            )
        if name in log.inputs:
            raise ArgumentError(f"`still` names `{name}`, but the log holds its commands: leave out one of them.")
    missing = [name for name in commanded if name not in log.inputs and name not in still]
    if missing:
        columns = ", ".join(f"`command_{name}` ({units[name]})" for name in missing)
        raise ArgumentError(
            f"The log holds no commands of {', '.join(missing)}: add {columns}, or declare that it stays where it "
            "starts, "
            f"still={missing} or --still {' '.join(missing)}."
        )


def require_current(system: System, log: Log, parameters: Sequence[str], process_noise: Sequence[str]) -> None:
    """Raise ArgumentError if the log holds a current that the model lacks, unless it is estimated."""
    if not log.current or any("water" in name for name in (*parameters, *process_noise)):
        return
    names = ("north", "east", "down")
    logged = np.stack([log.current.get(name, np.zeros(len(log))) for name in names])
    speed = float(np.sqrt(np.nanmean(np.sum(logged**2, axis=0))))
    water = getattr(system.parameters, "water", None) if system.parameters and "water" in system.parameters else None
    velocity = getattr(water, "velocity", None) if isinstance(water, Named) and "velocity" in water else None
    if speed < STILL or (water is not None and velocity is None):
        return
    known = np.zeros(3) if velocity is None else np.resize(np.append(np.asarray(velocity, float), 0.0), 3)
    off = float(np.sqrt(np.nanmean(np.sum((logged - known[:, None]) ** 2, axis=0))))
    if off < max(STILL, SAME * speed):
        return
    mean = ", ".join(f"{value:.2g}" for value in np.nanmean(logged, axis=1))
    columns = ", ".join(f'"current_{name}"' for name in log.current)
    seek = (
        'estimate it, as "water.velocity[0]" and "water.velocity[1]" among `parameters`, or '
        'process_noise=["water.velocity"] '
        "if it is not steady; "
        if velocity is not None
        else "the model needs a velocity of the water that can be estimated; "
    )
    raise ArgumentError(
        f"The log holds a current of {speed:.2g} m/s (north, east, down: {mean} m/s on average), but the water of the "
        f"model moves at {', '.join(f'{value:.2g}' for value in known)} m/s, and the parameters would take up the "
        f"difference: {seek}or leave the columns out when the log is read, ignore=[{columns}]."
    )
