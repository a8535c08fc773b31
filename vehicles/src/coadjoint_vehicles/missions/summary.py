"""A mission in numbers: how far, how deep, how well it kept to its set points, and for how much energy."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from coadjoint_vehicles.logs.records import VehicleRecords
from coadjoint_vehicles.missions.electric import electric_summary
from coadjoint_vehicles.model.saturation import OFTEN, at_limits, lost

if TYPE_CHECKING:
    from coadjoint.labelled import AnyDataset

LOST = "internal_controller_value_memory_lost"
"""What of the wanted wrench the limits of thrusters take away, at the nodes of a run."""

FAR = 45.0
"""°: an error of heading beyond it is that of a vehicle that does not follow."""
MOSTLY = 2 / 3
"""The part of the saved nodes at which a set point is far off, from which on a mission warns."""


def mission_summary(dataset: AnyDataset) -> dict[str, object]:
    """The figures of a vehicle's run from its saved nodes: SI units, angles in degrees.

    `energy_put_in` is ∫ P dt of each part, J, negative where it took energy out; `energy_of_actuators` the sum of those
    that put some in. A tracking error is set point minus value, headings within half a turn: its root mean square, and
    its last value. `saturated` is the part of the time that an actuator is at a limit, `lost` the mean and the largest
    of the force or torque along each axis that thrusters at their limits do not give, N and N m; `electric` is what
    thrusters with a data sheet draw.
    """
    log = VehicleRecords(dataset)
    steps = np.linalg.norm(np.diff(log.position, axis=0), axis=1)
    work = {name: float(values[-1]) for name, values in log.work.items()}
    seconds = float(dataset.attrs.get("seconds", 0.0))
    duration = float(log.time[-1] - log.time[0])
    return {
        "duration": duration,
        "times_real_time": duration / seconds if seconds > 0 else None,
        "path_length": float(np.sum(steps)),
        "depth_max": float(np.max(log.depth)),
        "speed_mean": float(np.sum(steps) / duration) if duration > 0 else None,
        "position_final": log.position[-1],
        "energy_put_in": work,
        "energy_of_actuators": sum(value for name, value in work.items() if value > 0 and name in log.actuators),
        "tracking": {**tracking(log), **across(log)},
        "electric": electric_summary(dataset),
        "saturated": saturation(log),
        "lost": lost(np.asarray(dataset[LOST], dtype=float)) if LOST in dataset else {},
    }


def tracking(log: VehicleRecords) -> dict[str, dict[str, float]]:
    """Root mean square and last value of the error of each set point that is a coordinate or a speed."""
    return {
        name: {"error_rms": float(np.sqrt(np.mean(error**2))), "error_final": float(error[-1])}
        for name, error in errors(log).items()
    }


REMEDY = " Its actuators are rarely at their limits: larger gains of the controller may hold it."


def errors(log: VehicleRecords) -> dict[str, np.ndarray]:
    """Set point minus value at the nodes, (nodes,), of each set point that is a coordinate or a speed; degrees."""
    roll, pitch, heading = log.attitude.T
    reached = {
        "depth": log.depth,
        "heading": heading,
        "pitch": pitch,
        "roll": roll,
        "speed": log.through_water[:, 0],
        "position": log.position,
    }
    found = {}
    for name, values in reached.items():
        if name not in log.set_points or log.set_points[name][0].shape != values.shape:
            continue
        error = log.set_points[name][0] - values
        if name in ("heading", "pitch", "roll"):
            error = np.degrees(np.angle(np.exp(1j * error)))
        found[name] = np.linalg.norm(error, axis=1) if error.ndim > 1 else error
    return found


def missed(log: VehicleRecords) -> list[str]:
    """A sentence for each of depth, heading and speed that is far off at the end and for most of the time.

    Far are FAR of a heading, half of the largest distance from the first depth, 1 m at least, and half of a speed.
    """
    found = []
    for name, error in errors(log).items():
        wanted = log.set_points[name][0]
        if name == "heading":
            far = FAR
        elif name == "depth":
            far = max(1.0, 0.5 * float(np.max(np.abs(wanted - log.depth[0]))))
        elif name == "speed":
            far = 0.5 * np.abs(wanted) + 0.1
        else:
            continue
        if not (away := np.abs(error) > far)[-1] or np.mean(away) <= MOSTLY:
            continue
        unit = {"heading": "°", "depth": " m", "speed": " m/s"}[name]
        found.append(
            f"The vehicle does not follow `{name}`: it is {np.mean(np.abs(error)):.3g}{unit} off in the mean, and "
            f"{abs(error[-1]):.3g}{unit} at the end."
            + (REMEDY if name == "heading" and max(saturation(log).values(), default=1.0) <= OFTEN else "")
        )
    return found


def across(log: VehicleRecords) -> dict[str, dict[str, float]]:
    """The distance over ground from the legs between way points: root mean square, and the last value."""
    if not len(log.way_points):
        return {}
    places = np.concatenate([log.position[:1], log.way_points])[:, :2]
    gaps = [_distance(log.position[:, :2], a, b) for a, b in pairwise(places)]
    gap = np.min(gaps, axis=0)
    return {"path": {"error_rms": float(np.sqrt(np.mean(gap**2))), "error_final": float(gap[-1])}}


def _distance(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Of points from the straight line between two others."""
    way = end - start
    part = np.clip((points - start) @ way / max(way @ way, 1e-300), 0.0, 1.0)
    return np.linalg.norm(points - start - part[:, None] * way, axis=1)


def saturation(log: VehicleRecords) -> dict[str, float]:
    """The fraction of the saved nodes at which each actuator, its command or one of its thrusters is at a limit.

    A limit of 0 is none.
    """
    found = {}
    for name, actuator in log.actuators.items():
        if not actuator.ends:
            continue
        values = [actuator.actual] if actuator.command is None else [actuator.actual, actuator.command]
        at = [at_limits(value, actuator.ends, value.ndim > 1) for value in values]
        found[name] = float(np.mean(np.logical_or.reduce(at)))
    return found


def spread(values: np.ndarray) -> dict[str, float]:
    """Mean, standard deviation (with N − 1), extremes and the 5, 50 and 95 % quantiles of a figure over members."""
    low, middle, high = np.quantile(values, (0.05, 0.5, 0.95))
    return {
        "mean": float(np.mean(values)),
        "std": float(np.std(values, ddof=1)) if len(values) > 1 else 0.0,
        "min": float(np.min(values)),
        "max": float(np.max(values)),
        "5%": float(low),
        "50%": float(middle),
        "95%": float(high),
    }
