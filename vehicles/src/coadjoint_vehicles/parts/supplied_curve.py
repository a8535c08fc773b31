"""The force curve of a thruster by its data sheet, at the voltage that its battery has under load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import traced
from coadjoint.models.quantities import positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.data_sheets import DataSheet, data_sheet, sagged
from coadjoint_vehicles.parts.force_curves import ForceCurve, Table
from coadjoint_vehicles.parts.measured import Measured, check_fields, measured


@dataclass(frozen=True, eq=False)
class Supplied(ForceCurve):
    """F(u, V) of a data sheet with V = V₀ − R Σ I(u_i, V) over the thrusters of the part, which share a battery.

    published: the data sheet, as "T200". voltage: V₀, V, of the battery without load. resistance: R, Ω, of battery and
    cables; none if left out. Commands for wanted forces are those at V₀, as of software on board that does not know the
    sag. Raises ArgumentError.
    """

    kind: ClassVar[str] = "published"
    published: str
    voltage: Measured = measured(u.VOLTAGE, positive)
    resistance: Measured = measured(u.RESISTANCE, positive, default=None)

    def __post_init__(self) -> None:
        check_fields(self, f"force curve `{self.published}")
        low, high = self.sheet.voltages[[0, -1]]
        if not traced(self.voltage) and not low <= self.voltage <= high:
            raise ArgumentError(
                f"Argument `voltage` of the force curve `{self.published}` must be from {low:g} to {high:g} V, those "
                f"of its data sheet, but is {self.voltage:g} V."
            )

    def require_supply(self, commands: np.ndarray, of: str) -> None:
        """Raise ArgumentError where the battery would fall to 0 V at these commands of all thrusters, (n,)."""
        if self.resistance is None or traced(self.voltage, self.resistance):
            return
        left, current = self.sheet.supplied(commands, float(self.voltage), float(self.resistance))
        if left <= 0:
            most = float(np.sum(np.interp(commands, self.sheet.commands, self.sheet.currents[0])))
            raise ArgumentError(
                f"Argument `resistance{of}` must leave a voltage at full thrust, but {self.resistance:g} Ω takes "
                f"{self.voltage:g} V away by {self.voltage / self.resistance:.3g} A of the {most:.3g} A of "
                f"{len(current)} thrusters: is its unit mΩ?"
            )

    @property
    def sheet(self) -> DataSheet:
        """Its data sheet."""
        return data_sheet(self.published)

    @property
    def in_file(self) -> PyTree:
        return self.published

    @property
    def neutral(self) -> float:
        return self.sheet.neutral

    @property
    def reach(self) -> tuple[float, float]:
        return float(self.sheet.commands[0]), float(self.sheet.commands[-1])

    def force(self, command: Array, own: Named) -> Array:
        table, sheet, voltage = self._table, self.sheet, own.voltage
        if "resistance" in own:

            def current(V: Array) -> Array:
                return jnp.sum(table.force(command, self._rows(sheet.currents_at(V, jnp))))

            voltage = sagged(current, voltage, own.resistance, jnp)
        return table.force(command, self._rows(sheet.forces_at(voltage, jnp)))

    def command(self, force: Array, own: PyTree, limit: PyTree) -> Array:
        return self._table.command(force, self._rows(self.sheet.forces_at(own.voltage, jnp)), limit)

    @property
    def _table(self) -> Table:
        """The rows as a table, whose row of rest is that of the neutral command at any voltage."""
        force = self.sheet.forces[-1] + 1e-9 * (self.sheet.commands - self.sheet.neutral)
        return Table(self.sheet.commands, force)

    def _rows(self, values: Array) -> Named:
        return Named(commands=np.asarray(self.sheet.commands), forces=values)
