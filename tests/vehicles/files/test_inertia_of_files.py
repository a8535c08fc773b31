"""The inertia of a vehicle file: about the mass centre or the origin, symmetric and positive about every axis."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError
from coadjoint_vehicles.files import registry

ELLIPSOID = (Path(registry.__file__).parent / "data" / "ellipsoid.toml").read_text(encoding="utf-8")


def loaded(folder: Path, value: str, more: str = "") -> np.ndarray:
    """The inertia of the ellipsoid with another one in its file."""
    text, count = re.subn(r"inertia = \{ value = \[[^]]*\]", f"{more}inertia = {{ value = {value}", ELLIPSOID)
    assert count == 1
    (folder / "own.toml").write_text(text, encoding="utf-8")
    return np.asarray(vehicles.load(str(folder / "own.toml")).inertia)


def test_three_numbers_are_a_diagonal_and_three_rows_a_matrix(tmp_path):
    assert np.array_equal(loaded(tmp_path, "[3.0, 8.0, 7.0]"), np.diag([3.0, 8.0, 7.0]))
    rows = np.array([[3.0, 0.2, -0.1], [0.2, 8.0, 0.3], [-0.1, 0.3, 7.0]])
    found = loaded(tmp_path, str(rows.tolist()))
    assert np.abs(found) == pytest.approx(np.abs(rows)) and np.array_equal(found, found.T)


def test_a_matrix_is_symmetric_to_a_millionth(tmp_path):
    assert loaded(tmp_path, "[[3.0, 0.200003, 0], [0.2, 8.0, 0], [0, 0, 7.0]]").shape == (3, 3)
    for wrong in ("[[3.0, 0.20002, 0], [0.2, 8.0, 0], [0, 0, 7.0]]", "[[3.0, 0.2, 0], [-0.2, 8.0, 0], [0, 0, 7.0]]"):
        with pytest.raises(ArgumentError, match="inertia must be symmetric"):
            loaded(tmp_path, wrong)


@pytest.mark.parametrize(
    ("value", "sentence"),
    [
        ("[3.0, 8.0]", "must be three numbers, or three rows of three"),
        ("3.0", "must be three numbers, or three rows of three"),
        ("[3.0, -8.0, 7.0]", "must be positive about every axis, but has the eigenvalue -8"),
        ("[3.0, 0.0, 7.0]", "must be positive about every axis, but has the eigenvalue 0"),
    ],
)
def test_another_inertia_is_refused(value, sentence, tmp_path):
    with pytest.raises(ArgumentError, match=sentence):
        loaded(tmp_path, value)
