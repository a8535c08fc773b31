"""Surfaces from files of STL, OBJ and glTF 2.0, as triangles.

Sources: 3D Systems (1988), StereoLithography Interface Specification; Wavefront's Advanced Visualizer, Appendix B1;
Khronos, glTF 2.0 Specification.
"""

from __future__ import annotations

import base64
import json
import os
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.disk import reading
from coadjoint.errors import ArgumentError, FileError, rephrased
from coadjoint.groups.attitude import from_quaternion
from coadjoint.texts import Table

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
AXES = {
    "FRD": np.eye(3),
    "FLU": np.diag([1.0, -1.0, -1.0]),
    "YUP": np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
}
"""The axes of a file, in those of the body: forward, starboard, down."""
MOST, LARGEST = 40_000, 32_000_000
"""The most triangles, some 2 MB of a page, and the most bytes of a file."""


def read_mesh(path: str | os.PathLike[str], unit: str = "m", axes: str = "FRD") -> dict[str, object]:
    """The vertices, flat, m, and the faces, three vertices each, of a surface.

    Raises FileError for a file that cannot be read or is damaged, ArgumentError for another format, unit or axes and
    for more than `MOST` triangles.
    """
    source = Path(path)
    read = {".stl": _stl, ".obj": _obj, ".gltf": _gltf, ".glb": _gltf}.get(source.suffix.lower())
    if read is None:
        raise ArgumentError(f"A mesh is a file that ends in .stl, .obj, .gltf or .glb, but is {source.name}.")
    for name, value, known in (("unit", unit, UNITS), ("axes", axes, AXES)):
        checks.choice(value, f"Argument `{name}` of a mesh", known)
    damaged = (ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError, RecursionError)
    with reading(source), rephrased(f"The file {source} is damaged, or not a mesh of its format", *damaged):
        try:
            data = _content(source)
            vertices, faces = read(data, source)
            vertices = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
            faces = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
        except FileNotFoundError as error:
            raise FileError(_missing(error, source)) from error
    _check(vertices, faces, source)
    turned = UNITS[unit] * vertices @ AXES[axes].T
    return {"kind": "mesh", "vertices": np.round(turned, 6).ravel(), "faces": faces.ravel()}


def _content(path: Path, most: int = LARGEST) -> bytes:
    with path.open("rb") as opened:
        data = opened.read(most + 1)
    if len(data) > most:
        raise FileError(f"The mesh {path} is larger than {LARGEST / 1e6:.0f} MB with all its parts: make it coarser.")
    return data


def _missing(error: FileNotFoundError, source: Path) -> str:
    other = Path(str(error.filename or source))
    return f"There is no file {other}" + (f", which {source.name} needs." if other != source else ".")


def _check(vertices: np.ndarray, faces: np.ndarray, source: Path) -> None:
    if not len(faces) or not len(vertices):
        raise FileError(f"The file {source} has no triangles.")
    if len(faces) > MOST:
        raise ArgumentError(
            f"The mesh {source} has {len(faces):,} triangles, but a page takes {MOST:,} at most: make it coarser."
        )
    if not np.all(np.isfinite(vertices)) or np.min(faces) < 0 or np.max(faces) >= len(vertices):
        raise FileError(f"The file {source} is damaged: numbers are not finite, or faces have vertices that it lacks.")


def _stl(data: bytes, source: Path) -> tuple[Any, Any]:
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    if len(data) == 84 + 50 * count:
        kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
        corners = np.frombuffer(data, kind, count, 84)["corners"].reshape(-1, 3)
    else:
        words = data.decode("ascii").split()
        if not words or words[0] != "solid":
            raise ValueError("no STL")
        places = [i for i, word in enumerate(words) if word == "vertex"]
        corners = np.array([words[i + 1 : i + 4] for i in places], dtype=float).reshape(-1, 3)
    vertices, faces = np.unique(corners, axis=0, return_inverse=True)
    return vertices, faces


def _obj(data: bytes, source: Path) -> tuple[Any, Any]:
    vertices: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for line in data.decode("utf-8", "replace").replace("\\\n", " ").splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(word) for word in words[1:4]])
        elif words[:1] == ["f"]:
            numbers = [int(word.split("/")[0]) for word in words[1:]]
            corners = [number - 1 if number > 0 else len(vertices) + number for number in numbers]
            faces += [(corners[0], b, c) for b, c in pairwise(corners[1:])]
    return vertices, faces


_KINDS = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}


