"""Arrays whose values are made or read when they are used, as xarray holds them; imported where xarray is asked for."""

from __future__ import annotations

import numpy as np
from xarray.backends import BackendArray
from xarray.core import indexing

from coadjoint.arrays import PyTree


class _InMemory(indexing.NumpyIndexingAdapter):
    """An array that is computed when its values are first read, like one in memory."""

    __slots__ = ("deferred", "own")

    def __init__(self, deferred: PyTree):
        self.deferred = deferred
        self.own: np.ndarray | None = None

    @property
    def array(self) -> np.ndarray:  # pyright: ignore[reportIncompatibleVariableOverride]
        if self.own is None:
            self.own = np.array(self.deferred.values)  # a variable that is changed changes no record, and no other
        return self.own

    @property
    def shape(self) -> tuple[int, ...]:
        return self.deferred.shape

    @property
    def dtype(self) -> np.dtype:
        return self.deferred.dtype

    def __reduce__(self) -> tuple[object, ...]:
        return indexing.NumpyIndexingAdapter, (self.array,)


class _OnDisk(BackendArray):
    """An array in the folder of a run."""

    def __init__(self, array: PyTree):
        self.array, self.shape, self.dtype = array, array.shape, array.dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> np.ndarray:
        basic = indexing.IndexingSupport.BASIC
        return indexing.explicit_indexing_adapter(key, self.shape, basic, self.array.__getitem__)


def computed(deferred: PyTree) -> indexing.MemoryCachedArray:
    """An array of `coadjoint.simulation.deferred`, still computed when its values are first read."""
    return indexing.MemoryCachedArray(_InMemory(deferred))


def stored(array: PyTree, part: tuple[slice, ...]) -> indexing.MemoryCachedArray:
    """Part of an array of `coadjoint.simulation.zarr_reader`, read when its values are used, and then kept."""
    rows = indexing.LazilyIndexedArray(_OnDisk(array), indexing.BasicIndexer(part))
    return indexing.MemoryCachedArray(indexing.CopyOnWriteArray(rows))  # pyright: ignore[reportArgumentType]
