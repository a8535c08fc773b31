"""Columns of a log that cannot be what they are named: degrees as radians, heights as depths."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from coadjoint.units import jumps_by_degrees

STEEPEST, SELDOM = np.pi, 0.01
"""The pitch, rad, beyond which no Euler angle ZYX is, for as large a part of the samples that is not outliers alone."""

HIGHEST = 3.0
"""m above the surface, where the middle of all depths is no error of a sensor."""


def implausible(columns: Mapping[str, np.ndarray], units: Mapping[str, str]) -> list[str]:
    """A sentence for each column (n,) whose numbers, NaN aside, cannot be meant; units: by column, as of a `Log`."""
    found = []
    for name, values in columns.items():
        known = values[np.isfinite(values)]
        if units.get(name) == "rad" and jumps_by_degrees(known):
            found.append(
                f"`{name}` jumps by 360 from one sample to the next, as degrees do and radians never: name the column "
                f"`{name}_deg`, or give np.radians of it."
            )
        elif name == "pitch" and np.mean(np.abs(known) > STEEPEST) > SELDOM:
            found.append(
                "`pitch` goes beyond 3.14 rad, but an Euler angle ZYX is at most 1.57: of degrees name the column "
                "`pitch_deg`, or give np.radians of it."
            )
        elif name == "depth" and np.median(known) < -HIGHEST:
            found.append(
                "Most of `depth` is above the surface: it is positive down. Name heights `up_m`, read z of ENU by "
                "`axes`, and declare the `surface_pressure` of a sensor that tells no absolute pressure."
            )
    return found
