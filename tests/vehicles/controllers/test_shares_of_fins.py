"""Which fins turn about which axis, and vehicles whose fins cannot."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint_vehicles.controllers import allocation
from coadjoint_vehicles.controllers.allocation import _shares


def mixed(monkeypatch: Any, torques: Any, screws: Any) -> Any:
    """The allocation of commands with these torques (3, k), of which `screws` push ahead."""
    torques = np.asarray(torques, dtype=float)
    motion = SimpleNamespace(effects=np.concatenate([np.zeros((3, torques.shape[1])), torques]), names=("a", "b", "c"))
    monkeypatch.setattr(allocation, "propulsion", lambda motion: np.array(screws))
    return allocation.allocation(cast(Any, motion))


def test_fins_share_a_turn_and_screws_push_alone(monkeypatch):
    found = mixed(monkeypatch, [[0.0, 0.0, 0.3], [2.0, 0.0, 0.0], [0.0, -4.0, 0.0]], [False, False, True])
    matrix = np.asarray(found[0])
    assert matrix[:, 1].tolist() == [1.0, 0.0, 0.0] and matrix[:, 2].tolist() == [0.0, -1.0, 0.0]
    assert matrix[:, 3].tolist() == [0.0, 0.0, 1.0] and not matrix[:, 0].any()


def test_fins_that_pitch_and_turn_only_together_are_refused(monkeypatch):
    with pytest.raises(ArgumentError, match="cannot pitch and turn it one without the other"):
        mixed(monkeypatch, [[0.0, 0.0, 0.0], [2.0, 4.0, 0.0], [1.0, 2.0, 0.0]], [False, False, True])


@pytest.mark.parametrize(
    ("torques", "screws"),
    [
        ([[0.0] * 3, [2.0, 0.0, 0.0], [0.0, 4.0, 0.0]], [False, False, False]),
        ([[0.0] * 3, [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [False, False, True]),
        ([[0.0] * 3, [0.0, 0.0, 0.0], [0.0, 4.0, 0.0]], [False, False, True]),
    ],
    ids=["no screw", "no rudder", "no stern planes"],
)
def test_a_vehicle_needs_a_screw_and_fins_that_pitch_and_turn(monkeypatch, torques, screws):
    with pytest.raises(ArgumentError, match="found a, b, c"):
        mixed(monkeypatch, torques, screws)


def test_shares_are_of_a_unit_torque_and_alone_where_no_other_comes_with_it():
    shares, alone = _shares(np.array([[1.0, 1.0], [2.0, -2.0], [0.0, 0.0]]))
    assert shares[:, 0] == pytest.approx([0.5, 0.5]) and shares[:, 1] == pytest.approx([0.25, -0.25])
    assert alone.tolist() == [True, True, False]
