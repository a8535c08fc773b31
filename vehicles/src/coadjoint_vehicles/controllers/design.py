"""Gains from a vehicle's mass, damping and fins: poles placed in the linearised pitch, yaw and speed equations."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, prefixed
from coadjoint.extending import disk_cache
from coadjoint_vehicles.controllers.allocation import Allocation, allocation, propulsion
from coadjoint_vehicles.model.controller import Controller
from coadjoint_vehicles.model.loads import loads
from coadjoint_vehicles.parts.allocator import LEAST_AUTHORITY
from coadjoint_vehicles.trim.under_way import UnderWay, steady, under_way

DAMPING_RATIO = 0.9
LENGTHS = 1.5
"""The intended pole frequency of a turn is about U/L·LENGTHS rad/s, as far as fins and sampling allow."""
FULL_FIN = 0.25
"""rad: errors of pitch, roll or heading that may use the fins up."""
TURNING = 0.6
"""The part of the fins that a steady turn may use; the rest is in reserve."""
PLANES = {"roll": (0, 3, 1), "pitch": (1, 4, 2), "heading": (2, 5, 1)}
"""The column of the allocation, and the rows of the torque and of the slip, of a turn."""
WELL_DAMPED = 0.7
"""The damping ratio that is enough for any mode."""
SHIPPED = files(str(__package__)) / "data" / "cruise_gains.json"
"""What `propose` finds for shipped vehicles, as `python .ci/gains.py` writes it."""


def propose(controller: Controller, vehicle: object) -> Any:
    """A cruise controller with its allocation and with the gains that were left out, for a vehicle at controller.speed.

    Turns: θ̈ = a_q θ̇ + a_θ θ + b δ, with the side slip that a turn begins with in a_θ (w = Uθ, v = −Uψ: the Munk
    moment, and the lift of fins in the flow), gets the poles of s² + 2ζωs + ω², k_p = (ω² + a_θ)/b and
    k_d = (2ζω + a_q)/b; then k_d grows until the modes of slip, rate, angle and fins are damped too.
    Errors of pitch and heading count up to those that ask for a turn of TURNING of the fins (`reach`).
    Depth: θ_c = −(k_p e + k_i∫e − k_d ż), as fast as leaves every mode of (w, q, θ, fins, z, ∫e) damped.
    Speed: m u̇ = a u + b n gets PI with the same poles, and feed-forward of the trimmed thrust.
    """
    parts = parts_of_design("cruise", controller, vehicle)
    return _with(controller, disk_cache.recalled(parts, lambda: designed_gains(controller, vehicle), shipped_gains))


def parts_of_design(kind: str, controller: object, vehicle: PyTree) -> tuple[object, ...]:
    """What gains depend on: a vehicle without its own controller, of which the given one may be a copy or not."""
    return kind, controller, replace(vehicle, controller=None)


@cache
def shipped_gains() -> dict[str, dict[str, Any]]:
    """The results of `propose` that come with the library, by the digest of controller and vehicle."""
    found = json.loads(SHIPPED.read_text(encoding="utf-8"))
    return {one["digest"]: {name: one[name] for name in ("matrix", "names", "chosen")} for one in found.values()}


def _with(controller: Any, found: dict[str, PyTree], **more: Any) -> Any:
    """The controller with its allocation and the proposed values of missing fields."""
    mixed = Allocation(np.asarray(found["matrix"]), tuple(found["names"]))
    return replace(controller, allocation=mixed, **found["chosen"], **more)


def _found(controller: Any, mixed: Allocation, given: dict[str, PyTree]) -> dict[str, PyTree]:
    left_out = {name: value for name, value in given.items() if getattr(controller, name) is None}
    chosen = {name: value if np.ndim(value) else float(value) for name, value in left_out.items()}
    return {"matrix": mixed.matrix, "names": list(mixed.names), "chosen": chosen}


def designed_gains(controller: Any, vehicle: Any) -> dict[str, PyTree]:
    with prefixed(
        f"The controller `{controller.kind}` is designed for its `speed`, {controller.speed:g} m/s", ArgumentError
    ):
        motion = under_way(vehicle, controller.speed)
    mixed = allocation(motion)
    screws = propulsion(motion)
    fin, late, wanted = means(controller, vehicle, motion)
    turns = {axis: turning(motion, mixed, axis) for axis in ("roll", "pitch", "heading")}
    given: dict[str, PyTree] = {f"{axis}_gains": placed(turn, wanted, fin) for axis, turn in turns.items()}
    for axis in ("pitch", "heading"):
        given[f"{axis}_gains"] = damped(motion, mixed, axis, given[f"{axis}_gains"], late)
    pitch = given["pitch_gains"] if controller.pitch_gains is None else controller.pitch_gains
    for axis in ("pitch", "heading"):
        gains = (
            given[f"{axis}_gains"]
            if getattr(controller, f"{axis}_gains") is None
            else getattr(controller, f"{axis}_gains")
        )
        given[f"{axis}_reach"] = reach(motion, mixed, axis, gains, fin)
    thrust = motion.limits[screws].min() if screws.any() else 1.0
    given |= {
        "depth_gains": diving(motion, mixed, pitch, late),
        "speed_gains": surging(motion, mixed, controller.period + controller.delay),
        "feed_forward": np.abs(motion.trim[screws]).max(initial=0.0) / motion.speed,
        "fin_limit": fin,
        "thrust_limit": thrust,
    }
    return _found(controller, mixed, given)


class TurningModel(NamedTuple):
    """ω̇ = (u/U) flow (v, w, ω) + weight · down + (u/U)² G δ.

    inverse: G⁺. ahead: the part of the commands that pushes ahead. rolls: 1 where the fins master the righting moment,
    or 0.
    """

    flow: np.ndarray
    weight: np.ndarray
    inverse: np.ndarray
    ahead: np.ndarray
    rolls: np.ndarray


def turning_model(motion: UnderWay, mixed: Allocation, fin: float) -> TurningModel:
    """How a vehicle turns near straight motion, by fins up to `fin` (rad); axes that they do not master count as 0."""
    M = np.linalg.inv(motion.mass)
    all_of = loads(motion.level.vehicle)
    s = all_of.righting
    torque = np.array([[0.0, -s[2], s[1]], [s[2], 0.0, -s[0]], [-s[1], s[0], 0.0]])
    ahead = mixed.matrix[:, 3]
    weight = (M @ np.vstack([all_of.net_weight * np.eye(3), torque]))[3:]
    turns = (M @ motion.effects)[3:] * (ahead == 0) * np.any(mixed.matrix[:, :3] != 0, axis=0)[:, None]
    rolls = fin * np.abs(turns[0]).sum() > 1.5 * np.abs(weight[0]).max()
    turns[0] = turns[0] * rolls
    inverse = np.linalg.pinv(turns, rcond=LEAST_AUTHORITY)
    return TurningModel((M @ motion.damping)[3:, 1:], weight, inverse, ahead, np.asarray(float(rolls)))


def propose_attitude(controller: Any, vehicle: Any) -> Any:
    """An attitude controller with its model of a vehicle at controller.speed, and with the gains that were left out."""
    parts = parts_of_design("attitude", controller, vehicle)
    made = disk_cache.recalled(parts, lambda: _attitude_gains(controller, vehicle))
    return _with(controller, made, model=TurningModel(*made["model"]))


def _attitude_gains(controller: Any, vehicle: Any) -> dict[str, PyTree]:
    with prefixed(
        f"The controller `{controller.kind}` is designed for its `speed`, {controller.speed:g} m/s", ArgumentError
    ):
        motion = under_way(vehicle, controller.speed)
    mixed = allocation(motion)
    fin, _, wanted = means(controller, vehicle, motion)
    screws = propulsion(motion)
    given = {
        "attitude_gains": np.array([wanted**2, wanted**3 / 8, 2 * DAMPING_RATIO * wanted]),
        "speed_gains": surging(motion, mixed, controller.period + controller.delay),
        "feed_forward": np.abs(motion.trim[screws]).max() / motion.speed,
        "fin_limit": fin,
        "thrust_limit": motion.limits[screws].min(),
    }
    return {**_found(controller, mixed, given), "model": list(turning_model(motion, mixed, fin))}


def means(controller: Any, vehicle: Any, motion: UnderWay) -> tuple[float, float, float]:
    """The fins' limit (rad), how late they follow (s), and how fast a turn is wanted to be (rad/s)."""
    screws = propulsion(motion)
    fin = min(motion.limits[~screws].min(), np.radians(45)) if controller.fin_limit is None else controller.fin_limit
    late = motion.lags[~screws].max(initial=0.0) + 0.5 * controller.period + controller.delay
    length = vehicle.length if vehicle.length is not None else 10 * np.cbrt(vehicle.volume)
    return float(fin), float(late), float(min(LENGTHS * motion.speed / length, 0.35 / late))


