"""Columns of a log that cannot be what they are named: degrees as radians, heights as depths."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from coadjoint.units import jumps_by_degrees

STEEPEST, SELDOM = np.pi, 0.01
"""The pitch, rad, beyond which no Euler angle ZYX is, for as large a part of the samples that is not outliers alone."""

HIGHEST = 3.0
"""m above the surface, where the middle of all depths is no error of a sensor."""

TURNS = {"roll": "p", "pitch": "q", "heading": "r"}
"""Which rate turns which Euler angle, where the others are small."""

DEGREES = 180 / np.pi
"""How many times as fast an angle turns in degrees as in radians."""

NEAR, ALIKE, LEAST = 0.25, 0.7, 30
"""How near to that a slope must be, relatively; the correlation, and the pairs of samples, from which on it tells."""

APART = 2.5
"""Samples so many intervals apart are not neighbours."""


def implausible(time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str]) -> list[str]:
    """A sentence for each column (n,) whose numbers, NaN aside, cannot be meant.

    time: s, (n,). units: by column, as of a `Log`.
    """
    told = {}
    for name, values in columns.items():
        known = values[np.isfinite(values)]
        if units.get(name) == "rad" and jumps_by_degrees(known):
            told[name] = (
                f"`{name}` jumps by 360 from one sample to the next, as degrees do and radians never: name the column "
                f"`{name}_deg`, or give np.radians of it."
            )
        elif name == "pitch" and np.mean(np.abs(known) > STEEPEST) > SELDOM:
            told[name] = (
                "`pitch` goes beyond 3.14 rad, but an Euler angle ZYX is at most 1.57: of degrees name the column "
                "`pitch_deg`, or give np.radians of it."
            )
        elif name == "depth" and np.median(known) < -HIGHEST:
            told[name] = (
                "Most of `depth` is above the surface: it is positive down. Name heights `up_m`, read z of ENU by "
                "`axes`, and declare the `surface_pressure` of a sensor that tells no absolute pressure."
            )
    others = {name: values for name, values in columns.items() if name not in told}
    return [*told.values(), *_against_rates(time, others, units)]


def _against_rates(time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str]) -> list[str]:
    """Sentences of angles that turn 57 times as fast, or as slowly, as their rates say."""
    found = []
    for angle, rate in TURNS.items():
        if units.get(angle) != "rad" or units.get(rate) != "rad/s" or not {angle, rate} <= set(columns):
            continue
        slope = abs(_slope(time, columns[angle], columns[rate]))
        for factor, way, one, other in ((DEGREES, "fast", angle, rate), (1 / DEGREES, "slowly", rate, angle)):
            if abs(slope / factor - 1) < NEAR:
                found.append(
                    f"`{angle}` turns some 57 times as {way} as `{rate}` says: `{one}` looks like degrees read as "
                    f"radians, or `{other}` like radians read as degrees; see to the units of both."
                )
    return found


def _slope(time: np.ndarray, angle: np.ndarray, rate: np.ndarray) -> float:
    """b of Δangle = b ∫rate dt by least squares over neighbouring samples without a gap between them and without jumps
    by a turn; 0 where these are few, or hardly correlated."""
    step = np.diff(time)
    turned, moved = np.diff(angle), step * (rate[1:] + rate[:-1]) / 2
    good = np.isfinite(turned) & np.isfinite(moved) & (step < APART * np.median(step))
    good &= np.abs(turned) < np.pi
    turned, moved = turned[good], moved[good]
    sizes = np.linalg.norm(turned), np.linalg.norm(moved)
    if len(moved) < LEAST or not min(sizes) > 0:
        return 0.0
    b, correlation = turned @ moved / sizes[1] ** 2, turned @ moved / (sizes[0] * sizes[1])
    return float(b) if abs(correlation) > ALIKE else 0.0
