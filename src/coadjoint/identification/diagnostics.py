"""Diagnostics of an identification: one sentence for each problem."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from coadjoint.identification.fitting import ROUNDS
from coadjoint.identification.log import Log
from coadjoint.identification.sampling import Samples
from coadjoint.identification.sensor_model import SENSORS
from coadjoint.identification.smoothing import noise as rough_noise
from coadjoint.identification.unknowns import Estimate

COARSE = 0.3
"""How many standard errors a shift by the step size must reach for a warning."""

ALIKE, VAGUE, COLOURED = 0.98, 0.5, 0.2
"""|correlation| of two parameters, interval over estimate, lag-one correlation of residuals, that give a warning."""

NOTHING = 0.05
"""Relative to the prior value: an interval within this range that contains zero shows that the parameter vanishes."""

STRONGEST = 3
"""The largest number of names in a sentence on parameters that cannot be separated."""

WILD, SWALLOWED = 20.0, 0.7
"""Residuals over the noise between neighbouring samples, and over the signal's own spread, that give a warning."""

LONGER = 1.5
"""Rows count as missing from this multiple of the usual time between samples on."""

REGULAR = 0.1
"""Rows that deviate from a multiple of the usual time by this part of it are irregular, and missing ones are
unknown."""

NOISELESS = 1e-3
"""The median over the columns of noise to signal below which a log is that of a simulation."""

UNMOVED = {"depth", "roll", "pitch", "heading", "q", "r"}
"""Columns that a steady current leaves alone."""

MOST = 3
"""The number of gaps that are listed one by one."""


def hidden(estimates: dict[str, Estimate], hidden: np.ndarray, V: np.ndarray, lost: np.ndarray) -> list[str]:
    names, shared = list(estimates), np.zeros(len(estimates), bool)
    found: dict[str, None] = {}
    for row in np.abs(V[lost]):
        if np.sum(row > 1e-2) > 1:
            shared |= row > 1e-2
            strongest = sorted(sorted(np.flatnonzero(row > 1e-2), key=lambda i: -row[i])[:STRONGEST])
            others = int(np.sum(row > 1e-2)) - len(strongest)
            listed = " and ".join(names[i] for i in strongest) + (
                f", with {others} other{'s' if others > 1 else ''}" if others else ""
            )
            found[
                f"The log cannot separate {listed}: keep one of them at its known value, or take a log in which their "
                "effects differ, as by commands that change separately."
            ] = None
    alone = [names[i] for i in np.flatnonzero(hidden & ~shared)]
    return list(found) + [
        f"The log contains no information on {name}: its motion does not depend on it." for name in alone
    ]


def vague(estimates: dict[str, Estimate]) -> list[str]:
    """Wide intervals, relative to the value, or of values that may be zero, for which no relative width exists. Sensors
    may well have no bias and no delay, and a value that is negligible relative to its prior, such as the effectiveness
    of a failed thruster, is well determined."""
    sentences = []
    for e in estimates.values():
        if e.name.startswith(SENSORS):
            continue
        if np.isfinite(e.standard_error) and e.low <= 0 <= e.high:
            if e.high - e.low < 2 * NOTHING * abs(e.prior):
                continue
            sentences.append(
                f"The log does not distinguish {e.name} from zero: its interval is {e.low:.3g} to {e.high:.3g}."
            )
        elif np.isfinite(e.standard_error) and e.high - e.low > 2 * VAGUE * abs(e.value):
            half = (e.high - e.low) / 2 / abs(e.value)
            sentences.append(f"The log hardly excites {e.name}: its interval is ±{half:.0%}.")
    return sentences


def missed(log: Log, names: tuple[str, ...], rms: np.ndarray, estimated: np.ndarray) -> list[str]:
    """Residuals that are not noise: far above the noise between neighbouring samples, or as large as the signal."""
    found = []
    for name, off, own in zip(names, rms, estimated, strict=True):
        if not own:
            continue
        turning, values = log.units.get(name) == "rad", log.columns[name][np.isfinite(log.columns[name])]
        typical = rough_noise(log, name)
        signal = float(np.std(np.unwrap(values) if turning else values))
        far = off > WILD * typical or (off > SWALLOWED * signal and off > 3 * typical) or (turning and off > 1.0)
        if far:
            found.append(f"{name} ({np.degrees(off):.3g}°)" if turning else f"{name} ({off:.3g})")
    if not found:
        return []
    return [
        f"The simulation misses {', '.join(found)} by far more than the noise between neighbouring samples: check axes "
        "and units of the log, and that no command is missing; do not rely on the intervals."
    ]


def alike(estimates: dict[str, Estimate], correlation: np.ndarray, hidden: np.ndarray) -> list[str]:
    names = list(estimates)
    pairs = [(i, j) for i in range(len(names)) for j in range(i) if not (hidden[i] or hidden[j])]
    return [
        f"{names[j]} and {names[i]} are hard to separate: correlation {correlation[i, j]:.3f}."
        for i, j in pairs
        if abs(correlation[i, j]) > ALIKE
    ]


def coloured(whiteness: dict[str, float], there: np.ndarray, names: tuple[str, ...]) -> list[str]:
    counts = there.sum(axis=(0, 1))
    found = [
        f"{name} ({whiteness[name]:.2f})"
        for name, count in zip(names, counts, strict=True)
        if abs(whiteness[name]) > max(COLOURED, 4 / np.sqrt(count))
    ]
    if not found:
        return []
    return [
        f"Residuals of {', '.join(found)} are correlated (lag-one correlation): the model or the noise is not as "
        "assumed, and the intervals may be too narrow."
    ]


