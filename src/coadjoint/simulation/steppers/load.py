"""Steppers from files, without JAX."""

from __future__ import annotations

import os

from coadjoint.errors import FileError
from coadjoint.simulation.steppers.numbers import named_file
from coadjoint.simulation.steppers.stepping import Stepping, opened


def load_stepper(path: str | os.PathLike[str]) -> Stepping:
    """The stepper that `stepper.save(path)` wrote: it stands where that one stood. JAX is not imported.

        stepper = co.load_stepper("remus.step")

    path: the file. It steps to the bit like the one that was saved, on the same processor; `state`, `reset` and
    `restore` take and give numbers by their names, `change` keeps momenta, and an event stops it at the node before.
    The file holds machine code that is run: load only what you would run as a program. Raises FileError for what is no
    such file, and for one of a newer version.
    """
    path = named_file(path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FileError(f"The file {path} cannot be read: {error.strerror or error}.") from error
    try:
        return opened(content)
    except FileError as error:
        raise FileError(f"The file {path} {error}") from None