def _gltf(data: bytes, source: Path) -> tuple[Any, Any]:
    """All triangles of the default scene, each node in its place."""
    own = b""
    if data[:4] == b"glTF":
        size = int.from_bytes(data[12:16], "little")
        text, rest = data[20 : 20 + size], data[20 + size :]
        own = rest[8 : 8 + int.from_bytes(rest[:4], "little")] if rest else b""
    else:
        text = data
    held = json.loads(text)
    needed = held.get("extensionsRequired", [])
    if needed:
        raise ArgumentError(f"The mesh {source} needs {', '.join(needed)} of glTF, which is not read: export it plain.")
    scene = _Scene(held, _buffers(held.get("buffers", []), own, source), source)
    scenes = held.get("scenes", [{"nodes": range(len(held.get("nodes", [])))}])
    for root in scenes[held.get("scene", 0)]["nodes"]:
        scene.node(root, np.eye(4))
    parts = scene.parts
    if not parts:
        return np.zeros((0, 3)), np.zeros((0, 3))
    first = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = [found + start for (_, found), start in zip(parts, first[:-1], strict=True)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces)


def _buffers(spec: list[Table], own: bytes, source: Path) -> list[bytes]:
    """All buffers; those of files and addresses are together no larger than a mesh."""
    found, left = [], LARGEST
    for one in spec:
        found.append(_buffer(one, own, source, left))
        left -= len(found[-1]) if "uri" in one else 0
    return found


def _buffer(spec: Table, own: bytes, source: Path, most: int) -> bytes:
    address = spec.get("uri")
    if address is None:
        return own
    if address.startswith("data:"):
        return base64.b64decode(address.partition(",")[2])
    name = Path(address)
    if name.is_absolute() or ".." in name.parts or ":" in address:
        raise ArgumentError(
            f"The mesh {source} names {address}, which is not in its folder: export everything as one .glb."
        )
    return _content(source.parent / name, most)


@dataclass
class _Scene:
    """The triangles of a scene of glTF: vertices and faces of each piece, in the axes of the scene."""

    held: dict[str, Any]
    buffers: list[bytes]
    source: Path
    parts: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    seen: set[int] = field(default_factory=set)
    rows: int = 0

    def node(self, number: int, above: np.ndarray) -> None:
        """The contents of a node and of those below it: each is below at most one other, as the format demands."""
        if number in self.seen:
            raise ValueError("a node below two others, or below itself")
        self.seen.add(number)
        node = self.held["nodes"][number]
        placed = above @ _placed(node)
        for piece in self.held["meshes"][node["mesh"]]["primitives"] if "mesh" in node else ():
            if piece.get("mode", 4) == 4:
                vertices = self.accessor(piece["attributes"]["POSITION"])
                faces = self.accessor(piece["indices"]) if "indices" in piece else np.arange(len(vertices))
                self.parts.append((vertices @ placed[:3, :3].T + placed[:3, 3], faces.astype(np.int64).reshape(-1, 3)))
        for child in node.get("children", ()):
            self.node(child, placed)

    def accessor(self, number: int) -> np.ndarray:
        """The rows of an accessor; raises ArgumentError where pieces share so many that no page takes them."""
        spec = self.held["accessors"][number]
        width = {"SCALAR": 1, "VEC3": 3}[spec["type"]]
        view, kind = self.held["bufferViews"][spec["bufferView"]], np.dtype(_KINDS[spec["componentType"]])
        start = view.get("byteOffset", 0) + spec.get("byteOffset", 0)
        stride = view.get("byteStride", width * kind.itemsize)
        data = np.frombuffer(self.buffers[view["buffer"]], np.uint8)
        if stride < width * kind.itemsize or not 0 <= start + stride * (spec["count"] - 1) < len(data):
            raise ValueError("an accessor beyond its buffer, or of rows that overlap")
        self.rows += spec["count"]
        if self.rows > 100 * MOST:
            raise ArgumentError(f"The mesh {self.source} has far more than {MOST:,} triangles: make it coarser.")
        rows = data[start + stride * np.arange(spec["count"])[:, None] + np.arange(width * kind.itemsize)]
        found = np.ascontiguousarray(rows).view(kind)
        return found.astype(float) if width == 3 else found.ravel()


def _placed(node: Table) -> np.ndarray:
    """The matrix (4, 4) of a node: its own, or translation, rotation and scale."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=float).reshape(4, 4).T
    found, rotation = np.eye(4), np.roll(node.get("rotation", [0, 0, 0, 1]), 1)
    found[:3, :3] = from_quaternion(rotation) * node.get("scale", [1, 1, 1])
    found[:3, 3] = node.get("translation", [0, 0, 0])
    return found