def likely_causes(log: Log, whiteness: Mapping[str, float], step: float | None, current: bool) -> list[str]:
    """What may lie behind correlated residuals: the steps of a simulation that wrote the log, or an unknown current.

    A current moves the places of a vehicle in the plane and leaves depth, attitude and rates as the model has them.
    step: the one that is known, s. current: whether the model has a current that is neither logged nor estimated.
    """
    correlated = {name for name, value in whiteness.items() if abs(value) > COLOURED}
    if not correlated:
        return []
    found = []
    quiet = [rough_noise(log, name) / size for name in whiteness if (size := float(np.nanstd(log.columns[name]))) > 0]
    if step is None and quiet and np.median(quiet) < NOISELESS:
        found.append(
            "The log has hardly any noise, as if a simulation wrote it: give the step of that simulation, dt= or --dt; "
            "other warnings may come from the difference between its steps and those of the fit."
        )
    if current and {"north", "east"} <= correlated and not correlated & UNMOVED:
        found.append(
            "Only places in the plane and velocities depart from the model, as in a current that the log does not "
            'hold: add "water.velocity[0]" and "water.velocity[1]" to the parameters.'
        )
    return found


def unsettled(changed: dict[str, float]) -> list[str]:
    """Parts of the noise that still changed after the last round of least squares."""
    if not changed:
        return []
    worst, rest = max(changed, key=lambda name: changed[name]), len(changed) - 1
    others = f", and {rest} more {'numbers' if rest > 1 else 'number'} of its kind" if rest else ""
    return [
        f"After {ROUNDS} rounds of least squares the {worst}{others} still changed, by {changed[worst]:.0%} in the "
        "last: the intervals are that uncertain; give known values in `noise`, or name less in `coloured` and "
        "`process_noise`."
    ]


def misjudged(names: tuple[str, ...], rms: np.ndarray, sigma: np.ndarray, estimated: np.ndarray) -> list[str]:
    return [
        f"The noise of {name} was given as {s:.3g}, but the residuals have {r:.3g}."
        for name, r, s, own in zip(names, rms, sigma, estimated, strict=True)
        if not own and not 0.7 < r / s < 1.3
    ]


def handed_on(internal: tuple[str, ...], segments: int) -> list[str]:
    """Where segments begin with an internal state whose derivative is not known."""
    if not internal:
        return []
    names, verb = ", ".join(f"`{name}`" for name in internal), "depends" if len(internal) == 1 else "depend"
    return [
        f"The internal state {names} {verb} on the motion, but what a parameter does to it is not followed through the "
        f"starts of the {segments} segments: parameters may be off by more than their intervals; take the log as one "
        "run, segment=None or --segment 0, and cut it at its gaps."
    ]


def coarse(estimates: dict[str, Estimate], shift: np.ndarray, h: float) -> list[str]:
    """A warning if the step size shifts a parameter by a large part of its standard error."""
    if not len(shift) or not np.nanmax(shift) > COARSE:
        return []
    worst = int(np.nanargmax(shift))
    return [
        f"The step dt = {h:g} s shifts {list(estimates)[worst]} by {shift[worst]:.1f} standard errors: take a smaller "
        "one, or leave it out."
    ]


def gaps(log: Log, samples: Samples) -> list[str]:
    """Sentences on missing values and rows that the notes of the log do not mention, and on gaps within its runs."""
    told = _values(log)
    usual, between = log.interval, np.diff(log.time)
    first, last = samples.rows[:, 0], samples.rows.max(axis=1)
    apart = np.zeros(len(between), bool)
    apart[first[samples.after_gap] - 1] = True
    short = (between > LONGER * usual) & ~apart
    if short.any() and np.all(np.abs(between / usual - np.rint(between / usual)) < REGULAR):
        count, longest = int(np.rint(between[short] / usual - 1).sum()), between[short].max() - usual
        told.append(
            f"{count} rows are missing, up to {longest:.3g} s at a time: inputs are interpolated between the existing "
            "rows."
        )
    apart[np.array(log.breaks, int) - 1] = False
    for i in np.flatnonzero(apart)[:MOST]:
        before = last[last <= i].max()
        told.append(
            f"The log has a gap from {log.time[before]:.5g} to {log.time[i + 1]:.5g} s: the time in between is not "
            "used, and the simulation begins again after it, with actuators as logged, or as commanded."
        )
    if (more := int(apart.sum()) - MOST) > 0:
        told.append(f"There are {more} more such gaps.")
    return told


def _values(log: Log) -> list[str]:
    """One sentence on columns with missing values that the notes of the log do not mention."""
    missing = {name: int(np.isnan(values).sum()) for name, values in log.columns.items()}
    new = {n: k for n, k in missing.items() if k and f"{k} of {len(log)} values of {n} are missing." not in log.notes}
    if len(new) == 1:
        ((name, count),) = new.items()
        return [f"{count} of {len(log)} values of {name} are missing."]
    listed = ", ".join(f"{count} of {name}" for name, count in new.items())
    return [f"Of {len(log)} values are missing: {listed}."] if new else []
