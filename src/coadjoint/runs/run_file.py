"""Run files: a run as TOML, checked before anything heavy is loaded."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from coadjoint import checks
from coadjoint import units as u
from coadjoint.errors import ArgumentError, FileError, rephrased
from coadjoint.extensions import Registry, absent, import_string
from coadjoint.report.folder import kept_inputs
from coadjoint.runs.initial import initial_values
from coadjoint.runs.runnable import Runnable
from coadjoint.runs.sections import MethodSection, OutputSection, RunSection, SystemSection
from coadjoint.runs.toml_text import to_toml
from coadjoint.sections import in_si, of_section, without_unit
from coadjoint.texts import Table, file_text, read_table, too_long

if TYPE_CHECKING:
    from coadjoint.mechanics.state import State
    from coadjoint.mechanics.system import System
    from coadjoint.runs.setup import Setup
    from coadjoint.simulation.run import Run

KINDS: Registry[str] = Registry("RUN_FILES")
"""Other kinds of run files, by a section of theirs: "module:function", (table, path, text) → the file."""


@dataclass(frozen=True, kw_only=True)
class RunFile(Runnable):
    """A run: its system with parameters and initial values, its method, its grid, its output.

    `parameters` and `initial` are keywords of the system's maker and of its start, in SI units.
    """

    system: SystemSection
    parameters: Table = field(default_factory=dict)
    initial: Table = field(default_factory=dict)
    SECTIONS: ClassVar = {"system": SystemSection, "method": MethodSection, "run": RunSection, "output": OutputSection}
    FREE: ClassVar = ("parameters", "initial")
    NEEDED: ClassVar = ("system", "run")

    @property
    def names(self) -> list[str]:
        return [self.system.factory.rsplit(":", 1)[0]] if self.system.factory else []

    @property
    def written_in_python(self) -> bool:
        return bool(self.system.factory)

    @property
    def code(self) -> list[Path]:
        home = self.path.parent.resolve()
        found = [path.resolve() for name, path in self.inputs.items() if name not in self.places]
        return [path for path in found if not path.is_relative_to(home)]

    @property
    def maker(self) -> Callable[[Table, Table], tuple[System, State]]:
        """The maker of the system and its start from sections [parameters] and [initial]."""
        if self.system.factory:
            from coadjoint.runs.factory import maker

            return maker(self.system.factory, self.located(self.names[0]))
        return self._of_catalogue

    def _of_catalogue(self, parameters: dict[str, object], initial: dict[str, object]) -> tuple[System, State]:
        from coadjoint.models import catalogue

        entry = catalogue[self.system.model]
        what = f"Model `{self.system.model}` cannot be made from [parameters] and [initial]"
        with rephrased(what, TypeError, ValueError, kind=ArgumentError):
            with of_section("parameters"):
                system = entry.make(**parameters)
            with of_section("initial"):
                return system, entry.start(system, **initial)

    def set_up(self) -> Setup:
        from coadjoint.runs.setup import Setup

        return Setup(*self.maker(self.parameters, self.initial))

    def results(self, folder: Path, run: Run) -> tuple[Table, list[str]]:
        from coadjoint.labelled import of_run
        from coadjoint.plotting.plots import save_figures

        if self.output.figures is False:
            return {}, []
        names = None if self.output.figures is True else self.output.figures
        return {}, save_figures([of_run(run)], folder, names, self.output.format)


def read(path: str | Path, changes: Sequence[str] = ()) -> Runnable:
    """The run in a TOML file, of a system or of another kind, with `changes` such as "run.dt=0.02".

    Raises FileError for a file that cannot be read or is not TOML, ArgumentError for unknown sections, keys and values.
    """
    source = Path(path)
    text = file_text(source, "run file")
    table = read_table(text, source)
    try:
        _require_short(table)
    except OverflowError as error:
        raise too_long(source) from error
    _require_run(table, source)
    for change in changes:
        _apply(table, change)
    if changes:
        text = f"# {source.name} with {', '.join(changes)}\n\n{to_toml(table)}"
    return replace(of_table(table, source, text), places=kept_inputs(source))


def of_table(table: dict[str, object], source: Path, text: str) -> Runnable:
    """The run in a table, of a system or of another kind; raises ArgumentError for unknown sections, keys and
    values."""
    if "vehicle" in table and "vehicle" not in KINDS:
        raise ArgumentError(absent(f"The section [vehicle] of {source}"))
    readers = [reader for section, reader in KINDS.items() if section in table]
    return import_string(readers[0])(table, source, text) if readers else from_table(table, source, text)


def _require_run(table: dict[str, object], source: Path) -> None:
    """Raise ArgumentError for a file that is empty, or of a vehicle, and say which command takes it."""
    if not table:
        raise ArgumentError(
            f"The file {source} is empty: `coadjoint models NAME` prints a run file to start from, and `coadjoint "
            "vehicles mission NAME` a mission file."
        )
    if "sweep" in table:
        raise ArgumentError(
            f"{source} is a sweep, not a run: `coadjoint sweep FILE`, with the file that it was written from, begins "
            "it, or continues it."
        )
    if "body" in table:
        raise ArgumentError(
            f"{source} is a vehicle file, not a run: `coadjoint vehicles show {source}` shows it, and `coadjoint "
            f"vehicles mission {source}` prints a mission of it, which `coadjoint run` takes."
        )


def from_table(table: Table, path: Path, text: str) -> RunFile:
    """The run in a table of sections; raises ArgumentError."""
    if "mission" in table:
        raise ArgumentError(f"The mission file {path} needs a section [vehicle].")
    made = RunFile.sections(table, path)
    for name in RunFile.FREE:
        _require_rectangular(name, made[name])
    if made["system"].model:
        made |= _of_model(made["system"].model, made)
    return RunFile(path=path, text=text, **made)


def _require_short(value: object) -> None:
    """Raise OverflowError for an integer too large for a float."""
    if isinstance(value, (dict, list)):
        for inner in value.values() if isinstance(value, dict) else value:
            _require_short(inner)
    elif isinstance(value, int):
        float(value)


def _require_rectangular(name: str, given: Table) -> None:
    for key, value in given.items():
        # An element g of a product is a list of arrays of several shapes.
        if key != "g" and isinstance(value, list) and not _rectangular(value):
            raise ArgumentError(f"[{name}] {key} must hold numbers in rows of one length, but is {value!r}.")


def _rectangular(value: list[Any]) -> bool:
    if all(isinstance(inner, list) for inner in value):
        return len({len(inner) for inner in value}) <= 1 and all(map(_rectangular, value))
    return not any(isinstance(inner, list) for inner in value)


def _of_model(model: str, free: dict[str, Table]) -> dict[str, Table]:
    """Parameters and initial values under the names of a model of the catalogue, in SI units."""
    from coadjoint.models import catalogue

    checks.known(model, catalogue, "model", "The catalogue")
    entry = catalogue[model]
    return {
        "parameters": in_si("parameters", free["parameters"], entry.parameters, MEASURES),
        "initial": initial_values(free["initial"], entry.initial),
    }


MEASURES = {
    "mass": u.MASS,
    "buoyancy": u.FORCE,
    "center_of_mass": u.LENGTH,
    "center_of_buoyancy": u.LENGTH,
    "semi_axes": u.LENGTH,
    "gravity": u.ACCELERATION,
    "fluid_density": u.DENSITY,
    "volume": u.VOLUME,
    "inertia": u.INERTIA,
    **dict.fromkeys(("added_mass", "inertia_about")),
}
"""The quantities of the parameters of the catalogue's models."""


