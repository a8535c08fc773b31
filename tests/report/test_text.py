"""The report on the paper's runs says of a trajectory how it goes: where it turns, and how it ends."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from coadjoint.report import text
from coadjoint.report.text import _trajectory


def reproduction(z: list[float], mass: float, apart: float = 0.0) -> Any:
    """Two runs with these depths a second apart, of which the second is `apart` m to the side."""
    q = np.zeros((len(z), 3))
    q[:, 2] = z
    system = SimpleNamespace(parameters=SimpleNamespace(mass=mass, gravity=10.0, buoyancy=20.0))

    def run(q):
        return SimpleNamespace(system=system, records=SimpleNamespace(q=q, t=np.arange(len(z)) * 1.0))

    runs = {"cayley": run(q), "exponential": run(q + np.array([0.0, apart, 0.0]))}
    return cast(Any, SimpleNamespace(runs=runs))


def test_a_light_vehicle_turns_where_it_is_deepest():
    told = _trajectory(reproduction([1.0, 3.0, 2.0, 0.5], mass=1.5, apart=2e-3))
    assert "z grows from 1 m to 3 m at t = 1 s and then falls to 0.5 m" in told
    assert "floats up, past where it began" in told and "at most 2e-03 m apart" in told
    assert "Weight less buoyancy is -5 N" in told


@pytest.mark.parametrize(
    ("z", "mass"),
    [([1.0, 3.0, 2.0], 2.5), ([1.0, 2.0, 3.0], 1.5), ([3.0, 2.0, 1.0], 1.5), ([1.0, 3.0, 2.0], 2.0)],
    ids=["heavy", "deepest at the end", "deepest at the start", "neutral"],
)
def test_another_goes_on_without_turning(z, mass):
    told = _trajectory(reproduction(z, mass))
    assert f"z goes from {z[0]:g} m to {z[-1]:g} m without turning back" in told and "growing z is a dive" in told


def test_a_light_vehicle_that_ends_where_it_began_is_not_said_to_pass_it():
    assert "growing z is a dive" in _trajectory(reproduction([1.0, 3.0, 1.0], mass=1.5))


def test_round_off_of_the_quantity_is_that_of_its_largest_factors(monkeypatch):
    """ε |n||π| of the node where they are largest, relative to I."""
    given = {"kelvin_noether_initial": 0.5, "kelvin_noether_error_max": 1e-12, "balance_residual_max": 1e-13}
    monkeypatch.setattr(text, "numbers", lambda run: given)
    records = SimpleNamespace(n=np.diag([1.0, 2.0, 30.0]), pi=np.eye(3)[:, ::-1] * 4.0)
    runs = dict.fromkeys(("cayley", "exponential"), SimpleNamespace(records=records))
    told = text._kelvin_noether(cast(Any, SimpleNamespace(runs=runs)))
    assert "|n||π| = 1.2e+02 kg m²/s" in told and f"{np.finfo(float).eps * 120 / 0.5:.0e} of I." in told


def test_a_matrix_is_shown_by_its_diagonal_where_that_is_all():
    found = [text._diagonal(cast(Any, one)) for one in (np.diag([1.0, 2.5]), [[1.0, 2.0], [0.0, 1.0]], [1.0, 2.0])]
    assert found == ["diag(1, 2.5)", "[[1.0, 2.0], [0.0, 1.0]]", "[1.0, 2.0]"]
