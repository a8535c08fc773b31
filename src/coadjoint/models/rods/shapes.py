"""States in which rods start, and where their sections are."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups import SE2, SE3, Power
from coadjoint.kernels.run.disk_cache import evaluated
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.mechanics.members import Each, Quantity
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.orientation import orientation
from coadjoint.models.quantities import direction, number, vector
from coadjoint.models.rods.strains import each_element, straight

OPEN = 1e-3
"""How far the end of a ring may be from its beginning at the start, in lengths of an element, and in rad."""


def start(
    rod: System,
    *,
    position: Quantity = (0.0, 0.0, 0.0),
    rotation: Quantity | None = None,
    euler_zxz: Quantity | None = None,
    euler_zyx: Quantity | None = None,
    curvature: Quantity | None = None,
    velocity: Quantity = (0.0, 0.0, 0.0),
    angular_velocity: Quantity = (0.0, 0.0, 0.0),
    down: Quantity = (0.0, 0.0, -1.0),
) -> State:
    """The state of a rod of `cosserat` in the shape of its curvatures, moving as a rigid body or section by section.

    position, rotation, euler_zxz, euler_zyx: the pose (R, x) of the first section, clamped or not, x (3,) in m; the rod
    begins along the first column of R. curvature: κ (3,) or (M, 3), rad/m, by default that at rest; not stretched.
    velocity, angular_velocity: v and ω in space of a rigid motion about the mean of the sections, (3,) each, m/s and
    rad/s, or of every section, (N, 3). down: the direction of gravity, a unit vector (3,). Clamped ends stay
    where they are, and a ring must be closed. Raises ArgumentError for others, and where an element turns by π or more.
    """
    R, _ = orientation(rotation, euler_zxz, euler_zyx)
    return _start(rod, (R, vector(position, "position")), curvature, velocity, angular_velocity, down)


def planar_start(
    rod: System,
    *,
    position: Quantity = (0.0, 0.0),
    angle: Quantity = 0.0,
    curvature: Quantity | None = None,
    velocity: Quantity = (0.0, 0.0),
    angular_velocity: Quantity = 0.0,
    down: Quantity = (0.0, -1.0),
) -> State:
    """The state of a rod of `planar`, as `start`.

    position: of the first section, (2,), m. angle: of its tangent, rad. curvature: one number or (M,), rad/m, that at
    rest by default. velocity: (2,) or (N, 2), m/s. angular_velocity: one number or (N,), rad/s. down: a unit vector,
    (2,). Raises ArgumentError as `start`.
    """
    theta = number(angle, "angle")
    turned = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
    return _start(rod, (turned, vector(position, "position", 2)), curvature, velocity, angular_velocity, down)


def centerline(state: State) -> np.ndarray:
    """Where the sections of a state are, (N, 3) or (N, 2), or of records with leading axes, m; not the clamped ends.

    state: a state or records of a rod, as `run.final` and `run.records`. Raises ArgumentError for others.
    """
    group = state.places.group if isinstance(state, State) and state.places is not None else None
    fits = isinstance(group, Power) and isinstance(group.factor, (SE2, SE3))
    checks.expect(fits, state, "state", "a state or records of a rod, as run.final and run.records")
    g: Any = state.g
    return np.asarray(g[1])


def curve(rod: System, first: Any, strain: PyTree) -> PyTree:
    """The poses (M + 1, …) of sections one after the other from the first one, of strains (M, d)."""
    group: Any = rod.group
    p: PyTree = rod.parameters

    turns = np.asarray(strain) * np.asarray(p.length)[:, None]
    moved = evaluated("curve", lambda turns: jax.vmap(group.factor.exp)(turns), turns)
    poses = [jax.tree.map(np.asarray, first)]
    # One after the other: each pose is that of the section before it times its own element's to the last digit.
    for R, x in zip(*moved, strict=True):
        poses.append(group.factor.compose(poses[-1], (R, x)))
    return jax.tree.map(lambda *parts: np.stack(parts), *poses)


def _start(
    rod: System,
    first: Any,
    curvature: Quantity | None,
    velocity: Quantity,
    angular_velocity: Quantity,
    down: Quantity,
) -> State:
    group = rod_of(rod)
    p: PyTree = rod.parameters
    for name in ("length",) if curvature is not None else ("length", "rest_curvature"):
        if isinstance(getattr(p, name), Each) or traced(getattr(p, name)):
            raise ArgumentError(
                f"The shape in which a rod starts follows from its `{name}`, of which members have several, or by "
                "which jax.grad differentiates: take the start of one rod for all"
                + (", or give `curvature`." if name == "rest_curvature" else ".")
            )
    size, M = len(first[1]), len(p.length)
    turning = group.factor.dim - size
    if turning != (3 if size == 3 else 1):
        right = "planar_start" if size == 3 else "start"
        raise ArgumentError(f"A {rod.name} starts by co.models.rods.{right}, not by that of the other rods.")
    kappa = float64(p.rest_curvature if curvature is None else curvature, "Argument `curvature`")
    checks.shape(kappa, "curvature", *(((3,), (M, 3)) if turning == 3 else ((), (M,))))
    strain = each_element(straight(size == 2), M)
    strain[:, :turning] = np.reshape(kappa, (-1, turning))
    _require_turns(strain[:, :turning], p.length, "curvature")
    at_rest = p.rest_curvature.values if isinstance(p.rest_curvature, Each) else p.rest_curvature
    if not traced(at_rest):
        for one in np.reshape(at_rest, (-1, M, turning)):
            _require_turns(one, p.length, "rest_curvature")
    poses = curve(rod, first, strain)
    pairs = rod_pairs(rod)
    if pairs[-1][1] == 0 and pairs[0][0] >= 0:
        _require_closed(poses, p.length)
    begin = int(pairs[0][0] < 0)
    R, x = (leaf[begin : begin + group.count] for leaf in poses)
    a0: dict[str, PyTree] = {"joint": _clamps(rod, pairs, poses)}
    if hasattr(p, "gravity"):
        a0["down"] = [*direction(down, "down", size), 0.0]
    if hasattr(p, "load"):
        a0["tip"] = None
    return rod.state(g=(R, x), xi=_velocities(R, x, velocity, angular_velocity), a0=a0)


def _require_turns(kappa: np.ndarray, length: np.ndarray, name: str) -> None:
    """Raise ArgumentError where an element turns by π or more, which its strain does not see."""
    turns = np.linalg.norm(kappa, axis=1) * length
    if np.max(turns) >= np.pi:
        e = int(np.argmax(turns))
        raise ArgumentError(
            f"An element of a rod may turn by less than π, but of `{name}` element {e} turns by {turns[e]:.4g} rad: "
            "take more elements."
        )


def _require_closed(poses: PyTree, length: np.ndarray) -> None:
    """Raise ArgumentError where the last of the poses (M + 1, …) of a ring is not the first."""
    R, x = poses
    gap, turn = np.linalg.norm(x[-1] - x[0]), np.max(np.abs(R[-1] - R[0]))
    if gap > OPEN * np.min(length) or turn > OPEN:
        raise ArgumentError(
            f"A ring must start closed, but in this shape its end is {gap:.3g} m away from its beginning: give "
            f"`curvature`; that of a circle of its length is 2π/L = {2 * np.pi / np.sum(length):.6g} rad/m, about one "
            "axis."
        )


def _clamps(rod: System, pairs: PyTree, poses: PyTree) -> PyTree:
    """e₀ of every element: e, and the poses of clamped ends, with those of the first one inverted."""
    R, x = poses
    size = x.shape[1]
    turned, moved = np.tile(np.eye(size), (len(pairs), 1, 1)), np.zeros((len(pairs), size))
    if pairs[0][0] < 0:
        turned[0], moved[0] = R[0].T, -R[0].T @ x[0]
    if pairs[-1][1] < 0:
        turned[-1], moved[-1] = R[-1], x[-1]
    return turned, moved


def _velocities(R: np.ndarray, x: np.ndarray, velocity: Quantity, angular_velocity: Quantity) -> np.ndarray:
    """ξ (N, d) of velocities in space."""
    N, size = x.shape
    v = float64(velocity, "Argument `velocity`")
    omega = float64(angular_velocity, "Argument `angular_velocity`")
    turning = (3,) if size == 3 else ()
    for name, given, shape in (("velocity", v, (size,)), ("angular_velocity", omega, turning)):
        checks.shape(given, name, shape, (N, *shape))
    if np.ndim(omega) == len(turning):
        away = x - np.mean(x, axis=0)
        rigid = np.cross(omega, away) if size == 3 else omega * np.stack([-away[:, 1], away[:, 0]], axis=1)
        v = v + rigid
        omega = np.broadcast_to(omega, (N, *turning))
    moving = np.einsum("nij,ni->nj", R, np.broadcast_to(v, (N, size)))
    spinning = np.einsum("nij,ni->nj", R, omega) if size == 3 else omega[:, None]
    return np.concatenate([spinning, moving], axis=1)


def rod_of(rod: System) -> Power:
    """The group of a rod; raises ArgumentError for another system."""
    if not isinstance(rod, System) or not isinstance(rod.group, Power) or not hasattr(rod.parameters, "rest_curvature"):
        raise ArgumentError(f"Argument `rod` must be a rod of co.models.rods, but is {shown(rod)}.")
    return rod.group


def rod_pairs(rod: System) -> tuple[tuple[int, int], ...]:
    """The pairs of sections that the elements of a rod join."""
    advected: Any = rod.advected
    names = advected.names if hasattr(advected, "names") else ("joint",)
    return advected.factors[names.index("joint")].of(rod.group)
