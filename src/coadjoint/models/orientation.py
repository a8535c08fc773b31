"""Attitude and angular velocity at the start of a run, in the usual parametrisations."""

from __future__ import annotations

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.groups import attitude
from coadjoint.mechanics.members import Quantity
from coadjoint.models.quantities import angles, matrix, vector


def orientation(
    rotation: Quantity | None = None,
    euler_zxz: Quantity | None = None,
    euler_zyx: Quantity | None = None,
    angular_velocity: Quantity | None = None,
    euler_rates: Quantity | None = None,
) -> tuple[PyTree, PyTree]:
    """R (body to space, by default I) and the body angular velocity ω (by default 0).

    At most one of `rotation` (3, 3), `euler_zxz` = (ψ, θ, φ) and `euler_zyx` = (yaw, pitch, roll), in rad; at most one
    of `angular_velocity` ω (3,) in the body frame and `euler_rates`, the rates of the Euler angles given, in rad/s.
    Raises ArgumentError for other combinations and for wrong shapes.
    """
    given = {"rotation": rotation, "euler_zxz": euler_zxz, "euler_zyx": euler_zyx}
    _at_most_one(given)
    _at_most_one({"angular_velocity": angular_velocity, "euler_rates": euler_rates})
    if euler_rates is not None and euler_zxz is None and euler_zyx is None:
        raise ArgumentError("Argument `euler_rates` needs `euler_zxz` or `euler_zyx`, whose rates they are.")
    R = np.eye(3) if rotation is None else matrix(rotation, "rotation")
    omega = np.zeros(3) if angular_velocity is None else vector(angular_velocity, "angular_velocity")
    for name, turned, turning in (
        ("euler_zxz", attitude.zxz, attitude.zxz_angular_velocity),
        ("euler_zyx", attitude.zyx, attitude.zyx_angular_velocity),
    ):
        if given[name] is not None:
            first, second, third = angles(vector(given[name], name), name)
            R = turned(first, second, third)
            if euler_rates is not None:
                omega = turning(first, second, third, vector(euler_rates, "euler_rates"))
    return R, omega


def _at_most_one(arguments: dict[str, PyTree]) -> None:
    given = [name for name, value in arguments.items() if value is not None]
    if len(given) > 1:
        raise ArgumentError(f"Give one of {' and '.join(f'`{name}`' for name in given)}, not both.")