def _apply(table: dict[str, object], change: str) -> None:
    """Make a change "section.key=value" to a table; the value is TOML, and a text if it is not valid TOML.

    It replaces the same key in another unit too; with nothing behind the = the key, or section, is left out.
    """
    name, equals, value = change.partition("=")
    keys = name.strip().split(".")
    if equals and len(keys) == 1 and not value.strip():
        table.pop(keys[0], None)
        return
    fits = equals and (len(keys) >= 2 or keys == ["axes"]) and all(keys)
    checks.expect(fits, change, "A change with --set", "section.key=value, as in run.dt=0.02")
    try:
        parsed = read_table(f"value = {value}", "")["value"]
    except FileError:
        parsed = value
    put(table, keys, parsed if value.strip() else None, "A change with --set", change)


def put(table: dict[str, object], keys: Sequence[str], value: object, what: str, change: str) -> None:
    """Put a value in the place of the same key, in another unit too; None leaves the key out.

    Raises ArgumentError, which begins with `what` and shows the `change`, for a key of a value that is not a section.
    """
    inner = table
    for key in keys[:-1]:
        inner = inner.setdefault(key, {})
        if not isinstance(inner, dict):
            raise ArgumentError(f"{what} must name a key of a section, but `{key}` of {change!r} is none.")
    for key in [key for key in inner if without_unit(key) == without_unit(keys[-1])]:
        del inner[key]
    if value is not None:
        inner[keys[-1]] = value


def declared() -> dict[str, type]:
    """The sections of run files, whose fields are their keys."""
    return RunFile.SECTIONS
