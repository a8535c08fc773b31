"""How turns and thrust are shared among the parts of a vehicle that has fins and propulsion."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from coadjoint.arrays import Array
from coadjoint.errors import ArgumentError
from coadjoint_vehicles.parts.allocator import LEAST_AUTHORITY
from coadjoint_vehicles.trim.under_way import UnderWay


class Allocation(NamedTuple):
    """Commands = matrix · (roll, pitch, yaw, ahead), a row for each command, in the order of `names` of the parts.

    Of each of the first three columns the largest entry is 1: it counts in rad of a fin. A turn that no fin makes has
    zeros. Of the last, all that push ahead have 1, or −1 where
    their negative commands do.
    """

    matrix: Any
    names: tuple[str, ...]


def allocation(motion: UnderWay) -> Allocation:
    """The least-squares fin angles that turn about one axis and about no other, at the speed of `motion`.

    A command whose push ahead at this speed exceeds its turning effect is propulsion; turns do not use it.
    Raises ArgumentError without propulsion, or where no fin pitches or yaws, but for a vehicle that its fins turn in
    yaw alone and that holds the speed by itself, as a ship with constant revolutions does.
    """
    screws = propulsion(motion)
    torques = np.where(screws, 0.0, motion.effects[3:])
    largest = np.abs(torques).max(axis=1) if len(screws) else np.zeros(3)
    if largest[2] > 0 and not screws.any() and not largest[:2].any() and holds_speed(motion):
        none, yaw = np.zeros(len(screws)), np.linalg.pinv(torques)[:, 2]
        return Allocation(np.column_stack([none, none, yaw / np.abs(yaw).max(), none]), motion.names)
    if not screws.any() or min(largest[1:]) <= LEAST_AUTHORITY * max(largest):
        raise ArgumentError(
            "This controller needs parts that push ahead and fins that pitch and turn the vehicle, each with a "
            f"limit, but found {', '.join(dict.fromkeys(motion.names)) or 'no part that is commanded'}."
        )
    shares, alone = _shares(torques)
    if not alone[0]:  # No fins control roll: the righting moment balances their roll as a side effect.
        shares, alone = _shares(np.array([[0.0], [1.0], [1.0]]) * torques)
    if not alone[1:].all():
        raise ArgumentError("The fins of this vehicle cannot pitch and turn it one without the other.")
    biggest = np.abs(shares).max(axis=0)
    columns = np.where(alone & (biggest > 0), shares / np.where(biggest > 0, biggest, 1.0), 0.0)
    return Allocation(np.column_stack([columns, np.where(motion.effects[0] < 0, -1.0, 1.0) * screws]), motion.names)


def _shares(torques: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles for each unit torque, and whether they produce that torque only."""
    shares = np.linalg.pinv(torques, rcond=LEAST_AUTHORITY)
    return shares, np.linalg.norm(torques @ shares - np.eye(3), axis=0) < 1e-3


def propulsion(motion: UnderWay) -> np.ndarray:
    """Which commands push ahead rather than turn."""
    return np.abs(motion.effects[0]) > np.linalg.norm(motion.effects[3:], axis=0)


def holds_speed(motion: UnderWay) -> bool:
    """Whether a vehicle goes on at this speed without commands: its surge is below 1 % of that at twice the speed."""
    return abs(motion.level.surge(motion.speed)) < 0.01 * abs(motion.level.surge(2 * motion.speed))


def commands_of(mixed: Allocation, values: Array, vehicle: Any) -> dict[str, object]:
    """A row of commands, in the order of `mixed.names`, by the names of the parts and in their shapes."""
    found, start = {}, 0
    for name in dict.fromkeys(mixed.names):
        shape, count = vehicle.part(name).command.shape, mixed.names.count(name)
        found[name] = values[start : start + count].reshape(shape)
        start += count
    return found
