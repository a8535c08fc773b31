"""Sensors of vehicles: the reading of a motion, a pure function, and its errors by the numbers of data sheets."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.sensors.allan import allan_deviation as allan_deviation
    from coadjoint_vehicles.sensors.allan import expected_allan_deviation as expected_allan_deviation
    from coadjoint_vehicles.sensors.altimeter import Altimeter as Altimeter
    from coadjoint_vehicles.sensors.compass import Ahrs as Ahrs
    from coadjoint_vehicles.sensors.compass import Compass as Compass
    from coadjoint_vehicles.sensors.depth import Depth as Depth
    from coadjoint_vehicles.sensors.dvl import Dvl as Dvl
    from coadjoint_vehicles.sensors.dvl import DvlBeams as DvlBeams
    from coadjoint_vehicles.sensors.errors import Channel as Channel
    from coadjoint_vehicles.sensors.errors import Errors as Errors
    from coadjoint_vehicles.sensors.gps import Gps as Gps
    from coadjoint_vehicles.sensors.imu import Imu as Imu
    from coadjoint_vehicles.sensors.kinematics import Kinematics as Kinematics
    from coadjoint_vehicles.sensors.kinematics import at_node as at_node
    from coadjoint_vehicles.sensors.measurement import measurement as measurement
    from coadjoint_vehicles.sensors.noise import Noise as Noise
    from coadjoint_vehicles.sensors.sensor import Sensor as Sensor
    from coadjoint_vehicles.sensors.usbl import Usbl as Usbl

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
