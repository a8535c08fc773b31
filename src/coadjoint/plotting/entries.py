"""What is drawn: datasets of runs, each with the label of its curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.errors import ArgumentError

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Entry:
    """A dataset and its label."""

    dataset: xarray.Dataset
    label: str

    @property
    def time(self) -> np.ndarray:
        """The saved times, (nodes,)."""
        return np.asarray(self.dataset["time"])

    def values(self, name: str) -> np.ndarray:
        """A variable, (nodes,) or (nodes, components)."""
        return np.asarray(self.dataset[name])

    def unit(self, name: str) -> str:
        """The unit of a variable, empty where none is known."""
        return str(self.dataset[name].attrs.get("units", ""))


def entries(runs: Sequence[Any], labels: Sequence[str] | None) -> list[Entry]:
    """Runs, saved runs or datasets with their labels: by default what tells them apart.

    Raises ArgumentError for anything without a dataset over time, without nodes, and for a wrong number of labels.
    """
    datasets = [_dataset(run) for run in runs]
    if labels is None:
        labels = _labels(datasets)
    elif isinstance(labels, str) or len(labels) != len(datasets):
        raise ArgumentError(
            f"Argument `labels` must hold a text for each of the {len(datasets)} runs, but is {labels!r}."
        )
    return [Entry(dataset, str(label)) for dataset, label in zip(datasets, labels, strict=True)]


def _dataset(run: Any) -> xarray.Dataset:
    dataset = getattr(run, "dataset", run)
    if not hasattr(dataset, "data_vars") or "time" not in dataset.dims:
        raise ArgumentError(
            f"A figure is drawn of a run or of its dataset over time, but was given {type(run).__name__}."
        )
    if dataset.sizes["time"] == 0:
        raise ArgumentError("This run has no saved nodes, so there is nothing to draw.")
    return dataset


def _labels(datasets: Sequence[xarray.Dataset]) -> list[str]:
    """System, method and step size, as far as they differ; the method where nothing does."""
    said = [{key: d.attrs.get(key, "") for key in ("system", "method", "dt")} for d in datasets]
    differ = [key for key in ("system", "method", "dt") if len({str(words[key]) for words in said}) > 1] or ["method"]
    texts = [", ".join(_words(key, words[key]) for key in differ if words[key] != "") for words in said]
    return [text or f"run {number}" for number, text in enumerate(texts, start=1)]


def _words(key: str, value: Any) -> str:
    return f"h = {float(value):g} s" if key == "dt" else str(value).replace("()", "")


def require(entry: Entry, names: Sequence[str], sentence: str) -> str:
    """The first of `names` that the dataset has; ArgumentError with `sentence` where it has none."""
    for name in names:
        if name in entry.dataset:
            return name
    held = ", ".join(sorted(map(str, entry.dataset.data_vars)))
    raise ArgumentError(f"{sentence} The run of {entry.label} has {held}.")
