"""Actuators at their limits, or commanded to be: for what part of a run, and what of the wanted wrench is lost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.allocator import AXES
from coadjoint_vehicles.parts.part import Part
from coadjoint_vehicles.parts.thrusters import Thrusters

NEAR = 1e-3
"""The part of a limit by which an actuator at it may be short of it."""
OFTEN = 0.1
"""The part of a run at limits above which the run warns."""
NOTICED = 1e-6
"""N, N m: a missing force or torque that is more than round-off."""
UNITS = ("N", "N", "N", "N m", "N m", "N m")


def at_limits(values: np.ndarray, ends: Sequence[PyTree], each: bool) -> np.ndarray:
    """Where an actuator is at a limit, that is not 0, of values (…) or, of several thrusters, (…, n): any of them.

    A command beyond a limit is at it.
    """
    low, high = (np.asarray(end, dtype=float) for end in ends)
    found = (low != 0) & (values <= low + NEAR * np.abs(low))
    found |= (high != 0) & (values >= high - NEAR * np.abs(high))
    return np.any(found, axis=-1) if each else found


def short(missing: np.ndarray, rounding: PyTree = 0.0) -> np.ndarray:
    """Where a part of the wanted wrench is missing, of W − B f at nodes, (…, 6), beyond that of dead bands, (6,)."""
    sizes = np.abs(missing)
    return np.any(sizes > np.maximum(max(NOTICED, NEAR * float(np.max(sizes, initial=0.0))), rounding), axis=-1)


def lost(missing: np.ndarray) -> dict[str, dict[str, float]]:
    """The mean and the largest |W − B f| along each axis, N or N m, of W − B f at nodes, (…, 6)."""
    sizes = np.abs(missing).reshape(-1, 6)
    mean, most = sizes.mean(axis=0), sizes.max(axis=0)
    return {axis: {"mean": float(mean[i]), "max": float(most[i])} for i, axis in enumerate(AXES)}


def saturated(
    commanded: Sequence[Part], ranges: dict[str, tuple[PyTree, PyTree]], stretches: Sequence[Named]
) -> Iterator[str]:
    """A sentence for each actuator that for more than OFTEN of the saved nodes is kept at a limit, or gives too little.

    ranges: their lowest and highest values. stretches: the internal states of a run, (nodes, [members,] …) each.
    """
    steered = getattr(stretches[0], "controller", None)
    for part in commanded:
        if steered is None or part.name not in steered.value or part.name not in ranges:
            continue
        at = np.concatenate([_at_limits(part, one, ranges[part.name]) for one in stretches])
        lacking = np.concatenate([_lacking(part, one) for one in stretches])
        limited, shares = (np.atleast_1d(np.mean(where, axis=0)) for where in (at, at | lacking))
        worst = int(np.argmax(shares))
        if shares[worst] <= OFTEN:
            continue
        said = _lacks([one.controller.value for one in stretches], worst)
        many = f"Of member {worst}, and of {np.sum(shares > OFTEN) - 1} others of {len(shares)}, "
        lacks = f"; it lacks {said} of what the controller asks for, in the mean" if said else ""
        if limited[worst] > OFTEN:
            happens, share = "is at its limits", limited[worst]
            remedy = "ask for less speed or slower changes, or give it more thrust"
        else:
            happens, share = "gives less than the controller asks for, though not at its limits,", shares[worst]
            remedy = (
                "ask for less speed or slower changes, or raise the limits of the controller (`surge_limit` and "
                "`heave_limit` of `manoeuvre`); thrusters of one direction and dead bands have the same effect"
            )
        yield f"{many if at.ndim > 1 else ''}`{part.name}` {happens} for {share:.0%} of the time{lacks}: {remedy}."


def _at_limits(part: Part, one: Named, ends: tuple[PyTree, PyTree]) -> np.ndarray:
    """Where a part, its command or one of its thrusters is at a limit."""
    each = part.command is not None and part.command.shape != ()
    wanted = np.asarray(getattr(one.controller.value, part.name), dtype=float)
    if part.no_signal is not None:
        wanted = np.where(wanted == part.no_signal, np.nan, wanted)
    found = at_limits(wanted, ends, each)
    if part.units is None:
        found |= at_limits(np.asarray(getattr(one, part.name)), ends, each)
    return found


def _lacking(part: Part, one: Named) -> np.ndarray:
    """Where thrusters lack a part of their wrench."""
    missing = _missing(one.controller.value)
    if not isinstance(part, Thrusters) or missing is None:
        shape = np.shape(getattr(one.controller.value, part.name))
        return np.zeros(shape[: len(shape) - len(part.command.shape if part.command else ())], dtype=bool)
    return short(missing, part.rounding)


def _missing(value: Named) -> np.ndarray | None:
    """What thrusters fall short by at nodes, (…, 6), if their controller, or the one at its helm, remembers."""
    memory = value.memory if "memory" in value else None
    while memory is not None and "lost" not in memory:
        memory = memory.helm if "helm" in memory else None
    return None if memory is None else np.asarray(memory.lost)


def _lacks(samples: Sequence[Named], member: int) -> str:
    """What thrusters fall short by, in the mean over a run: "12 N of surge"; empty if their controller does not say."""
    found = [rows for one in samples if (rows := _missing(one)) is not None]
    if not found:
        return ""
    sizes = lost(np.concatenate([rows[:, member] if rows.ndim > 2 else rows for rows in found]))
    least = 1e-9 * max(size["max"] for size in sizes.values())
    units: dict[str, str] = dict(zip(AXES, UNITS, strict=True))
    return ", ".join(f"{s['mean']:.3g} {units[axis]} of {axis}" for axis, s in sizes.items() if s["max"] > least)
