"""Inputs of a log: commands in the units of their actuators, and the current."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.identification.log import Log
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.spaces.named import Named
from coadjoint.units import same

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
        if name in units and given != "1" and not same(given, wanted):
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
        checks.known(name, commanded, "commanded actuator", "Argument `still`: the system")
        checks.leave_out(name in log.inputs, "one of them", f"`still` names `{name}`, but the log holds its commands")
    missing = [name for name in commanded if name not in log.inputs and name not in still]
    if missing:
        columns = ", ".join(f"`command_{name}` ({units[name]})" for name in missing)
        raise ArgumentError(
            f"The log holds no commands of {', '.join(missing)}: add {columns}, or declare that it stays where it "
            "starts, "
            f"still={missing} or --still {' '.join(missing)}."
        )


def with_current(
    system: System, log: Log, parameters: Sequence[str], process_noise: Sequence[str]
) -> tuple[Sequence[str], list[str]]:
    """The unknowns with the water's velocity where the log holds a current that the model lacks, and a note on it.

    Raises ArgumentError where the model has no such velocity, or where the current is not steady.
    """
    if not log.current or isinstance(parameters, str) or any("water" in name for name in (*parameters, *process_noise)):
        return parameters, []
    velocity, adrift = _water(system)
    names = ("north", "east", "down")
    logged = np.stack([log.current.get(name, np.zeros(len(log))) for name in names])
    if _size(logged) < STILL or (adrift and velocity is None):
        return parameters, []
    known = np.zeros(3) if velocity is None else np.resize(np.append(np.asarray(velocity, float), 0.0), 3)
    least = max(STILL, SAME * _size(logged))
    if _size(logged - known[:, None]) < least:
        return parameters, []
    mean = np.nanmean(logged, axis=1)
    steady = _size(logged - mean[:, None]) < least
    if velocity is None or not steady:
        raise ArgumentError(_lacking(log, logged, known, velocity is not None))
    count = 3 if abs(mean[2] - known[2]) >= STILL else 2
    found = [f"water.velocity[{k}]" for k in range(min(count, np.size(velocity)))]
    said = f"{', '.join(found[:-1])} and {found[-1]}"
    return [*parameters, *found], [
        f"The log holds a current of {_size(logged):.2g} m/s, which the water of the model lacks: {said} are estimated "
        "as well."
    ]


def _water(system: System) -> tuple[PyTree, bool]:
    """The parameter of a velocity of the water, None without one; and whether there are other parameters of it."""
    water = getattr(system.parameters, "water", None) if system.parameters and "water" in system.parameters else None
    velocity = getattr(water, "velocity", None) if isinstance(water, Named) and "velocity" in water else None
    return velocity, water is not None


def lacks_current(system: System, log: Log, sought: Sequence[str]) -> bool:
    """Whether the model has a steady velocity of the water that the log does not hold and nobody seeks."""
    return not log.current and _water(system)[0] is not None and not any("water" in name for name in sought)


def _size(velocity: np.ndarray) -> float:
    """The root mean square of velocities (3, n)."""
    return float(np.sqrt(np.nanmean(np.sum(velocity**2, axis=0))))


def _lacking(log: Log, logged: np.ndarray, known: np.ndarray, sought: bool) -> str:
    """The sentence on a current that cannot be estimated as one velocity."""
    mean = ", ".join(f"{value:.2g}" for value in np.nanmean(logged, axis=1))
    columns = ", ".join(f'"current_{name}"' for name in log.current)
    seek = (
        'it is not steady: estimate it by process_noise=["water.velocity"], '
        if sought
        else "the model needs a velocity of the water that can be estimated; "
    )
    return (
        f"The log holds a current of {_size(logged):.2g} m/s (north, east, down: {mean} m/s on average), but the water "
        f"of the model moves at {', '.join(f'{value:.2g}' for value in known)} m/s, and the parameters would take up "
        f"the difference; {seek}or leave the columns out when the log is read, ignore=[{columns}]."
    )
