"""Rows of equations: their names, what they say, and their residual relative to its size."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import numpy as np
import pytest

import coadjoint as co
from coadjoint.theory import equations
from coadjoint.theory.equations import _of_momenta
from coadjoint.theory.residuals import Residual, row


class Record(NamedTuple):
    """The momenta of a node, and where it is."""

    n: Any
    mu: Any
    pi: Any


def test_a_row_has_the_largest_entry_of_each_node():
    found = row("P42", "π = 0", np.array([[[1.0, -3.0]], [[0.5, 0.25]]]), 2.0)
    assert (found.equation, found.statement, found.values.tolist(), found.scale) == ("P42", "π = 0", [3.0, 0.5], 2.0)
    assert found.largest == 1.5 and row("a", "b", np.zeros((2, 0)), 0.0).scale == 1.0
    assert Residual("a", "b", np.array([1.0, np.nan]), 1.0).largest == np.inf


def test_the_momenta_are_told_against_the_legendre_transforms_on_both_sides(monkeypatch):
    """F⁻ of the step that begins at a node and F⁺ of the one that ends there, in their order."""
    system = co.System(co.SO2(), lambda xi, x, v: 0.5 * (xi @ xi + v @ v), additional=co.Trivial(1))
    one = np.ones((3, 1))
    records = cast(Any, Record(n=one, mu=5 * one, pi=7 * one))
    slopes = SimpleNamespace(right=one, along_s=one, along_n=one, link=SimpleNamespace(n=one, s=one))
    ends = [SimpleNamespace(mu=4.0 * one[0], pi=5.0 * one[0]), SimpleNamespace(mu=2.0 * one[0], pi=1.0 * one[0])]
    monkeypatch.setattr(equations, "legendre_transforms", lambda system, at: ends)
    monkeypatch.setattr(equations, "pairs", lambda slopes: (np.zeros(2), np.zeros(2)))
    rows = _of_momenta(system, records, cast(Any, slopes))
    assert [(row.equation, row.values.tolist()) for row in rows] == [
        ("F⁻ μ", [1.0, 1.0]), ("F⁻ π", [2.0, 2.0]), ("F⁺ μ", [3.0, 3.0]), ("F⁺ π", [6.0, 6.0]),
    ]  # fmt: skip
    assert [row.statement.split(" ")[0] for row in rows] == ["μ_k", "π_k", "μ_{k+1}", "π_{k+1}"]
    assert rows[0].scale == pytest.approx(2.0) and rows[1].scale == 1.0
