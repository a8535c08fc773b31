"""Variable buoyancy: a bladder outside the hull that a pump fills from inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.models.quantities import positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.bounded_travel import BoundedTravel
from coadjoint_vehicles.parts.measured import Measured, lag_or_none, measured, place


@dataclass(frozen=True, eq=False)
class Ballast(BoundedTravel):
    """A volume V at r beyond that of the body, which ℓ has as −V g ∫₀^depth ρ dz: oil in a bladder, of constant mass.

    The pump's work against the water is the ledger's ΔH, ρ g depth ΔV. The oil's own shift between hull and bladder, a
    moving mass, is left out. A tank that lets water in is a negative volume: the water in it counts as outside.

    position: r, (3,) m. low, high: the range of V, m³; negative below the trim. rate: largest |V̇|, m³/s. lag: τ, s,
    with which it comes to its command, none if left out. Commanded by V. Raises ArgumentError.
    """

    kind: ClassVar[str] = "ballast"
    unit: ClassVar[str] = "m³"
    position: Measured = place()
    low: Measured = measured(u.VOLUME)
    high: Measured = measured(u.VOLUME)
    rate: Measured = measured(u.VOLUME_RATE, positive)
    lag: Measured = measured(u.TIME, lag_or_none, default=None)

    def displaced(self, actual: PyTree, own: Named) -> tuple[tuple[Array, Array], ...]:
        return ((actual, own.position),)
