"""The frames of ArduSub: the roles of its motors, and the thruster of a vehicle for each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.errors import ArgumentError
from coadjoint.units import same
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.thrusters import Thrusters

PWM_NEUTRAL, PWM_SPAN = 1500.0, 400.0
"""The pulse of a motor at rest, µs, and its distance from the pulse of full thrust."""

FRAMES: dict[str, tuple[tuple[float, ...], ...]] = {
    "bluerov1": (
        (0, 0, -1, 0, 1, 0),
        (0, 0, 1, 0, 1, 0),
        (-0.5, 0.5, 0, 0.45, 0, 0),
        (0.5, 0.5, 0, 0.45, 0, 0),
        (0, -1, 0, 1, 0, 0),
        (-0.25, 0, 0, 0, 0, 1),
    ),
    "vectored": (
        (0, 0, 1, 0, -1, 1),
        (0, 0, -1, 0, -1, -1),
        (0, 0, -1, 0, 1, 1),
        (0, 0, 1, 0, 1, -1),
        (1, 0, 0, -1, 0, 0),
        (-1, 0, 0, -1, 0, 0),
    ),
    "vectored_6dof": (
        (0, 0, 1, 0, -1, 1),
        (0, 0, -1, 0, -1, -1),
        (0, 0, -1, 0, 1, 1),
        (0, 0, 1, 0, 1, -1),
        (1, -1, 0, -1, 0, 0),
        (-1, -1, 0, -1, 0, 0),
        (1, 1, 0, -1, 0, 0),
        (-1, 1, 0, -1, 0, 0),
    ),
}
"""Of each motor how much it does for roll to starboard, pitch up, yaw to starboard, ascent, ahead and starboard
(ArduPilot, libraries/AP_Motors/AP_Motors6DOF.cpp, `setup_motors`; GPL-3, of which only these facts are taken)."""

SMALL = 0.05
"""The part of the largest force, or torque, of any thruster below which one gives none."""


class Motor(NamedTuple):
    """The thruster, from 0, that a motor is, and +1, or −1 where it pushes the other way."""

    thruster: int
    sign: int


def thrusters_of(vehicle: Vehicle) -> Thrusters:
    """The one part of a vehicle that is thrusters; raises ArgumentError for none or several."""
    found = [part for part in vehicle.commanded if isinstance(part, Thrusters)]
    if len(found) != 1:
        raise ArgumentError(
            f"ArduSub drives thrusters: a vehicle needs one part of the kind `thrusters`, but {vehicle.name} has "
            f"{len(found)}."
        )
    return found[0]


def motors(frame: str, thrusters: Thrusters) -> list[Motor]:
    """Which thruster each motor of a frame is, in the order of ArduSub's outputs.

    A motor is the thruster whose forces and torques have the signs of all that the motor is meant to do, or all the
    other signs, of a propeller that turns the other way. Raises ArgumentError where no thruster, or several, have.
    """
    checks.known(frame, FRAMES, "frame", "ArduSub")
    meant = np.array(FRAMES[frame])
    if len(meant) != thrusters.count:
        raise ArgumentError(
            f"ArduSub's frame {frame} has {len(meant)} motors, but `{thrusters.name}` has {thrusters.count} thrusters."
        )
    signs = np.sign(_noticeable(thrusters.nominal_matrix))
    found = [_motor(frame, number, row, signs) for number, row in enumerate(meant)]
    if len({motor.thruster for motor in found}) < len(found):
        raise ArgumentError(f"Two motors of ArduSub's frame {frame} would be one thruster of `{thrusters.name}`.")
    return found


def _noticeable(matrix: np.ndarray) -> np.ndarray:
    """B without entries that are small compared with the largest force or torque."""
    least = SMALL * np.repeat([np.max(np.abs(matrix[:3])), np.max(np.abs(matrix[3:]))], 3)
    return np.where(np.abs(matrix) > least[:, None], matrix, 0.0)


def _motor(frame: str, number: int, factors: np.ndarray, signs: np.ndarray) -> Motor:
    roll, pitch, yaw, ascent, ahead, starboard = np.sign(factors)
    wanted = np.array([ahead, starboard, -ascent, roll, pitch, yaw])
    does = wanted != 0
    for sign in (1, -1):
        fitting = np.flatnonzero(np.all(signs[does] == sign * wanted[does, None], axis=0))
        if len(fitting) == 1:
            return Motor(int(fitting[0]), sign)
        if len(fitting) > 1:
            break
    rows = [f"{'+' if x > 0 else '-'}{name}" for name, x in zip("XYZKMN", wanted, strict=True) if x]
    raise ArgumentError(
        f"Motor {number + 1} of ArduSub's frame {frame} gives {', '.join(rows)}: "
        f"{'several thrusters do' if len(fitting) else 'no thruster does'}. Take another frame."
    )


def commands(motors: Sequence[Motor], thrusters: Thrusters, pulses: Sequence[int]) -> np.ndarray:
    """The commands (n,) of pulses, µs: unchanged if commands are µs, otherwise fractions of the ends of the range.

    A pulse of 0 means no pulse, and is neutral.
    """
    found = np.full(thrusters.count, float(thrusters.curve.neutral))
    for motor, pulse in zip(motors, pulses, strict=False):
        share = motor.sign * (pulse - PWM_NEUTRAL) / PWM_SPAN if pulse else 0.0
        found[motor.thruster] += _span(thrusters, motor.thruster, share) * share
    return found


def _span(thrusters: Thrusters, number: int, share: float) -> float:
    """How far the command of full thrust is from the neutral one, on the side of the share."""
    if same(thrusters.unit, "µs"):
        return PWM_SPAN
    if thrusters.limit is None:
        raise ArgumentError(
            f"The commands of `{thrusters.name}` are in {thrusters.unit} without limits: give `limit`, which full "
            f"thrust is."
        )
    low, high = (np.broadcast_to(end, (thrusters.count,))[number] for end in thrusters.limit)
    return float(high - thrusters.curve.neutral if share >= 0 else thrusters.curve.neutral - low)
