"""Runs whose records are on disk."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.mechanics.state import State
from coadjoint.simulation.dataset import attributes, ensemble_attributes, member_coordinates
from coadjoint.simulation.derived import at_nodes, derivation
from coadjoint.simulation.driver import Extrema
from coadjoint.simulation.ensemble import Ensemble
from coadjoint.simulation.reading import stored_dataset
from coadjoint.simulation.recording import Recording
from coadjoint.simulation.run import Run
from coadjoint.simulation.store import Store

if TYPE_CHECKING:
    import xarray


class _OnDisk(Recording):
    """What runs and ensembles have in common when a store takes their records."""

    memory: Any

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


class StreamedRun(_OnDisk, Run):
    """What `co.simulate(…, store=DIR)` and `co.resume(DIR, …)` return: as `Run`, but read from the disk when used."""

    @property
    def last_record(self) -> State:
        if self.store.last is None:
            raise ArgumentError("This run holds no records: its first step failed.")
        return self._of_this(self.store.last)

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The records as a labelled xarray dataset, read from the disk when they are used."""
        return stored_dataset(self.store.manifest, self.count, attributes(self))


class StreamedEnsemble(_OnDisk, Ensemble):
    """The same for many members: as `Ensemble`, but read from the disk when used."""

    @property
    def final(self) -> State:
        """The records of all members at the last node."""
        if self.store.last is None:
            raise ArgumentError("This ensemble holds no records: it has not begun.")
        return at_nodes(derivation(self), self.system, self.store.last, np.arange(len(self.codes)))

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The records as a labelled xarray dataset with dimensions (member, time, …), read when they are used."""
        coordinates = member_coordinates(self.steps_done, self.codes)
        return stored_dataset(self.store.manifest, self.count, ensemble_attributes(self), coordinates)
