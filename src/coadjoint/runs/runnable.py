"""The base of all kinds of run files: a grid, a method, an output, and the writing of results."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from coadjoint import checks, sections
from coadjoint.errors import ArgumentError, FileError
from coadjoint.runs.methods import map_name, method_name
from coadjoint.runs.sections import MethodSection, OutputSection, RunSection
from coadjoint.texts import Table

if TYPE_CHECKING:
    from coadjoint.mechanics.members import Each
    from coadjoint.runs.setup import Setup
    from coadjoint.simulation.run import Run


@dataclass(frozen=True, kw_only=True)
class Runnable(ABC):
    """A run as given by a file. `path` is its origin, `text` is copied into the output folder."""

    run: RunSection
    method: MethodSection = field(default_factory=MethodSection)
    output: OutputSection = field(default_factory=OutputSection)
    path: Path = Path("run.toml")
    text: str = ""
    places: Mapping[str, Path] = field(default_factory=dict)
    """The paths of files that it names, if they are not in its folder."""
    WORD: ClassVar[str] = "run file"
    """The name of such a file in messages."""
    SECTIONS: ClassVar[dict[str, type]] = {}
    """The sections that are dataclasses, by name."""
    FREE: ClassVar[tuple[str, ...]] = ()
    """The sections that are kept as plain tables."""
    NEEDED: ClassVar[tuple[str, ...]] = ("run",)
    """The required sections."""

    @classmethod
    def sections(cls, table: Mapping[str, Any], path: Path) -> Table:
        """The sections of a file by name; raises ArgumentError, also for unknown methods and maps."""
        known = [*cls.SECTIONS, *cls.FREE]
        for name, given in table.items():
            checks.known(name, known, "section", f"A {cls.WORD}")
            checks.instance(given, f"[{name}]", dict, f"a section of a {cls.WORD}")
        for name in cls.NEEDED:
            if name not in table:
                raise ArgumentError(f"The {cls.WORD} {path} needs a section [{name}].")
        made: Table = {name: sections.read(kind, name, table.get(name, {})) for name, kind in cls.SECTIONS.items()}
        chosen = made["method"]
        for name in (chosen.name, *([chosen.base] if chosen.base else [])):
            method_name(name)
        map_name(chosen.map)
        return {**made, **{name: table.get(name, {}) for name in cls.FREE}}

    @property
    def folder(self) -> Path:
        """The output folder: `[output] folder`, relative to the working directory, or the name of the file."""
        return Path(self.output.folder or self.path.stem)

    @property
    @abstractmethod
    def names(self) -> list[str]:
        """The files that it names; they are kept with the results."""

    @property
    def written_in_python(self) -> bool:
        """Whether a file of Python defines the run."""
        return False

    @property
    def inputs(self) -> dict[str, Path]:
        """The paths of the files that it names; raises FileError if one is missing."""
        return {name: self.located(name) for name in self.names}

    @property
    def code(self) -> list[Path]:
        """Files of Python outside of the folder of the file that it would run."""
        return []

    def located(self, name: object) -> Path:
        """A file that it names, in its folder or in the folder of results; raises FileError."""
        if not isinstance(name, str):
            raise ArgumentError(f"The name of a file must be a text, but in {self.path} is {name!r}.")
        found = self.places.get(name, self.path.parent / name)
        if not os.path.isfile(found):  # no error for names that no file can have
            raise FileError(f"There is no file {found}, which {self.path} names.")
        return found

    def with_seeds(self, seeds: Each) -> Self:
        """The same run with a seed of random numbers for each member; itself where it draws none."""
        return self

    @abstractmethod
    def set_up(self) -> Setup:
        """The system, the state that it starts from, and what drives it; raises ArgumentError and FileError."""

    def warnings(self, run: Run) -> list[str]:
        """Warnings about a run in addition to its certificate."""
        return []

    def observe(self, run: Run) -> None:  # noqa: B027 — by default nothing is
        """Put observed quantities besides the motion into the dataset of a run that has ended."""

    @abstractmethod
    def results(self, folder: Path, run: Run) -> tuple[Table, list[str]]:
        """Write the results of a run besides its trajectory: the entries of the summary, and the names of the figures.

        A summary with "members" is complete; the certificate is added to any other.
        """
