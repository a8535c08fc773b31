"""Consistency of the motion in a log with its speeds and rates: times, lengths and angles in wrong units.

    b = Σ Δx ∫v dt / Σ (∫v dt)²,  Δx = x(t_{k+L}) − x(t_k),

is 1 for a correct log. Times in ms read as s make every b a thousandth; a depth in cm makes its b 100.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

TURNS = {"roll": "p", "pitch": "q", "heading": "r"}
"""The rate of each Euler angle, where the others are small."""

DEGREES = 180 / np.pi
"""The ratio of angles in degrees and in radians."""

NEAR, ALIKE, LEAST = 0.25, 0.7, 30
"""The relative distance of b from a factor, and the least correlation and number of pairs of samples."""

SURE, BETTER, DEFICIT = 0.95, 0.2, 0.02
"""The least correlation of displacements with a heading in another unit; the part of the deficit from 1 with the given
unit that may remain, and the least deficit."""

APART = 2.5
"""Samples so many intervals apart are not neighbours."""

WINDOWS = 20
"""A displacement is over a sample, or over this part of the log, whichever is better correlated."""

SPARSE = 10.0
"""s between samples, from which on a log hardly resolves the motion of a vehicle."""

CLOCKS = {1e-3: "ms", 1e-6: "us", 1e-9: "ns"}
LENGTHS = {100.0: "cm", 1000.0: "mm", 1e-3: "km"}


def inconsistent(time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str]) -> list[str]:
    """Sentences on units that cannot be right together. time: s, (n,); units: by column, as of a `Log`."""
    turned = _turns(time, columns, units)
    moved = _moves(time, columns)
    every = [b for b in (*turned.values(), *moved.values()) if b]
    for factor, unit in CLOCKS.items():
        if every and all(_is(b, factor) for b in every):
            by = "angles turn" if turned and any(turned.values()) else "positions move"
            other = "" if by == "angles turn" else ", or positions like km read as m"
            return [
                f"`time` runs some {1 / factor:.0f} times as fast as it should, judged by {by} and their rates: it "
                "looks like "
                f"{unit} read as s{other}; name the column `time_{unit}`, or give seconds."
            ]
    found = []
    for (angle, rate), b in turned.items():
        for factor, way, one, other in ((DEGREES, "fast", angle, rate), (1 / DEGREES, "slowly", rate, angle)):
            if _is(b, factor):
                found.append(
                    f"`{angle}` turns some 57 times as {way} as `{rate}` implies: `{one}` looks like degrees read as "
                    f"radians, or `{other}` like radians read as degrees; check the units of both."
                )
    for name, b in moved.items():
        for factor, unit in LENGTHS.items():
            if _is(b, factor):
                found.append(
                    f"`{name}` moves some {_times(factor)} as the velocity implies: it looks like {unit} read as m; "
                    "name "
                    f"the column `{name}_{unit}`, or give metres."
                )
    # If an angle agrees with its rate, and positions with the heading, the heading is right.
    right = _is(turned.get(("heading", "r"), 0.0), 1.0) or all(_is(moved.get(n, 0.0), 1.0) for n in ("north", "east"))
    return found if found or right else _heading(time, columns)


def undecided(time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str]) -> list[str]:
    """A sentence on samples that are far apart, if no speed or rate shows whether times are in seconds."""
    between = float(np.median(np.diff(time)))
    if (
        between < SPARSE
        or len(time) < LEAST
        or any((*_turns(time, columns, units).values(), *_moves(time, columns).values()))
    ):
        return []
    return [
        f"Samples are {between:.6g} s apart, and nothing in the log confirms it: if times are in ms, name the column "
        "`time_ms`."
    ]


def _times(factor: float) -> str:
    return f"{factor:.0f} times as fast" if factor > 1 else f"{1 / factor:.0f} times as slowly"


def _is(b: float, factor: float) -> bool:
    return abs(abs(b) / factor - 1) < NEAR


def _turns(
    time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str]
) -> dict[tuple[str, str], float]:
    """b of each angle with its rate, 0 if unknown."""
    return {
        (angle, rate): _slope(time, [columns[angle]], [columns[rate]], np.pi)[0]
        for angle, rate in TURNS.items()
        if units.get(angle) == "rad" and units.get(rate) == "rad/s" and {angle, rate} <= set(columns)
    }


def _moves(time: np.ndarray, columns: Mapping[str, np.ndarray]) -> dict[str, float]:
    """b of positions with the velocity along their axis, 0 if unknown."""
    speeds = _in_space(time, columns)
    return {name: _slope(time, [columns[name]], [speed])[0] for name, speed in speeds.items() if name in columns}


def _in_space(time: np.ndarray, columns: Mapping[str, np.ndarray], turned: float = 1.0) -> dict[str, np.ndarray]:
    """R v by the columns of positions, with `turned` times the heading; v and w, roll and pitch count as 0 where they
    are missing."""
    if "u" not in columns:
        return {}
    velocity = [columns.get(name, np.zeros(len(time))) for name in "uvw"]
    angles = [_between(time, columns[n], time) if n in columns else np.zeros(len(time)) for n in ("roll", "pitch")]
    (sr, sp), (cr, cp) = np.sin(angles), np.cos(angles)
    u, v, w = velocity
    found = {}
    if "w" in columns or "pitch" in columns:
        found["depth"] = -u * sp + v * sr * cp + w * cr * cp
    if "heading" in columns:
        psi = turned * _between(time, columns["heading"], time)
        ahead, aside = u * cp + v * sr * sp + w * cr * sp, v * cr - w * sr
        found["north"], found["east"] = (
            ahead * np.cos(psi) - aside * np.sin(psi),
            ahead * np.sin(psi) + aside * np.cos(psi),
        )
    return found


def _heading(time: np.ndarray, columns: Mapping[str, np.ndarray]) -> list[str]:
    """A sentence where the vehicle moves along a heading in another unit."""
    if not {"north", "east", "heading", "u"} <= set(columns):
        return []

    def alike(turned: float) -> float:
        speeds = _in_space(time, columns, turned)
        return _slope(time, [columns[n] for n in ("north", "east")], [speeds[n] for n in ("north", "east")])[1]

    missing = 1 - alike(1.0)
    if missing < DEFICIT:
        return []
    for turned, told, meant in ((DEGREES, "deg", "rad"), (1 / DEGREES, "rad", "deg")):
        if (found := alike(turned)) > SURE and 1 - found < BETTER * missing:
            return [
                f"The vehicle does not move where `heading` points, but would if that were {meant} read as "
                f"{told}: name "
                f"the column `heading_{meant}`, or give {told}."
            ]
    return []


def _slope(
    time: np.ndarray, places: list[np.ndarray], speeds: list[np.ndarray], turn: float = np.inf
) -> tuple[float, float]:
    """(b, correlation) of displacements with ∫v dt over windows without a gap; (0, 0) where windows are few, and b = 0
    where they are hardly correlated. turn: the least step from one sample to the next that is a wrapped angle."""
    good = np.all(np.isfinite(places), axis=0)
    heard = np.all(np.isfinite(speeds), axis=0)
    if min(good.sum(), heard.sum()) <= LEAST:
        return 0.0, 0.0
    at, t = time[good], time[heard]
    step = np.diff(t)
    apart = np.append(0.0, np.cumsum(np.where(step < APART * np.median(step), 0.0, step)))
    bad = np.diff(np.interp(at, t, apart)) > 0
    bad |= (at[1:] > t[-1]) | (at[:-1] < t[0]) | (np.diff(at) >= APART * np.median(np.diff(at)))
    moved, driven = [], []
    for place, speed in zip(places, speeds, strict=True):
        v, x = speed[heard], place[good]
        bad |= np.abs(np.diff(x)) >= turn
        driven.append(np.diff(np.interp(at, t, np.append(0.0, np.cumsum(step * (v[1:] + v[:-1]) / 2)))))
        moved.append(np.diff(x))
    return max((_regressed(moved, driven, bad, L) for L in {1, max(1, len(bad) // WINDOWS)}), key=lambda both: both[1])


def _regressed(moved: list[np.ndarray], driven: list[np.ndarray], bad: np.ndarray, L: int) -> tuple[float, float]:
    """(b, |correlation|) over windows of L intervals."""
    free = _windows(bad, L) == 0
    if free.sum() < LEAST:
        return 0.0, 0.0
    x, y = (np.concatenate([_windows(np.where(bad, 0.0, p), L)[free] for p in parts]) for parts in (moved, driven))
    sizes = np.linalg.norm(x), np.linalg.norm(y)
    if not min(sizes) > 0:
        return 0.0, 0.0
    correlation = float(abs(x @ y) / (sizes[0] * sizes[1]))
    return (float(x @ y / sizes[1] ** 2) if correlation > ALIKE else 0.0), correlation


def _windows(values: np.ndarray, L: int) -> np.ndarray:
    """Sums of L neighbours."""
    total = np.append(0.0, np.cumsum(values))
    return total[L:] - total[:-L]


def _between(time: np.ndarray, angle: np.ndarray, at: np.ndarray) -> np.ndarray:
    """An angle interpolated between the times at which it is known."""
    known = np.isfinite(angle)
    return np.interp(at, time[known], np.unwrap(angle[known]))
