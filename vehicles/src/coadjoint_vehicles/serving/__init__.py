"""Vehicles for programs of others: one period at a time over UDP, for ArduSub's flight software or as plain JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.serving.ardupilot import Lockstep as Lockstep
    from coadjoint_vehicles.serving.frames import FRAMES as FRAMES
    from coadjoint_vehicles.serving.frames import Motor as Motor
    from coadjoint_vehicles.serving.frames import motors as motors
    from coadjoint_vehicles.serving.inertial import Inertial as Inertial
    from coadjoint_vehicles.serving.inertial import inertial as inertial
    from coadjoint_vehicles.serving.loop import Loop as Loop
    from coadjoint_vehicles.serving.plain import Service as Service
    from coadjoint_vehicles.serving.served import Reading as Reading
    from coadjoint_vehicles.serving.served import Served as Served

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
