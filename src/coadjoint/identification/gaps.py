"""What a log lacks, told: values, rows, and whole stretches."""

from __future__ import annotations

import numpy as np

from coadjoint.identification.log import Log
from coadjoint.identification.sampling import Samples

LONGER = 1.5
"""From which multiple of the usual time between samples on rows count as missing."""

REGULAR = 0.1
"""Rows that are this part of the usual time off a multiple of it are irregular, and nobody knows which are missing."""

MOST = 3
"""How many gaps are told one by one."""


def gaps(log: Log, samples: Samples) -> list[str]:
    """Sentences on values and rows that are missing, where the log does not tell that itself."""
    told = _values(log)
    usual, between = log.interval, np.diff(log.time)
    first, last = samples.rows[:, 0], samples.rows.max(axis=1)
    apart = np.zeros(len(between), bool)
    apart[first[samples.after_gap] - 1] = True
    short = (between > LONGER * usual) & ~apart
    if short.any() and np.all(np.abs(between / usual - np.rint(between / usual)) < REGULAR):
        count, longest = int(np.rint(between[short] / usual - 1).sum()), between[short].max() - usual
        told.append(
            f"{count} rows are missing, up to {longest:.3g} s at a time: inputs count as they run "
            "between the rows that are there."
        )
    for i in np.flatnonzero(apart)[:MOST]:
        before = last[last <= i].max()
        told.append(
            f"The log has a gap from {log.time[before]:.5g} to {log.time[i + 1]:.5g} s: what came in between is not "
            "used, and the simulation begins anew after it, with actuators as the log has them, or as commanded."
        )
    if (more := int(apart.sum()) - MOST) > 0:
        told.append(f"There are {more} more such gaps.")
    return told


def _values(log: Log) -> list[str]:
    """On columns with missing values of which the notes of the log do not tell, one sentence."""
    missing = {name: int(np.isnan(values).sum()) for name, values in log.columns.items()}
    new = {n: k for n, k in missing.items() if k and f"{k} of {len(log)} values of {n} are missing." not in log.notes}
    if len(new) == 1:
        ((name, count),) = new.items()
        return [f"{count} of {len(log)} values of {name} are missing."]
    listed = ", ".join(f"{count} of {name}" for name, count in new.items())
    return [f"Of {len(log)} values are missing: {listed}."] if new else []
