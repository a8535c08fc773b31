"""Datasets as runs write them, made without running anything."""

from __future__ import annotations

import numpy as np
import xarray

GROUPS = {"SO3()": 3, "SE3()": 6}
_OF_VEHICLES = (
    ("inputs_depth", "m"),
    ("inputs_heading", "rad"),
    ("internal_rudder", "rad"),
    ("internal_controller_value_rudder", "rad"),
    ("internal_thrusters", "N"),
)
VEHICLE = dict.fromkeys(("a_down", "a_north"))
"""What to leave out for a run that is no vehicle's."""


def dataset(nodes: int = 200, group: str = "SO3()", method: str = "Midpoint(Cayley())", **variables) -> xarray.Dataset:
    """A run of `nodes` nodes over 10 s; `variables` replace or, with None, leave out what it holds."""
    time = np.linspace(0.0, 10.0, nodes)
    waves = np.stack([np.sin(time), np.cos(2 * time), 0.1 * time], axis=1)
    held = {
        "xi": np.resize(waves, (nodes, GROUPS[group])),
        "mu": np.resize(waves, (nodes, GROUPS[group])),
        "energy": 5.0 + 1e-6 * np.sin(time),
        "discrete_energy": 5.0 + 1e-3 * np.sin(time),
        "kelvin_noether": 2.0 + 1e-12 * np.stack([np.sin(time)], axis=1),
        "energy_budget": 5.0 + 1e-7 * time,
        "work_drag": -0.3 * time,
        "work_thrust": 0.3 * time + 0.1 * np.sin(time),
        "group_defect": 1e-15 * (1 + time),
        "euler_angles": np.stack([np.angle(np.exp(2j * time)), 0.1 * np.sin(time), 0 * time], axis=1),
        "q": waves,
        "nu": waves,
        "pi": waves,
        "n": waves,
        "a_down": np.broadcast_to([0.0, 0.0, 1.0], waves.shape),
        "a_north": np.broadcast_to([1.0, 0.0, 0.0], waves.shape),
        "current": np.broadcast_to([0.0, 0.2, 0.0], waves.shape),
        "inputs_depth": np.where(time < 5, 0.5, 1.0),
        "inputs_heading": np.where(time < 5, 0.0, 1.0),
        "internal_rudder": 0.2 * np.sin(time),
        "internal_controller_value_rudder": 0.25 * np.sin(time),
        "internal_thrusters": waves[:, :2],
        **variables,
    }
    dims = {
        name: ("time", *(f"{name}_{axis}" for axis in range(np.ndim(values) - 1)))
        for name, values in held.items()
        if values is not None
    }
    data = {name: (dims[name], held[name]) for name in dims}
    attrs = {"system": "made up", "method": method, "dt": 10.0 / (nodes - 1), "group": group}
    made = xarray.Dataset(data, coords={"time": time}, attrs=attrs)
    for name, unit in (("q", "m"), ("xi", "rad/s"), ("nu", "m/s"), ("energy", "J"), *_OF_VEHICLES):
        if name in made:
            made[name].attrs["units"] = unit
    if "internal_rudder" in made:
        made["internal_rudder"].attrs.update(low=-0.25, high=0.25)
    return made
