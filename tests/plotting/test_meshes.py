"""Meshes: the same tetrahedron from every format, and sentences for what is none."""

from __future__ import annotations

import base64
import json
import struct

import numpy as np
import pytest

from coadjoint.errors import ArgumentError, FileError
from coadjoint.plotting import bodies
from coadjoint.plotting.meshes import MOST, read_mesh

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
OBJ = (
    "# a\n"
    + "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    + "f 1/1 3/2 2/3\nf 1 2 4\nf -4 -1 -2\nf 2//1 3//1 4//1\n"
)


def ascii_stl() -> bytes:
    corners = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*c) for c in face)
        + "endloop\nendfacet\n"
        for face in CORNERS[FACES]
    )
    return f"solid a\n{corners}endsolid a\n".encode()


def binary_stl() -> bytes:
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *face.ravel(), 0) for face in CORNERS[FACES])
    return b"solid but binary".ljust(80) + struct.pack("<I", 4) + rows


def gltf(embedded: bool = True) -> tuple[dict, bytes]:
    """At half the size, moved by a node that is then put back and scaled by another."""
    data = (0.5 * CORNERS + [1, 0, 0]).astype("<f4").tobytes() + FACES.astype("<u2").tobytes()
    buffer = {"byteLength": len(data)}
    if embedded:
        buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    told = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"scale": [2, 2, 2], "children": [1]}, {"mesh": 0, "translation": [-1, 0, 0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 24}],
        "buffers": [buffer],
    }
    return told, data


def glb() -> bytes:
    told, data = gltf(embedded=False)
    text = json.dumps(told).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


FILES = {
    "a.obj": OBJ.encode(),
    "a.stl": ascii_stl(),
    "b.stl": binary_stl(),
    "a.gltf": json.dumps(gltf()[0]).encode(),
    "a.glb": glb(),
}


def triangles(found) -> np.ndarray:
    return np.reshape(found["vertices"], (-1, 3))[np.reshape(found["faces"], (-1, 3))]


@pytest.mark.parametrize("name", FILES)
def test_every_format_gives_the_same_triangles_outwards(name, tmp_path):
    (tmp_path / name).write_bytes(FILES[name])
    found = triangles(read_mesh(tmp_path / name))
    assert np.allclose(sorted(map(tuple, found.mean(axis=1))), sorted(map(tuple, CORNERS[FACES].mean(axis=1))))
    volume = np.sum(np.cross(found[:, 0], found[:, 1]) * found[:, 2]) / 6
    assert volume == pytest.approx(1.0)  # 1 · 2 · 3 / 6, and positive: the normals point outwards


def test_units_and_axes_are_turned(tmp_path):
    (tmp_path / "a.obj").write_bytes(FILES["a.obj"])
    found = np.reshape(read_mesh(tmp_path / "a.obj", "mm", "FLU")["vertices"], (-1, 3))
    assert np.allclose(found, 1e-3 * CORNERS * [1, -1, -1])
    found = np.reshape(read_mesh(tmp_path / "a.obj", axes="YUP")["vertices"], (-1, 3))
    assert np.allclose(found[[1, 2, 3]], [[0, -1, 0], [0, 0, -2], [3, 0, 0]])  # port, up, forward
    assert bodies.mesh(tmp_path / "a.obj", at=(1, 2, 3))["at"] == [1, 2, 3]


@pytest.mark.parametrize("name", FILES)
def test_a_damaged_file_is_a_sentence(name, tmp_path):
    rng = np.random.default_rng(1)
    for _ in range(60):
        data = bytearray(FILES[name])
        if rng.random() < 0.5:
            data = data[: rng.integers(len(data))]
        else:
            data[rng.integers(len(data))] = rng.integers(256)
        (tmp_path / name).write_bytes(bytes(data))
        try:
            found = read_mesh(tmp_path / name)
        except (FileError, ArgumentError) as error:
            assert str(error).endswith(".") and str(tmp_path / name) in str(error)
        else:
            assert np.all(np.isfinite(found["vertices"]))


@pytest.mark.parametrize(
    ("name", "text", "options", "words"),
    [
        ("a.step", "", {}, "ends in .stl, .obj, .gltf or .glb"),
        ("a.obj", OBJ, {"unit": "foot"}, '`unit` of a mesh must be "m", "cm"'),
        ("a.obj", OBJ, {"axes": "ENU"}, '`axes` of a mesh must be "FRD", "FLU"'),
        ("a.obj", "v 0 0 0\n", {}, "has no triangles"),
        ("a.obj", "v 0 0 0\nf 1 2 3\n", {}, "is damaged"),
        ("a.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", {}, "not finite"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * (MOST + 1), {}, "make it coarser"),
        ("a.gltf", json.dumps({"buffers": [{"uri": "../a.bin"}]}), {}, "not in its folder"),
        ("a.gltf", json.dumps({"buffers": [{"uri": "a.bin"}]}), {}, "a.bin, which a.gltf needs"),
        ("a.gltf", json.dumps({"extensionsRequired": ["KHR_draco_mesh_compression"]}), {}, "export it plain"),
    ],
)
def test_what_is_no_mesh_is_refused(name, text, options, words, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises((FileError, ArgumentError), match=words):
        read_mesh(tmp_path / name, **options)
    with pytest.raises(FileError, match="There is no file"):
        read_mesh(tmp_path / "nothing.stl")
