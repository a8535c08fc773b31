"""Missions from Python: `co.vehicles.load_mission("square.toml").run()`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from coadjoint.errors import ArgumentError, warn
from coadjoint.extending import Setup
from coadjoint.extending import read_run_file as read
from coadjoint.labelled import of_run
from coadjoint_vehicles.missions.file import MissionFile

if TYPE_CHECKING:
    from coadjoint.extending import Written
    from coadjoint.simulation import Ensemble, Run


class Mission:
    """A mission file, read and checked: `run()` in memory, `write(folder)` as `coadjoint run` does.

    `setup` is the system with its start, its inputs and its end event, for `co.simulate`, `co.Stepper` and the like.
    """

    def __init__(self, file: MissionFile):
        self.file = file

    @cached_property
    def setup(self) -> Setup:
        """The system, its start, its inputs and the event that ends it; warns of doubtful values.

        Raises ArgumentError and FileError.
        """
        made = self.file.set_up()
        for sentence in made.warnings:
            warn(sentence, stacklevel=3)
        return made

    def run(self, *, progress: bool | None = None) -> Run | Ensemble:
        """The run of the mission, with way points and the vehicle's length among its attributes; with [sensors] its
        dataset has their readings.

        Raises ArgumentError and LagrangianError before the run; StepError, with the result so far, at a step that
        fails.
        """
        from coadjoint.extending import simulate_setup as simulate

        run = simulate(self.file, self.setup, progress)
        of_run(run).attrs.update(self.setup.attributes)
        self.file.observe(run)
        run.warnings += [*self.setup.warnings, *self.file.warnings(run)]
        return run

    def write(
        self, folder: str | os.PathLike[str] | None = None, *, overwrite: bool = False, progress: bool | None = None
    ) -> Written:
        """Run the mission and write trajectory, log, figures and summary to `folder`, by default that of the file.

        Raises FileError where the folder holds another run or cannot be written.
        """
        from coadjoint.extending import execute

        return execute(self.file, self.file.folder if folder is None else Path(folder), overwrite, progress)

    def __repr__(self) -> str:
        return f"<Mission of {self.file.vehicle.name or self.file.vehicle.file} in {self.file.path}>"


def load_mission(path: str | os.PathLike[str], changes: Sequence[str] = ()) -> Mission:
    """The mission in a TOML file, with `changes` such as "run.dt=0.02".

    Raises FileError for a file that cannot be read, ArgumentError for unknown keys and for a file without a mission.
    """
    file = read(Path(path), changes)
    if not isinstance(file, MissionFile):
        raise ArgumentError(f"The run file {path} is of no vehicle: a mission needs a section [vehicle].")
    return Mission(file)
