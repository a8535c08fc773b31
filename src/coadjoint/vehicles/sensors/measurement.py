"""Sensors as measurements of filters."""

from __future__ import annotations

from typing import Any

from coadjoint.errors import ArgumentError, shown
from coadjoint.estimation.measurements import Measurement
from coadjoint.spaces.named import Named
from coadjoint.vehicles.sensors.kinematics import at_node
from coadjoint.vehicles.sensors.sensor import Sensor


def measurement(
    sensor: Sensor, *, gate: float | None = None, covariance: Any = None, bottom: Any = None
) -> Measurement:
    """A sensor as a `co.estimation.Measurement` of a craft: what it reads, and the covariance of its white noise.

        filter = co.estimation.Filter(process, start, measurements={dvl.name: measurement(dvl, gate=0.999)}, …)

    covariance: R, (m, m) or variances (m,), instead of the sensor's own, as where biases are to be in it. gate: as of
    `Measurement`. bottom: the depth of the bottom, m, for an altimeter. The current is that of the water's parameters
    where it is uniform, so that a filter may estimate it; otherwise 0.
    Raises ArgumentError for what is no sensor, and for one without white noise, whose covariance would be 0.
    """
    if not isinstance(sensor, Sensor):
        raise ArgumentError(f"A filter's measurement is made of a sensor such as Dvl, but got {shown(sensor)}.")
    if covariance is None and not all(sensor.deviation > 0):
        raise ArgumentError(
            f"The {sensor.title}` has no white noise in {sensor.names}: give it a `noise`, or `covariance` here."
        )
    own = Named(**sensor.parameters())
    more = {} if bottom is None else {"bottom": bottom}

    def function(motion: Any, p: Any) -> Any:
        current = {"current": p.water.velocity} if "velocity" in p.water else {}
        return sensor.reading(at_node(motion, gravity=p.gravity, **current, **more), own)

    R = sensor.covariance if covariance is None else covariance
    return Measurement(function, R, gate=gate, angles=sensor.angles)
