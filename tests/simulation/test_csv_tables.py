"""Tables of comma-separated values: which variables have columns, their names, and their rows."""

from __future__ import annotations

import numpy as np
import xarray as xr

from coadjoint.simulation.result import csv_table


def cells(text: str) -> list[list[str]]:
    return [line.split(",") for line in text.splitlines()]


def test_a_run_has_a_column_for_each_scalar_and_for_each_place_of_an_array():
    run = xr.Dataset(
        {
            "energy": ("time", [1.5, np.nan]),
            "g": (("time", "row", "column"), np.arange(8.0).reshape(2, 2, 2)),
            "mass": ((), 3.0),
        },
        {"time": [0.0, 0.25]},
    )
    assert cells(csv_table(run)) == [
        ["time", "energy", "g_0_0", "g_0_1", "g_1_0", "g_1_1"],
        ["0.0", "1.5", "0.0", "1.0", "2.0", "3.0"],
        ["0.25", "", "4.0", "5.0", "6.0", "7.0"],
    ]


def test_an_ensemble_has_a_line_for_each_node_of_each_member_whatever_the_order_of_the_axes():
    members = xr.Dataset(
        {"x": (("axis", "time", "member"), np.arange(12.0).reshape(2, 3, 2)), "t": ("time", np.zeros(3))},
        {"time": [0.0, 1.0, 2.0], "member": [4, 5]},
    )
    found = cells(csv_table(members))
    assert found[0] == ["member", "time", "x_0", "x_1"]
    assert [row[:2] for row in found[1:]] == [[m, t] for m in ("4", "5") for t in ("0.0", "1.0", "2.0")]
    assert [float(row[2]) for row in found[1:]] == [0.0, 2.0, 4.0, 1.0, 3.0, 5.0]
    assert [float(row[3]) for row in found[1:]] == [6.0, 8.0, 10.0, 7.0, 9.0, 11.0]
