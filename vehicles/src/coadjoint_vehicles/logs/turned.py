"""The measurements of a log, turned from its axes to those of the library."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from coadjoint.errors import FileError
from coadjoint.groups import attitude
from coadjoint.identification.channels import ATTITUDE, POSITION, RATES, VEHICLE, VELOCITY
from coadjoint_vehicles.axes import Axes, body_axes, rotation

_QUATERNION = ("qw", "qx", "qy", "qz")


def turned(file: str, given: Mapping[str, np.ndarray], axes: Axes) -> dict[str, np.ndarray]:
    """Columns of the vehicle in north, east, down and forward, starboard, down.

    given: numbers in SI units and rad by the names of `NAMES`, in `axes`. Raises FileError, which begins with `file`,
    for duplicate columns and for invalid quaternions.
    """
    columns: dict[str, np.ndarray] = {}
    turn = np.diag(body_axes(axes))
    if axes == "NED/FRD":
        aliases = {"x": ("north", 1), "y": ("east", 1), "z": ("depth", 1), "down": ("depth", 1), "up": ("depth", -1)}
    else:
        aliases = {"x": ("east", 1), "y": ("north", 1), "z": ("depth", -1), "down": ("depth", 1), "up": ("depth", -1)}
    for name, (inside, sign) in {**{name: (name, 1) for name in POSITION}, **aliases}.items():
        if name in given:
            if inside in columns:
                raise FileError(f"{file}: `{name}` says again what another column says, `{inside}`: leave one out.")
            columns[inside] = sign * given[name]
    for names in (VELOCITY, RATES):
        columns.update({name: sign * given[name] for name, sign in zip(names, turn, strict=True) if name in given})
    columns.update(_attitude(file, given, axes))
    return {name: columns[name] for name in VEHICLE if name in columns}


def _attitude(file: str, given: Mapping[str, np.ndarray], axes: Axes) -> dict[str, np.ndarray]:
    """Roll, pitch and heading of north, east, down."""
    if any(name in given for name in _QUATERNION):
        missing = [name for name in _QUATERNION if name not in given]
        if missing:
            raise FileError(f"{file}: a quaternion needs qw, qx, qy and qz, but {', '.join(missing)} is missing.")
        if any(name in given for name in (*ATTITUDE, "yaw")):
            raise FileError(f"{file}: attitude is given twice, by a quaternion and by angles: leave one out.")
        both = np.stack([given[name] for name in _QUATERNION], axis=-1)
        good = np.all(np.isfinite(both), axis=1)
        length = np.linalg.norm(both[good], axis=1, keepdims=True)
        if np.any(np.abs(length - 1) > 0.05):
            worst = float(length.flat[np.argmax(np.abs(length - 1))])
            raise FileError(f"{file}: quaternions must have length 1, but one has {worst:.3g}.")
        R = rotation(attitude.from_quaternion(both[good] / length), axes)
        angles = np.full((3, len(both)), np.nan)
        angles[:, good] = attitude.zyx_angles(R)
        return dict(zip(("heading", "pitch", "roll"), angles, strict=True))
    if "yaw" in given and "heading" in given:
        raise FileError(f"{file}: `yaw` says again what `heading` says: leave one out.")
    found = {name: given[name] for name in ATTITUDE if name in given}
    if "yaw" in given:
        found["heading"] = given["yaw"] if axes == "NED/FRD" else np.pi / 2 - given["yaw"]
    if axes == "ENU/FLU" and "pitch" in found:
        found["pitch"] = -found["pitch"]
    return found
