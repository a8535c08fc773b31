"""Variable buoyancy: a bladder outside the hull that a pump fills from inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from coadjoint.groups.group import Array
from coadjoint.mechanics.state import Force
from coadjoint.models.quantities import positive, vector
from coadjoint.vehicles.parts.bounded_travel import between, followed, lag_of
from coadjoint.vehicles.parts.part import Command, Flow, Part


@dataclass(frozen=True, eq=False)
class Ballast(Part):
    """A volume V at r beyond that of the body, which ℓ has as −V g ∫₀^depth ρ dz: oil in a bladder, of constant mass.

    The pump's work against the water is the ledger's ΔH, ρ g depth ΔV. The oil's own shift between hull and bladder, a
    moving mass, is left out. A tank that lets water in is a negative volume: the water in it counts as outside.

    position: r, (3,) m. low, high: the range of V, m³; negative below the trim. rate: largest |V̇|, m³/s. lag: τ, s,
    with which it comes to its command, none if left out. Commanded by V. Raises ArgumentError.
    """

    position: Any
    low: Any
    high: Any
    rate: Any
    lag: Any = None

    def __post_init__(self) -> None:
        super().__post_init__()
        of = f"` of the ballast `{self.name}"
        self.set(position=vector(self.position, "position" + of), rate=positive(self.rate, "rate" + of))
        self.set(**between(self.low, self.high, of))
        self.set(lag=lag_of(self.lag, of))

    @property
    def command(self) -> Command:
        return Command("m³", start=float(np.clip(0.0, self.low, self.high)))

    def advance(self, actual: Array, command: Array, h: Array, own: Any) -> Array:
        return actual + followed(actual, command, h, own)

    def force(self, flow: Flow, actual: Any, own: Any) -> Force:
        return Force()

    def displaced(self, actual: Any, own: Any) -> tuple[tuple[Array, Array], ...]:
        return ((actual, own.position),)
