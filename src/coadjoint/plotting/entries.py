"""The entries of a figure: datasets of runs, each with the label of its curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from coadjoint.errors import ArgumentError
from coadjoint.labelled import of_run
from coadjoint.plotting.decimation import CAPACITY, thin
from coadjoint.plotting.style import COLOURS, DASHES, legend
from coadjoint.texts import Table

if TYPE_CHECKING:
    from coadjoint.labelled import AnyDataset


@dataclass(frozen=True)
class Entry:
    """A dataset of one run, the label of its curve, and its place among the runs of a figure.

    `crowd` is the number of members of an ensemble that share a label and a place, where they are too many for separate
    labels.
    """

    dataset: AnyDataset
    label: str
    place: int = 0
    crowd: int = 1

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

    @property
    def look(self) -> Table:
        """Colour and line style of the curve; pale in a crowd."""
        return {"color": COLOURS[self.place % len(COLOURS)], **self.line}

    @property
    def line(self) -> Table:
        """The line style without the colour."""
        pale = {"alpha": 0.35, "linewidth": 0.6} if self.crowd > 1 else {}
        return {"linestyle": DASHES[self.place % len(DASHES)], **pale}

    def thin(self, *series: np.ndarray) -> np.ndarray:
        """The indices to draw of series; fewer in a crowd."""
        return thin(*series, capacity=max(CAPACITY // self.crowd, CAPACITY // 10))


def entries(runs: Sequence[object], labels: Sequence[str] | None) -> list[Entry]:
    """Runs, saved runs or datasets with their labels: by default the properties that distinguish them. Ensembles give
    all members.

    Raises ArgumentError for anything without a dataset over time, without nodes, and for a wrong number of labels.
    """
    datasets = [_dataset(run) for run in runs]
    if labels is None:
        labels = _labels(datasets)
    elif isinstance(labels, str) or len(labels) != len(datasets):
        raise ArgumentError(
            f"Argument `labels` must hold a text for each of the {len(datasets)} runs, but is {labels!r}."
        )
    found: list[Entry] = []
    for dataset, label in zip(datasets, labels, strict=True):
        place = found[-1].place + 1 if found else 0
        found += (
            _members(dataset, str(label), place) if "member" in dataset.dims else [Entry(dataset, str(label), place)]
        )
    return found


def _dataset(run: Any) -> AnyDataset:
    dataset = of_run(run)
    if not hasattr(dataset, "data_vars") or "time" not in dataset.dims:
        raise ArgumentError(
            f"A figure is drawn of a run or of its dataset over time, but was given {type(run).__name__}."
        )
    if dataset.sizes["time"] == 0:
        raise ArgumentError("This run has no saved nodes, so there is nothing to draw.")
    return dataset


def _members(ensemble: AnyDataset, label: str, place: int) -> list[Entry]:
    """The members of an ensemble as far as they ran: a few with separate labels, many as one crowd."""
    went = [_until_failure(ensemble.isel(member=index)) for index in range(ensemble.sizes["member"])]
    went = [member for member in went if member.sizes["time"]]
    if not went:
        raise ArgumentError("No member of this ensemble has saved nodes, so there is nothing to draw.")
    if len(went) <= len(COLOURS):
        return [Entry(one, f"member {int(one['member'].values)}", place + i) for i, one in enumerate(went)]
    first = f"{label}, {len(went)} members" if label else f"{len(went)} members"
    # Labels that begin with an underscore stay out of legends.
    return [Entry(one, first if i == 0 else "_", place, len(went)) for i, one in enumerate(went)]


def _until_failure(member: AnyDataset) -> AnyDataset:
    """The nodes of a member without those after a step that failed, which are NaN."""
    moving = [array for array in member.data_vars.values() if array.dims[:1] == ("time",)]
    good = np.ones(member.sizes["time"], dtype=bool)
    for array in moving:
        good &= np.isfinite(array.values.reshape(len(good), -1)).all(axis=1)
    return member if good.all() else member.isel(time=good)


def _labels(datasets: Sequence[AnyDataset]) -> list[str]:
    """System, method and step size, as far as they differ; otherwise the method."""
    said = [{key: d.attrs.get(key, "") for key in ("system", "method", "dt")} for d in datasets]
    differ = [key for key in ("system", "method", "dt") if len({str(words[key]) for words in said}) > 1] or ["method"]
    texts = [", ".join(_words(key, words[key]) for key in differ if words[key] != "") for words in said]
    unnamed = "run {}" if len(datasets) > 1 else ""
    return [text or unnamed.format(number) for number, text in enumerate(texts, start=1)]


def _words(key: str, value: Any) -> str:
    return f"h = {float(value):g} s" if key == "dt" else str(value).replace("()", "")


def fewest(runs: Sequence[Entry]) -> int:
    """How many curves a legend needs: one where a curve stands for many members, else two to tell apart."""
    return 1 if any(run.crowd > 1 for run in runs) else 2


def require(entry: Entry, names: Sequence[str], sentence: str) -> str:
    """The first of `names` that the dataset has; ArgumentError with `sentence` where it has none."""
    for name in names:
        if name in entry.dataset:
            return name
    held = ", ".join(sorted(map(str, entry.dataset.data_vars)))
    raise ArgumentError(f"{sentence} The run of {entry.label} has {held}.")


def tell_apart(figure: Figure, runs: Sequence[Entry]) -> None:
    """The legend of line styles by run, where there are several, and the number of members with one style."""
    named = [run for run in runs if not run.label.startswith("_")]
    handles = [Line2D([], [], **{"color": "#444444", **run.line, "alpha": 1.0}) for run in named]
    legend(figure, handles, [run.label for run in named], fewest(runs))
