"""Runs whose records are on disk."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, cast

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.mechanics.state import State
from coadjoint.simulation.dataset import attributes, member_coordinates
from coadjoint.simulation.plan import Extrema
from coadjoint.simulation.reading import stored_dataset
from coadjoint.simulation.result import Result
from coadjoint.simulation.run import Ensemble, Run
from coadjoint.simulation.store import Store

if TYPE_CHECKING:
    import xarray


class _OnDisk(Result):
    """What runs and ensembles have in common when a store takes their records."""

    @property
    def store(self) -> Store:
        """Where the records are: what this run has in place of `memory`."""
        return cast(Store, self.memory)

    @property
    def count(self) -> int:
        return self.store.count

    @cached_property
    def steps_saved(self) -> np.ndarray:
        return self.dataset["step"].values

    @cached_property
    def records(self) -> State:
        raise ArgumentError(
            f"The records of this run are on disk, in {self.store.folder}: use `run.dataset`, which reads them when "
            "needed, or `run.final`, the last of them."
        )

    @cached_property
    def monitors(self) -> dict[str, np.ndarray]:
        return {name: self.dataset[name].values for name in self.ends}

    @property
    def ends(self) -> Extrema:
        return self.store.ends

    @property
    def last_record(self) -> State:
        if self.store.last is None:
            raise ArgumentError("This run holds no records: its first step failed, or it has not begun.")
        return self.store.last

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The records as a labelled xarray dataset, read from the disk when they are used."""
        return stored_dataset(self.store.manifest, self.count, attributes(self), member_coordinates(self))


class StreamedRun(_OnDisk, Run):
    """What `co.simulate(…, store=DIR)` and `co.resume(DIR, …)` return: as `Run`, but read from the disk when used."""

    @property
    def last_record(self) -> State:
        return self._of_this(super().last_record)


class StreamedEnsemble(_OnDisk, Ensemble):
    """The same for many members: as `Ensemble`, but read from the disk when used."""
