"""`coadjoint verify`: whether the files of a folder are unchanged."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from coadjoint.cli import terminal
from coadjoint.cli.metavars import called

OK, DAMAGED = 0, 1


@dataclass(frozen=True)
class Verify:
    """Compare every file of a folder of results with its manifest: `coadjoint verify dive`; status 0 if all agree."""

    BEGINS: ClassVar[str] = "Reading {folder}."

    folder: Annotated[tyro.conf.Positional[Path], called("DIR")]
    """A folder that `run` or `reproduce` wrote, finished or not, or one that co.simulate(store=…) wrote."""
    json: bool = False
    """Print the result as JSON, and nothing else."""

    def __call__(self) -> int:
        from coadjoint.report.verification import verify

        found = verify(self.folder)
        if found.unfinished_sweep:
            from coadjoint.sweeps.store import MEMBERS, done, problems

            found.problems += [
                sentence for number in sorted(done(self.folder)) for sentence in problems(self.folder, number)
            ]
            found.unknown = [name for name in found.unknown if not Path(name).is_relative_to(self.folder / MEMBERS)]
        if self.json:
            result = {"complete": found.complete, "files": found.files, "problems": found.problems}
            terminal.json({**result, "unknown": found.unknown})
        else:
            for sentence in found.problems:
                terminal.line(sentence)
            if found.passed:
                state = "a finished run" if found.complete else "an unfinished run"
                terminal.line(
                    f"{self.folder} holds {state}: {found.files} files are unchanged since they were written."
                )
            for name in found.unknown:
                terminal.line(f"{name} does not belong to the run.")
        return OK if found.passed else DAMAGED
