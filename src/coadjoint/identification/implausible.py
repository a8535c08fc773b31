"""Columns of a log that cannot be what they are named: degrees as radians, heights as depths, rates turned around."""

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

DEGREES, SURE, NEAR = 180 / np.pi, 10.0, 0.25
"""How many times faster an angle in degrees turns; how many standard errors, and which part of it, are no chance."""

UPRIGHT = 0.8
"""rad of roll and pitch within which a heading turns the way of its rate."""


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
    """Sentences of angles that turn otherwise than their rates say."""
    found = []
    tilt = np.max([np.abs(columns[name]) for name in ("roll", "pitch") if name in columns], axis=0, initial=0.0)
    upright = np.broadcast_to(tilt < UPRIGHT, time.shape)
    for angle, rate in TURNS.items():
        if units.get(angle) != "rad" or units.get(rate) != "rad/s" or not {angle, rate} <= set(columns):
            continue
        slope, error = _slope(time, columns[angle], columns[rate], np.full(time.shape, True))
        for factor, one, other in ((DEGREES, angle, rate), (1 / DEGREES, rate, angle)):
            if abs(abs(slope) / factor - 1) < NEAR and abs(slope) > SURE * error:
                found.append(
                    f"`{angle}` turns {abs(slope):.2g} times as fast as `{rate}` says: `{one}` looks like degrees read "
                    f"as radians, or `{other}` like radians read as degrees; see to the units of both."
                )
        slope, error = _slope(time, columns[angle], columns[rate], upright)
        if abs(slope + 1) < NEAR and abs(slope) > SURE * error:
            found.append(
                f"`{angle}` turns against `{rate}`: heading is positive to starboard, pitch nose up, and rates are "
                "about x forward, y to starboard, z down; declare the `axes` of the log."
            )
    return found


def _slope(time: np.ndarray, angle: np.ndarray, rate: np.ndarray, here: np.ndarray) -> tuple[float, float]:
    """b of Δangle = b ∫rate dt by least squares over neighbouring samples, and its standard error; jumps by a turn, and
    samples that are not `here`, apart. (0, ∞) where there are too few."""
    turned, moved = np.diff(angle), np.diff(time) * (rate[1:] + rate[:-1]) / 2
    good = np.isfinite(turned) & np.isfinite(moved) & (np.abs(turned) < np.pi) & here[1:] & here[:-1]
    turned, moved = turned[good], moved[good]
    square = moved @ moved
    if len(moved) < 10 or not square > 0:
        return 0.0, np.inf
    b = turned @ moved / square
    rest = turned - b * moved
    return float(b), float(np.sqrt(rest @ rest / (len(moved) - 1) / square))
