"""Records as comma-separated values: a line a node, a column a number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray

from coadjoint.csv_tables import csv_text


def csv_table(dataset: xarray.Dataset) -> str:
    """The variables over `time` of a run, or over (`member`, `time`) of an ensemble, one line a node.

    Columns are `time` and, of every variable, its name, with the indices behind it where it is an array: mu_0, g_0_2.
    Numbers have all of their digits; NaN is an empty field.
    """
    leading = [name for name in ("member", "time") if name in dataset.dims]
    count = int(np.prod([dataset.sizes[name] for name in leading]))
    grid = np.meshgrid(*(dataset[name].values for name in leading), indexing="ij")
    columns = {name: np.ravel(values) for name, values in zip(leading, grid, strict=True)}
    for name, variable in dataset.data_vars.items():
        if not set(leading) <= set(variable.dims):
            continue
        values = variable.transpose(*leading, ...).values
        rows = values.reshape(count, -1)
        for column, index in enumerate(np.ndindex(*values.shape[len(leading) :])):
            columns["_".join([str(name), *map(str, index)])] = rows[:, column]
    return csv_text(columns, repr)
