"""Data sheets of thrusters: thrust and electric current by pulse width and supply voltage, each in a file."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from types import ModuleType

import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.checks import choice
from coadjoint.errors import ArgumentError
from coadjoint.units import ELECTRIC_CURRENT, FORCE, VOLTAGE, factor_to

DATA = files("coadjoint_vehicles") / "parts" / "data"


@dataclass(frozen=True, eq=False)
class DataSheet:
    """The bollard thrust F(u, V), N, and the current I(u, V), A, of one thruster, linear between their rows.

    voltages: V, (k,), growing. commands: u, (m,), growing, in command_unit. forces, currents: (k, m), N and A. neutral:
    the command of rest, one of the commands. Beyond the first and the last voltage those count.
    """

    name: str
    source: str
    command_unit: str
    neutral: float
    voltages: np.ndarray
    commands: np.ndarray
    forces: np.ndarray
    currents: np.ndarray

    def __post_init__(self) -> None:
        shape = (len(self.voltages), len(self.commands))
        growing = [np.diff(self.voltages) > 0, np.diff(self.commands) > 0, np.diff(self.forces, axis=1) >= 0]
        if np.shape(self.forces) != shape or np.shape(self.currents) != shape or not all(map(np.all, growing)):
            raise ArgumentError(
                f"The data sheet {self.name} must have a row of forces and of currents for each voltage, voltages and "
                "commands that grow, and forces that never fall along a row."
            )
        if self.neutral not in self.commands or np.any(self.forces[:, self.commands == self.neutral] != 0):
            raise ArgumentError(f"The data sheet {self.name} must have no force at its neutral command.")

    def forces_at(self, voltage: PyTree, numbers: ModuleType = np) -> Array:
        """F of the commands of the sheet at a voltage, (m,) N; numbers: numpy, or jax.numpy where it is traced."""
        return self._at(self.forces, voltage, numbers)

    def currents_at(self, voltage: PyTree, numbers: ModuleType = np) -> Array:
        """I of the commands of the sheet at a voltage, (m,) A."""
        return self._at(self.currents, voltage, numbers)

    def _at(self, rows: np.ndarray, voltage: PyTree, numbers: ModuleType) -> Array:
        found = rows[0]
        for k, (low, high) in enumerate(zip(self.voltages[:-1], self.voltages[1:], strict=True)):
            found = found + numbers.clip((voltage - low) / (high - low), 0.0, 1.0) * (rows[k + 1] - rows[k])
        return found

    def supplied(self, commands: np.ndarray, voltage: float, resistance: float) -> tuple[float, np.ndarray]:
        """(V, I): the voltage at thrusters that share a battery, and the current of each, (n,) A.

        V = V₀ − R Σ I(u_i, V), as `sagged`.
        """

        def current(V: float) -> float:
            return float(np.sum(np.interp(commands, self.commands, self.currents_at(V))))

        loaded = float(sagged(current, voltage, resistance, np))
        return loaded, np.interp(commands, self.commands, self.currents_at(loaded))


def sagged(current: Callable[[PyTree], PyTree], voltage: PyTree, resistance: PyTree, numbers: ModuleType) -> PyTree:
    """V of V = V₀ − R J(V), by the secant through V₀ and V₀ − R J(V₀): exact where J is linear in V.

    current: J, A, of the voltage. voltage: V₀, without load, V. resistance: R, Ω. numbers: numpy or jax.numpy.
    """
    first = current(voltage)
    second = current(voltage - resistance * first)
    # J(V₀ − d) ≈ J₀ − d (J₀ − J₁)/(R J₀), so that d = R J₀/(1 + (J₀ − J₁)/J₀).
    loaded = first > 0
    share = first / numbers.where(loaded, 2 * first - second, 1.0)
    return voltage - numbers.where(loaded, resistance * first * share, 0.0)


@cache
def data_sheet(name: str) -> DataSheet:
    """The data sheet of a thruster by its name; raises ArgumentError for one that does not ship."""
    choice(name, "published", sheet_names())
    given = tomllib.loads((DATA / f"{name}.toml").read_text(encoding="utf-8"))
    force, current, volt = (
        factor_to(dimension, given[key], f"{name} {key}")
        for dimension, key in ((FORCE, "force_unit"), (ELECTRIC_CURRENT, "current_unit"), (VOLTAGE, "voltage_unit"))
    )
    return DataSheet(
        name,
        given["source"],
        given["command_unit"],
        float(given["neutral"]),
        volt * np.array(given["voltages"], dtype=float),
        np.array(given["commands"], dtype=float),
        force * np.array(given["forces"], dtype=float),
        current * np.array(given["currents"], dtype=float),
    )


def sheet_names() -> tuple[str, ...]:
    """The thrusters whose data sheets ship."""
    return tuple(sorted(entry.name.removesuffix(".toml") for entry in DATA.iterdir() if entry.name.endswith(".toml")))
