"""Functional mock-up units (FMI 2.0, co-simulation) of steppers, for other simulators; PythonFMU writes them."""

from __future__ import annotations

import os
import re
import secrets
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from coadjoint import checks
from coadjoint.errors import ArgumentError
from coadjoint.simulation.steppers.code_archive import save
from coadjoint.simulation.steppers.file import to_bytes
from coadjoint.simulation.steppers.stepping import Stepping

_SCRIPT = '''"""The unit `{name}`: a saved stepper of coadjoint."""

from coadjoint.simulation.steppers.fmi_instance import FmiInstance, hold

hold(globals())


class {name}(FmiInstance):
    """What the unit's binary makes."""
'''


def save_fmu(stepper: Stepping, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Write a functional mock-up unit (FMI 2.0, co-simulation) of a stepper, for other simulators.

        co.simulation.save_fmu(stepper, "remus.fmu")

    stepper: a `co.Stepper`, or one loaded by `co.load_stepper`. path: the file. overwrite: whether to replace one.

    Commands are its inputs and observations its outputs; arrays are split into numbers with indices from 1. A
    communication step is an integer multiple of dt. The unit starts from the current state of the stepper, can save and
    restore its state, and runs where this library is installed for the Python that loads it; parameters are the
    stepper's. Needs the extra `[fmu]`. Raises FileError rather than replace a file, ArgumentError for a stepper of many
    members or by XLA, for a name that is not ASCII, and for a name of both a command and an observation.
    """
    checks.expect(isinstance(stepper, Stepping), stepper, "stepper", "a co.Stepper")
    return save(path, overwrite, lambda target: _unit(stepper, target.stem))


def _unit(stepper: Stepping, stem: str) -> bytes:
    """A stepper as the content of a unit called after `stem`."""
    builder = checks.library("pythonfmu.builder", "Functional mock-up units need", "coadjoint[fmu]", "PythonFMU")
    from coadjoint.simulation.steppers.fmi_instance import FILE, variables

    if stepper.face.members is not None:
        raise ArgumentError(
            f"A functional mock-up unit holds one vehicle, but this stepper has {stepper.face.members}: make one "
            "without `members`."
        )
    for name in (*stepper.face.commands.names, *stepper.face.observations.names):
        if not name.isascii():
            raise ArgumentError(
                f"In a functional mock-up unit names are ASCII, but `{name}` is not: call it otherwise."
            )
    counted = Counter([*variables(stepper.face.commands), *variables(stepper.face.observations)])
    if twice := [name for name, count in counted.items() if count > 1]:
        raise ArgumentError(
            f"`{twice[0]}` is a command and is observed, too, but all variables of a functional mock-up unit need "
            "names of their own: observe it under another name."
        )
    name = re.sub(r"\W", "_", stem, flags=re.ASCII)
    name = name if re.match("[A-Za-z]", name) else f"unit_{name}"
    path, module = sys.path.copy(), f"coadjoint_{name}_{secrets.token_hex(4)}"
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        (here / FILE).write_bytes(to_bytes(stepper))
        (here / f"{module}.py").write_text(_SCRIPT.format(name=name), encoding="utf-8")
        options: Any = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True}
        try:
            built = builder.FmuBuilder.build_FMU(
                here / f"{module}.py", dest=here / "unit.fmu", project_files=[here / FILE], **options
            )
        finally:  # PythonFMU imports the script
            sys.path[:] = path
            sys.modules.pop(module, None)
        return Path(built).read_bytes()
