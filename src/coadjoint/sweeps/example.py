"""A commented sweep file to start from, for a run file or a mission file."""

from __future__ import annotations

import os
from pathlib import Path

from coadjoint.checks import is_number
from coadjoint.errors import ArgumentError
from coadjoint.texts import file_text, read_table

SECTIONS = ("parameters", "initial", "mission", "controller", "run")
"""The sections in which a number to vary is sought, in this order."""


def example(source: Path) -> str:
    """A sweep of the first number that a run file has, from 5 % below to 5 % above it.

    Raises FileError for a file that cannot be read, ArgumentError for one without a number.
    """
    table = read_table(file_text(source), source)
    for section in SECTIONS:
        held = table.get(section)
        for key, value in held.items() if isinstance(held, dict) else ():
            if is_number(value) and value and key not in ("dt", "steps", "save_every", "duration", "seed"):
                low, high = sorted((0.95 * float(value), 1.05 * float(value)))
                return _TEXT.format(name=os.path.basename(source), section=section, key=key, low=low, high=high)
    raise ArgumentError(
        f"The file {source} has no number in {', '.join(f'[{one}]' for one in SECTIONS)} to vary: write one into it."
    )


_TEXT = """# A sweep of {name}: `coadjoint sweep THIS.toml --check`, then without --check.
# The same command again computes the members that are missing.

[sweep]
run = "{name}"  # the run file or mission file, next to this file
sampling = "grid"  # grid, list, random, latin_hypercube, sobol; the last three need `members`
# members = 64
# seed = 1

# [vary.SECTION] has the keys of a section of the run file. A key takes a list, a range, or numbers at random:
#   {{ from = 1.0, to = 2.0, count = 5 }}, {{ from = 1.0, to = 2.0 }}, {{ mean = 1.0, deviation = 0.1 }}
[vary.{section}]
{key} = {{ from = {low:.6g}, to = {high:.6g}, count = 5 }}

# [results]
# variables = ["energy"]  # those that are kept, by default all of the run
"""
