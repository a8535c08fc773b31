"""The search for multipliers that make a second variation definite, on forms whose answer is seen."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from coadjoint.stability.second_variation import _definite

NONE = np.zeros((3, 0))


def found(*diagonals: Any, slopes: Any = (), multipliers: Any = None, flows: np.ndarray = NONE):
    """Of the energy with the first diagonal as its form, and integrals with the others."""
    forms = np.stack([np.diag(np.asarray(one, float)) for one in diagonals])
    names = [f"C{i}" for i in range(len(forms) - 1)]
    dC = np.asarray(slopes, float).reshape(len(names), 3)
    given = np.zeros(len(names)) if multipliers is None else np.asarray(multipliers, float)
    return _definite(names, dC, forms, given, flows)


@pytest.mark.parametrize(
    ("diagonal", "verdict", "reason"),
    [
        ((1, 2, 3), "stable", "positive definite"),
        ((-1, -2, -3), "stable", "negative definite"),
        ((1, -2, 3), "undecided", "indefinite"),
        ((1, 0, 3), "undecided", "degenerate"),
        ((-1, -1e-12, -3), "undecided", "degenerate"),
    ],
)
def test_a_form_alone_is_what_its_eigenvalues_say(diagonal, verdict, reason):
    one = found(diagonal)
    assert (one.verdict, one.reason) == (verdict, reason)
    np.testing.assert_allclose(sorted(one.eigenvalues), sorted(diagonal), atol=1e-12)


def test_directions_along_which_an_integral_changes_are_left_out():
    one = found((1, -2, 3), (0, 0, 0), slopes=[[0, 2.0, 0]])
    assert one.reason == "positive definite" and sorted(one.eigenvalues) == pytest.approx([1, 3])
    assert one.multipliers == {"C0": 0.0}
    nothing = found((1, -2, 3), *[(0, 0, 0)] * 3, slopes=np.eye(3), multipliers=[0.1, 0.2, 0.3])
    assert nothing.verdict == "stable" and nothing.reason == "the integrals leave no direction"
    assert nothing.multipliers == {"C0": 0.1, "C1": 0.2, "C2": 0.3}


def test_the_flow_of_a_symmetry_is_left_out():
    along = np.array([[0.0], [1.0], [0.0]])
    assert found((1, 0, 3), flows=along).reason == "positive definite"


def test_the_multiplier_of_the_slopes_counts_in_the_form():
    """E − 2C with ∂²E = diag(1, 1, 5), ∂²C = diag(2, −2, 1): −3, 5, 3, of which the first is along ∂C."""
    one = found((1, 1, 5), (2, -2, 1), slopes=[[1.0, 0, 0]], multipliers=[2.0])
    assert one.multipliers == {"C0": 2.0} and sorted(one.eigenvalues) == pytest.approx([3, 5])


@pytest.mark.parametrize("scale", [1.0, 1e-4, 1e5])
def test_integrals_that_are_critical_have_free_multipliers(scale):
    """diag(1, −2, 3) − t·s·diag(0, −1, 0) is definite for ts > 2, and with another for −3 as well."""
    one = found((1, -2, 3), (0, -scale, 0), slopes=np.zeros((1, 3)))
    assert one.verdict == "stable" and one.multipliers["C0"] * scale > 2
    two = found((1, -2, -3), (0, -scale, 0), (0, 0, -1), slopes=np.zeros((2, 3)))
    assert two.reason == "positive definite"
    assert two.multipliers["C0"] * scale > 2 and two.multipliers["C1"] > 3
    assert found((1, -2, 3), (0, 0, -scale), slopes=np.zeros((1, 3))).verdict == "undecided"