class Turn(NamedTuple):
    """d²θ/dt² = rate dθ/dt + stiffness θ + effect δ."""

    rate: float
    stiffness: float
    effect: float


def turning(motion: UnderWay, mixed: Allocation, axis: str) -> Turn:
    """Roll, pitch or heading of a vehicle whose path does not turn yet."""
    slip = {"roll": 0.0, "pitch": 1.0, "heading": -1.0}[axis]
    A = plane(motion, mixed, axis)
    return Turn(A[1, 1], A[1, 0] * slip * motion.speed + A[1, 2], A[1, 3])


def plane(motion: UnderWay, mixed: Allocation, axis: str) -> np.ndarray:
    """d(slip, rate)/dt = A (slip, rate, angle, δ), A of shape (2, 4): slip is v or w, δ the mixed angle of the fins."""
    column, row, across = PLANES[axis]
    both = [across, row]
    righting = [0.0, 0.0 if axis == "heading" else -loads(motion.level.vehicle).righting[2]]
    effect = motion.effects[both] @ mixed.matrix[:, column]
    pushes = np.column_stack([motion.damping[np.ix_(both, both)], righting, effect])
    return np.linalg.solve(motion.mass[np.ix_(both, both)], pushes)


def reach(motion: UnderWay, mixed: Allocation, axis: str, gains: np.ndarray, fin: float) -> float:
    """The error, rad, that asks for the fastest turn that a part of the fins holds: e = (δ + k_d rate)/k_p.

    Half a turn where k_p is 0, and no error asks for anything.
    """
    if gains[0] == 0:
        return np.pi
    column, row, across = PLANES[axis]
    rate, angle = steady(motion, across, row, mixed.matrix[:, column], TURNING * fin)
    return max((angle + gains[2] * rate) / gains[0], 0.02)


