"""Sensors as measurements of filters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax.numpy as jnp

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.estimation import Measurement
from coadjoint.spaces import Named
from coadjoint_vehicles.sensors.kinematics import Kinematics, at_node
from coadjoint_vehicles.sensors.sensor import Sensor


def measurement(
    sensor: Sensor,
    *,
    gate: float | None = None,
    covariance: object = None,
    bottom: object = None,
    kinematics: Callable[..., Kinematics] | None = None,
    biased: Sequence[str] = (),
) -> Measurement:
    """A sensor as a `co.estimation.Measurement` of a craft: its reading, and the covariance of its white noise.

        filter = co.estimation.Filter(process, start, measurements={dvl.name: measurement(dvl, gate=0.999)}, …)

    covariance: R, (m, m) or variances (m,), instead of the sensor's own, as where biases are to be in it. gate: as of
    `Measurement`. bottom: the depth of the bottom, m, for an altimeter. kinematics: `co.vehicles.readings.kinematics`
    of the craft, which give the readings of a run, accelerations and any water included; by default the
    motion and the parameters alone, in still or uniform water, whose current a filter may estimate. biased: channels
    whose bias is a number of the process, `NAME_CHANNEL` of its `biases`, as imu_gyroscope; by default none.
    Raises ArgumentError unless it is a sensor, for a sensor without white noise, whose covariance would be 0, and if
    the motion and the parameters do not determine its reading.
    """
    checks.instance(sensor, "sensor", Sensor, "a sensor such as Dvl")
    if covariance is None and not all(sensor.deviation > 0):
        raise ArgumentError(
            f"The {sensor.title}` has no white noise in {sensor.names}: give it a `noise`, or `covariance` here."
        )
    for name in biased:
        checks.known(name, [channel.name for channel in sensor.channels], "channel", f"The {sensor.title}`")
    own, space = Named(**sensor.parameters()), sensor.errors_in()

    def exact(motion: PyTree, p: Named) -> PyTree:
        if kinematics is None:
            return sensor.value(_of_motion(sensor, motion, p, bottom), own)
        found = kinematics(motion, p)
        return sensor.value(found if bottom is None else found._replace(bottom=bottom), own)

    def with_biases(motion: PyTree, p: Named, biases: object) -> PyTree:
        parts = [_bias(sensor, channel, biased, biases) for channel in sensor.channels]
        return space.moved(exact(motion, p), jnp.concatenate(parts))

    R = sensor.covariance if covariance is None else covariance
    function = with_biases if biased else exact
    return Measurement(
        function, R, gate=gate, of_state=kinematics is not None, space=sensor.space, coordinates=sensor.coordinates
    )


def _bias(sensor: Sensor, channel: Any, biased: Sequence[str], biases: PyTree) -> Array:
    if channel.name not in biased:
        return jnp.zeros(len(channel.components))
    name = f"{sensor.name}_{channel.name}"
    if name not in biases or jnp.shape(getattr(biases, name)) != (len(channel.components),):
        raise ArgumentError(
            f"The process has no bias `{name}` of {len(channel.components)} numbers: give it one, as in "
            f"biases={{'{name}': RandomWalk({[0.0] * len(channel.components)})}}."
        )
    return getattr(biases, name)


def _of_motion(sensor: Sensor, motion: PyTree, p: Named, bottom: object) -> Kinematics:
    """The kinematics of a motion with the parameters of a craft in still or uniform water."""
    more = {} if bottom is None else {"bottom": bottom}
    plain = set(p.water) <= {"velocity"}
    if "velocity" in p.water:
        more["current"] = p.water.velocity
    elif getattr(sensor, "track", "ground") == "water":
        raise _unknown(sensor, "the velocity of the water")
    if plain and "fluid_density" in p:
        more |= {"head": p.fluid_density * motion.q[2], "density": p.fluid_density}
    elif "density" in sensor.parameters():
        raise _unknown(sensor, "the pressure of the water")
    return at_node(motion, gravity=p.gravity, **more)


def _unknown(sensor: Sensor, what: str) -> ArgumentError:
    return ArgumentError(
        f"The {sensor.title}` reads {what}, which parameters say of uniform water alone: give "
        "`kinematics=co.vehicles.readings.kinematics(craft)`."
    )
