"""What every kind of run file has: a grid, a method, an output, and a way to results."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from coadjoint.runs.sections import MethodSection, OutputSection, RunSection

if TYPE_CHECKING:
    from coadjoint.runs.setup import Setup
    from coadjoint.simulation.run import Run


@dataclass(frozen=True, kw_only=True)
class Runnable(ABC):
    """A run as a file states it. `path` is where it came from, `text` what is copied into the output folder."""

    run: RunSection
    method: MethodSection = field(default_factory=MethodSection)
    output: OutputSection = field(default_factory=OutputSection)
    path: Path = Path("run.toml")
    text: str = ""

    @property
    def folder(self) -> Path:
        """The output folder: `[output] folder`, relative to the working directory, or the name of the file."""
        return Path(self.output.folder or self.path.stem)

    @property
    @abstractmethod
    def companions(self) -> list[Path]:
        """The files that it names; they are kept beside the results. Raises FileError where one is not there."""

    def beside_results(self) -> Self:
        """The file as it reads in the folder of results, where its companions lie beside it."""
        return self

    @abstractmethod
    def set_up(self) -> Setup:
        """The system, the state that it starts from, and what drives it; raises ArgumentError and FileError."""

    def warnings(self, run: Run) -> list[str]:
        """What is to be said of a run beside its certificate."""
        return []

    @abstractmethod
    def results(self, folder: Path, run: Run) -> tuple[dict[str, Any], list[str]]:
        """Write what belongs to a run beside its trajectory: what the summary says, and the names of the figures.

        A summary with "members" is all that is said; of another the certificate is a part.
        """