def damped(motion: UnderWay, mixed: Allocation, axis: str, gains: np.ndarray, late: float) -> np.ndarray:
    """The gains with the least k_d that damps the modes of (slip, rate, angle, δ) well, or as well as can be."""
    if gains[0] == 0 or not mixed.matrix[:, PLANES[axis][0]].any():
        return gains
    found = []
    for more in np.linspace(0.0, 3.0, 61):
        tried = gains + np.array([0.0, 0.0, more * gains[0]])
        A = np.zeros((4, 4))
        A[:2], A[2, 1] = plane(motion, mixed, axis), 1.0
        A[3] = -np.array([0.0, tried[2], tried[0], 1.0]) / late
        found.append((min(damping_ratio(A), WELL_DAMPED), -more, tried))
    return max(found, key=lambda one: one[:2])[2]


def placed(turn: Turn, wanted: float, fin: float) -> np.ndarray:
    """(k_p, k_i, k_d) for the pole frequency `wanted`, rad/s, or the limit of the fins; zeros if no fin turns it."""
    if turn.effect == 0.0:
        return np.zeros(3)
    k_p = (wanted**2 + turn.stiffness) / turn.effect
    k_p = min(max(k_p, 0.2), fin / FULL_FIN * 1.0)
    frequency = np.sqrt(max(turn.effect * k_p - turn.stiffness, 0.25 * turn.effect * k_p))
    k_d = max((2 * DAMPING_RATIO * frequency + turn.rate) / turn.effect, 0.0)
    return np.array([k_p, k_p * frequency / 40, k_d])


def diving(motion: UnderWay, mixed: Allocation, pitch: np.ndarray, late: float) -> np.ndarray:
    """(k_p, k_i, k_d) of depth: the fastest that leave every mode about as well damped as those of pitch alone."""
    if pitch[0] == 0 or not mixed.matrix[:, 1].any():
        return np.zeros(3)
    U = motion.speed
    alone = damping_ratio(depth_loop(motion, mixed, np.zeros(3), pitch, late)[:4, :4])
    gains = np.zeros(3)
    for frequency in np.geomspace(0.5, 0.001, 60):
        gains = np.array([frequency, frequency**2 / 12, 0.3 * frequency]) / U
        if damping_ratio(depth_loop(motion, mixed, gains, pitch, late)) >= min(WELL_DAMPED, 0.9 * alone):
            break
    return gains


def damping_ratio(A: np.ndarray) -> float:
    """The least −Re s/|s| of the modes s of ẋ = Ax, 0 of a mode that stays, s = 0."""
    modes = np.linalg.eigvals(A)
    return float(np.min(-modes.real / np.where(modes == 0, 1.0, np.abs(modes))))


def depth_loop(motion: UnderWay, mixed: Allocation, depth: np.ndarray, pitch: np.ndarray, late: float) -> np.ndarray:
    """The closed loop of x = (w, q, θ, δ, z, ∫e), ẋ = Ax, of depth and pitch controllers; the fins are `late` (s)."""
    U = motion.speed
    A = np.zeros((6, 6))
    A[:2, :4] = plane(motion, mixed, "pitch")
    A[2, 1] = 1.0
    sink = np.array([1.0, 0, -U, 0, 0, 0])
    error = np.array([0.0, 0, 0, 0, -1, 0])
    climb = -(depth[0] * error + depth[1] * np.eye(6)[5] - depth[2] * sink)
    fin = pitch[0] * (climb - np.eye(6)[2]) - pitch[2] * np.eye(6)[1]
    A[3] = (fin - np.eye(6)[3]) / late
    A[4], A[5] = sink, error
    return A


def surging(motion: UnderWay, mixed: Allocation, late: float) -> np.ndarray:
    """(k_p, k_i, 0) of speed for two poles, as fast as the propulsion's lag and the sampling allow, at most in 2 s."""
    m, screws = motion.mass[0, 0], mixed.matrix[:, 3] != 0
    if not screws.any():
        return np.zeros(3)
    a, b = motion.damping[0, 0] / m, (motion.effects[0] @ mixed.matrix[:, 3]) / m
    frequency = min(0.5, 0.35 / (motion.lags[screws].max() + late))
    return np.array([max((2 * DAMPING_RATIO * frequency + a) / b, 0.0), frequency**2 / b / 4, 0.0])
