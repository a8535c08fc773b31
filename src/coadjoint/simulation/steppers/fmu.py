"""Functional mock-up units (FMI 2.0, co-simulation) of steppers, by Python or compiled, with units of variables."""

from __future__ import annotations

import io
import os
import re
import secrets
import sys
import tempfile
import zipfile
from collections import Counter
from collections.abc import Mapping
from math import pi
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, fromstring, tostring

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.simulation.steppers.code_archive import save
from coadjoint.simulation.steppers.compiled_fmu import compiled_unit
from coadjoint.simulation.steppers.fields import variables
from coadjoint.simulation.steppers.file import to_bytes
from coadjoint.simulation.steppers.stepping import Stepping
from coadjoint.units import Powers, unit_of

BASE = ("kg", "m", "s", "rad", "A")
"""The base units of FMI that units here are made of; a revolution is 2π rad."""

_SCRIPT = '''"""The unit `{name}`: a saved stepper of coadjoint."""

from coadjoint.simulation.steppers.fmi_instance import FmiInstance, hold

hold(globals())


class {name}(FmiInstance):
    """What the unit's binary makes."""
'''


def save_fmu(
    stepper: Stepping,
    path: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    units: Mapping[str, str] | None = None,
    python: bool = True,
) -> Path:
    """Write a functional mock-up unit (FMI 2.0, co-simulation) of a stepper, for other simulators.

        co.simulation.save_fmu(stepper, "remus.fmu")

    stepper: a `co.Stepper`, or one loaded by `co.load_stepper`. path: the file. overwrite: whether to replace one.
    units: name of a command or an observation → its unit, as {"depth": "m"}, which the unit declares. python: whether
    the unit runs by Python, or by the machine code alone, behind FMI's functions in C.

    Commands are its inputs and observations its outputs; arrays are split into numbers with indices from 1. A
    communication step is an integer multiple of dt. The unit starts from the current state of the stepper, can save and
    restore its state; parameters are the stepper's. By Python it runs where this library is installed for the Python
    that loads it, and needs the extra `[fmu]`. Without, it runs on this kind of processor, needs the C compiler `cc`
    now, and judges no steps. Raises FileError rather than replace a file, ArgumentError for a stepper of many
    members or by XLA, for a name that is not ASCII, for a name of both a command and an observation, and for
    unknown units.
    """
    checks.expect(isinstance(stepper, Stepping), stepper, "stepper", "a co.Stepper")
    units = dict(units or {})
    for name in units:
        known = (*stepper.face.commands.names, *stepper.face.observations.names)
        checks.known(name, known, "command or observation", "The stepper")
        unit_of(units[name], f"`{name}` of `units`")
    by_python = checks.truth(python, "python")

    def content(target: Path) -> bytes:
        name = _named(stepper, target.stem)
        return _with_units(_by_python(stepper, name) if by_python else compiled_unit(stepper, name), units)

    return save(path, overwrite, content)


def _named(stepper: Stepping, stem: str) -> str:
    """The name of a unit called after `stem`; raises ArgumentError for a stepper that cannot be one."""
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
    return name if re.match("[A-Za-z]", name) else f"unit_{name}"


def _by_python(stepper: Stepping, name: str) -> bytes:
    """A stepper as the content of a unit that Python runs."""
    builder = checks.library("pythonfmu.builder", "Functional mock-up units need", "coadjoint[fmu]", "PythonFMU")
    from coadjoint.simulation.steppers.fmi_instance import FILE

    path, module = sys.path.copy(), f"coadjoint_{name}_{secrets.token_hex(4)}"
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        (here / FILE).write_bytes(to_bytes(stepper))
        (here / f"{module}.py").write_text(_SCRIPT.format(name=name), encoding="utf-8")
        options: dict[str, PyTree] = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True}
        try:
            built = builder.FmuBuilder.build_FMU(
                here / f"{module}.py", dest=here / "unit.fmu", project_files=[here / FILE], **options
            )
        finally:  # PythonFMU imports the script
            sys.path[:] = path
            sys.modules.pop(module, None)
        return Path(built).read_bytes()


def _with_units(content: bytes, units: dict[str, str]) -> bytes:
    """A unit whose description declares the units of variables, name → unit as in "rad/s" (FMI 2.0, 2.2.2)."""
    if not units:
        return content
    kept = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as before, zipfile.ZipFile(kept, "w", zipfile.ZIP_DEFLATED) as after:
        for part in before.infolist():
            data = before.read(part)
            after.writestr(part, _declared(data, units) if part.filename == "modelDescription.xml" else data)
    return kept.getvalue()


def _declared(description: bytes, units: dict[str, str]) -> bytes:
    root = fromstring(description)
    declared = Element("UnitDefinitions")
    for unit in dict.fromkeys(units.values()):
        factor, powers = unit_of(unit, "A variable")
        SubElement(SubElement(declared, "Unit", {"name": unit}), "BaseUnit", _base(factor, powers))
    root.insert([one.tag for one in root].index("CoSimulation") + 1, declared)
    for scalar in root.iter("ScalarVariable"):
        if unit := units.get(scalar.attrib["name"].partition("[")[0]):
            next(scalar.iter("Real")).set("unit", unit)
    return tostring(root, "utf-8", xml_declaration=True)


def _base(factor: float, powers: Powers) -> dict[str, str]:
    mass, length, time, angle, turns, current = powers
    factor *= (2.0 * pi) ** turns
    found = dict(zip(BASE, (mass, length, time, angle + turns, current), strict=True))
    if any(power != int(power) for power in found.values()):
        raise ArgumentError("A variable of a functional mock-up unit has a unit with a root, which FMI does not know.")
    exponents = {name: str(int(power)) for name, power in found.items() if power}
    return exponents | ({"factor": repr(factor)} if factor != 1.0 else {})
