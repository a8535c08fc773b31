"""Where nodes of glTF and corners of OBJ put what they hold."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.errors import ArgumentError, FileError
from coadjoint.plotting import meshes
from coadjoint.plotting.meshes import _check, _obj, _placed

HALF = np.sqrt(0.5)


def test_a_node_is_scaled_turned_and_then_moved_and_one_that_says_nothing_stays():
    assert np.array_equal(_placed({}), np.eye(4))
    moved = _placed({"translation": [1, 2, 3], "rotation": [0, 0, HALF, HALF], "scale": [2, 3, 4]})
    assert moved @ [1, 0, 0, 1] == pytest.approx([1, 4, 3, 1])  # 2 along x, which turns to y
    assert moved @ [0, 1, 0, 1] == pytest.approx([-2, 2, 3, 1]) and moved @ [0, 0, 1, 1] == pytest.approx([1, 2, 7, 1])
    columns = np.arange(16.0)
    assert np.array_equal(_placed({"matrix": columns.tolist()}), columns.reshape(4, 4).T)


def test_a_face_of_more_corners_is_a_fan_and_corners_count_from_one_or_from_the_last(tmp_path):
    text = b"v 0 0 0\nv 1 0 0\nv 1 1 0 0.5\nv 0 1 0\nf 1/2/3 2//1 3/1 4\nf -4 -3 -1\nl 1 2\n"
    vertices, faces = _obj(text, tmp_path)
    assert vertices == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert faces == [(0, 1, 2), (0, 2, 3), (0, 1, 3)]


def test_faces_have_vertices_that_there_are_and_are_not_too_many(tmp_path, monkeypatch):
    corners = np.eye(3)
    _check(corners, np.array([[0, 1, 2]]), tmp_path)
    for faces in ([[0, 1, 3]], [[0, -1, 2]]):
        with pytest.raises(FileError, match="faces have vertices that it lacks"):
            _check(corners, np.array(faces), tmp_path)
    with pytest.raises(FileError, match="has no triangles"):
        _check(corners, np.zeros((0, 3), int), tmp_path)
    monkeypatch.setattr(meshes, "MOST", 1)
    _check(corners, np.array([[0, 1, 2]]), tmp_path)
    with pytest.raises(ArgumentError, match="has 2 triangles, but a page takes 1 at most"):
        _check(corners, np.array([[0, 1, 2]] * 2), tmp_path)
