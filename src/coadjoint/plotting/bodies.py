"""Scenes of any system on SO(3), SE(3), ℝ³ and their products: its bodies as boxes, ellipsoids, rods and meshes.

from coadjoint.plotting import bodies

run.plot.scene(path="top.html", bodies=[bodies.Solid([bodies.ellipsoid((0.3, 0.2, 0.1))])])
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.groups import attitude
from coadjoint.plotting.decimation import thin
from coadjoint.plotting.entries import Entry
from coadjoint.plotting.scene import POINTS, DrawnBody, Member, Readout, Scene, Shape, quaternions
from coadjoint.plotting.style import COLOURS

if TYPE_CHECKING:
    from coadjoint.models.multibody import Mechanism

_BOX = (1.0, 0.6, 0.36)
"""The sides of a body without a description, in proportion."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A body: its shapes in its own axes, and its place.

    shapes: of `box`, `ellipsoid`, `rod`, `mesh`. place: (nodes, 3) m, by default the run's x or q, else the origin.
    turn: (nodes, 3, 3), from the body to space, by default the run's rotation. track: whether its path is drawn, by
    default where it moves. of: the names of the constraints that the run of a mechanism must have.
    """

    shapes: Sequence[Shape]
    place: PyTree = None
    turn: Any = None
    track: bool | None = None
    of: tuple[str, ...] | None = None


def box(size: object, at: object = (0.0, 0.0, 0.0)) -> Shape:
    """A box with sides (3,) m, its middle at `at`, (3,) m, in the body; raises ArgumentError."""
    return {"kind": "box", "size": _sizes(size, "size"), "at": _three(at, "at")}


def ellipsoid(semi_axes: object, at: object = (0.0, 0.0, 0.0)) -> Shape:
    """An ellipsoid with semi-axes (3,) m, its middle at `at`, (3,) m, in the body; raises ArgumentError."""
    return {"kind": "ellipsoid", "axes": _sizes(semi_axes, "semi_axes"), "at": _three(at, "at")}


def rod(begin: object, end: PyTree, radius: float) -> Shape:
    """A round rod from one point to another, (3,) m, in the body; raises ArgumentError."""
    first, last = _three(begin, "begin"), _three(end, "end")
    if first == last:
        raise ArgumentError(f"Arguments `begin` and `end` of a rod must differ, but both are {first}.")
    return {"kind": "rod", "from": first, "to": last, "radius": _sizes([radius] * 3, "radius")[0]}


def mesh(path: str | os.PathLike[str], unit: str = "m", at: object = (0.0, 0.0, 0.0), axes: str = "FRD") -> Shape:
    """A surface from a file of STL, OBJ or glTF; `unit` is that of its numbers: m, cm, mm or in.

    axes: those of the file, which are turned into the body's: "FRD", forward, starboard, down, or "FLU", forward, port,
    up, or "YUP", port, up, forward, as glTF has them. Raises FileError and ArgumentError.
    """
    from coadjoint.plotting.meshes import read_mesh

    return {**read_mesh(path, unit, axes), "at": _three(at, "at")}


def linkage(mechanism: Mechanism) -> list[Solid]:
    """The bodies of a mechanism: rods to its joints, which are balls, and wheels of the radius with which they roll.

    run.plot.scene(path="linkage.html", bodies=bodies.linkage(linkage))

    Raises ArgumentError for anything but a Mechanism; the scene raises it for a run of another system.
    """
    checks.expect(
        hasattr(mechanism, "bodies") and hasattr(mechanism, "joints"), mechanism, "mechanism", "a multibody.Mechanism"
    )
    held: dict[str, list[list[float]]] = {name: [] for name in mechanism.bodies}
    wheels: dict[str, Shape] = {}
    for key, joint in mechanism.joints.items():
        if joint.kind == "gear":
            continue
        numbers: Any = getattr(mechanism.system.parameters, key)
        for name, end in ((joint.first, "first"), (joint.second, "second")):
            if name in held and joint.kind != "rolling":
                held[name].append(np.asarray(getattr(numbers, end), dtype=float).tolist())
        if joint.kind == "rolling" and joint.second in held:
            axis = 0.0 if joint.axis is None else mechanism.reference(joint.second)[0].T @ joint.axis
            wheels[joint.second] = ellipsoid(float(joint.radius or 0.0) * (1 - 0.95 * np.abs(np.broadcast_to(axis, 3))))
    radius = 0.03 * max((float(np.linalg.norm(at)) for points in held.values() for at in points), default=1.0) or 0.03
    of = tuple(one.name for one in mechanism.system.constraints)
    return [Solid([*_bars(held[name], radius), *([wheels[name]] if name in wheels else [])], of=of) for name in held]


def _bars(points: list[list[float]], radius: float) -> list[Shape]:
    """A ball at each joint, and rods between these and the mass centre; one joint holds a rod through the centre."""
    far = [at for at in points if np.linalg.norm(at) > radius]
    ends = [*far, *([[-x for x in far[0]]] if len(far) == 1 else [])]
    rods = [rod((0.0, 0.0, 0.0), end, radius) for end in ends]
    return [*rods, *(ellipsoid([1.6 * radius] * 3, at) for at in points)]


def scene(runs: Sequence[Entry], solids: Sequence[Solid] | None = None, z_down: bool = False) -> Scene:
    """The scene of these runs; `solids` describe the bodies of the first, whose shapes the others share.

    Raises ArgumentError where a run has neither rotations nor places in space.
    """
    members = [_member(run, solids, max(POINTS // len(runs), 50), len(runs) == 1) for run in runs]
    name = str(runs[0].dataset.attrs.get("system", "")) or "run"
    sentences = (
        f"{one.label}: {_counted(len(one.bodies))} over {one.time[-1] - one.time[0]:.6g} s." for one in members
    )
    title, pivot = name if len(runs) == 1 else f"{len(runs)} runs of {name}", _pivot(members)
    return Scene(title, " ".join(sentences), members, down=z_down, pivot=pivot, frames=pivot is not None)


def _pivot(members: Sequence[Member]) -> list[float] | None:
    """The point about which the only body of each member turns; None where one moves or there are several."""
    held = [member.bodies[0] for member in members if len(member.bodies) == 1]
    if len(held) < len(members) or any(np.ptp(body.place, axis=0).max() > 1e-9 for body in held):
        return None
    turning = any(np.ptp(body.turn, axis=0).max() > 1e-9 for body in held)
    return held[0].place[0].tolist() if turning else None


def _member(run: Entry, solids: Sequence[Solid] | None, capacity: int, alone: bool) -> Member:
    found = poses(run)
    if solids is None:
        solids = [Solid([]) for _ in found]
    _require_own(run, solids, len(found))
    described = [_pose(solid, found[min(i, len(found) - 1)], len(run.time)) for i, solid in enumerate(solids)]
    kept = thin(*(place for place, _ in described), *(turn for _, turn in described), capacity=capacity)
    extent = max(float(np.max(np.ptp(np.concatenate([place for place, _ in described]), axis=0))), 0.0)
    made = [
        _body(solid, place[kept], turn[kept], extent) for solid, (place, turn) in zip(solids, described, strict=True)
    ]
    label = str(run.dataset.attrs.get("system", "run")) if alone else run.label
    return Member(label, COLOURS[run.place % len(COLOURS)], run.time[kept], made, _readouts(run, described, kept))


def _require_own(run: Entry, solids: Sequence[Solid], count: int) -> None:
    """Raise ArgumentError where solids are those of a mechanism, and the run is one of another system."""
    variables = {str(name) for name in run.dataset.data_vars if str(name).startswith("reaction_")}
    described = [solid.of for solid in solids if solid.of is not None]
    for own in set(described):
        expected = {f"reaction_{kind}{name}" for name in own for kind in ("", "step_")}
        if len(described) != count or variables not in (set(), expected):
            raise ArgumentError(
                f"Argument `bodies` must describe the mechanism of the run, which has {_counted(count)}, but is that "
                f"of another, of {_counted(len(described))} with the joints {', '.join(own) or 'none'}."
            )


def _counted(bodies: int) -> str:
    return f"{bodies} bod{'y' if bodies == 1 else 'ies'}"


def _body(solid: Solid, place: np.ndarray, turn: np.ndarray, extent: float) -> DrawnBody:
    size = 0.12 * extent or 1.0
    shapes = list(solid.shapes) or [box(np.array(_BOX) * size)]
    moves = bool(np.max(np.ptp(place, axis=0)) > 1e-9)
    return DrawnBody(
        shapes, place, quaternions(turn), max(map(reach, shapes)), track=moves if solid.track is None else solid.track
    )


def reach(shape: Shape) -> float:
    """The diameter of a ball about the origin of the body that holds a shape, about, m."""
    own = {
        "box": lambda: max(shape["size"]),
        "ellipsoid": lambda: 2 * max(shape["axes"]),
        "rod": lambda: 2 * float(np.max(np.linalg.norm([shape["from"], shape["to"]], axis=1))),
        "mesh": lambda: float(np.max(np.ptp(np.reshape(shape["vertices"], (-1, 3)), axis=0))),
        "torpedo": lambda: shape["length"],
    }[shape["kind"]]()
    return own + 2 * float(np.linalg.norm(shape.get("at", 0.0)))


def poses(run: Entry) -> list[tuple[np.ndarray, np.ndarray]]:
    """Places (nodes, 3) and rotations (nodes, 3, 3) of the bodies of a run, by its variables; raises ArgumentError.

    A body for every rotation: R with x of SE(3) or q, also of the links of a power, R_1, R_2, … of products in a row;
    without rotations a point for three columns of q.
    """
    nodes = len(run.time)
    if "R" in run.dataset and run.values("R").ndim == 4:
        return _links(run)
    still, level = np.zeros((nodes, 3)), np.tile(np.eye(3), (nodes, 1, 1))
    names = [str(name) for name in run.dataset.data_vars if str(name).split("_")[0] == "R"]
    turns = [(name, _rotation(run.values(name))) for name in names]
    if not turns and "euler_angles" in run.dataset:
        turns = [("R", np.asarray([attitude.zyx(*angles) for angles in run.values("euler_angles")]))]
    if turns:
        row = [still + np.array([1.6 * i, 0, 0]) for i in range(len(turns))] if len(turns) > 1 else [still]
        return [(_place(run, name, at), turn) for (name, turn), at in zip(turns, row, strict=True)]
    for name in ("x", "q", "n"):
        if name in run.dataset and run.values(name).ndim == 2 and run.values(name).shape[1] % 3 == 0:
            return [(part, level) for part in np.split(run.values(name), run.values(name).shape[1] // 3, axis=1)]
    held = ", ".join(sorted(map(str, run.dataset.data_vars)))
    raise ArgumentError(
        f"A scene shows rotations R or places q in space, but the run of {run.label or 'this system'} has {held}: give "
        "the places of its bodies by `bodies`."
    )


def _links(run: Entry) -> list[tuple[np.ndarray, np.ndarray]]:
    """Those of the links of a power, at x or at q, or in a row."""
    turns = [_rotation(turn) for turn in np.moveaxis(run.values("R"), 1, 0)]
    nodes, count = len(run.time), len(turns)
    for name in ("x", "q"):
        if name in run.dataset and run.values(name).size in (2 * nodes * count, 3 * nodes * count):
            places = run.values(name).reshape(nodes, count, -1)
            places = np.pad(places, ((0, 0), (0, 0), (0, 3 - places.shape[2])))
            return list(zip(np.moveaxis(places, 1, 0), turns, strict=True))
    return [(np.tile([1.6 * k, 0.0, 0.0], (nodes, 1)), turn) for k, turn in enumerate(turns)]


def _rotation(values: np.ndarray) -> np.ndarray:
    """Rotations of space, (nodes, 3, 3), also of those of the plane about the vertical."""
    if values.shape[1:] == (2, 2):
        spatial = np.tile(np.eye(3), (len(values), 1, 1))
        spatial[:, :2, :2] = values
        return spatial
    return values


def _place(run: Entry, rotation: str, otherwise: np.ndarray) -> np.ndarray:
    """Where the body of a rotation is: R and x, R_2 and x_2, or R alone and q."""
    for name in ("x" + rotation[1:], *(("q",) if rotation == "R" else ())):
        if name in run.dataset and run.values(name).shape[1:] in ((3,), (2,)) and not _shape_of_joints(run, name):
            return np.pad(run.values(name), ((0, 0), (0, 3 - run.values(name).shape[1])))
    return otherwise


def _shape_of_joints(run: Entry, name: str) -> bool:
    """Whether q has two numbers next to a rotation of space: these are joints, not a place."""
    return name == "q" and run.values(name).shape[1] == 2


def _pose(solid: Solid, found: tuple[np.ndarray, np.ndarray], nodes: int) -> tuple[np.ndarray, np.ndarray]:
    pair = []
    for name, given, own in zip(("place", "turn"), (solid.place, solid.turn), found, strict=True):
        values = own if given is None else np.asarray(given, dtype=float)
        values = np.broadcast_to(values, own.shape) if values.shape == own.shape[1:] else values
        pair.append(checks.array(values, f"Argument `{name}` of a solid", (nodes, *own.shape[1:])))
    return pair[0], pair[1]


def _readouts(run: Entry, described: Sequence[tuple[np.ndarray, np.ndarray]], kept: np.ndarray) -> list[Readout]:
    found = []
    place = described[0][0]
    if np.max(np.ptp(place, axis=0)) > 1e-9 and len(described) == 1:
        unit = next((run.unit(name) for name in ("x", "q") if name in run.dataset), "")
        found += [Readout(axis, unit, place[kept, i], 3) for i, axis in enumerate("xyz")]
    if "euler_angles" in run.dataset and len(described) == 1:
        angles = np.degrees(run.values("euler_angles"))[kept]
        found += [Readout(name, "°", angles[:, i], 1, wraps=True) for i, name in enumerate(("yaw", "pitch", "roll"))]
    if "energy" in run.dataset:
        found.append(Readout("energy", run.unit("energy"), run.values("energy")[kept], 4))
    return found


def _three(value: object, name: str) -> list[float]:
    try:
        found = [float(number) for number in np.asarray(value, dtype=float)]
    except (TypeError, ValueError):
        found = []
    fits = len(found) == 3 and np.all(np.isfinite(found))
    checks.expect(fits, value, f"Argument `{name}` of a shape", "three finite numbers")
    return found


def _sizes(value: object, name: str) -> list[float]:
    found = _three(value, name)
    checks.expect(not min(found) <= 0, value, f"Argument `{name}` of a shape", "positive")
    return found
