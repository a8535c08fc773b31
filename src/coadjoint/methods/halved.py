"""What steps have in common whose increment is the square of its true half."""

from __future__ import annotations

from coadjoint.groups.group import Array, Element
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Step


class Halved(Step):
    """F = H² with H = σ(hξ/2) of the difference map σ; the map need only reach half of the step (mathematics: 6)."""

    def half(self, system: System, h: Array, xi: Array) -> Element:
        """H = σ(hξ/2)."""
        return self.difference_map.tau(system.group, 0.5 * h * xi)

    def increment(self, system: System, h: Array, xi: Array) -> Element:
        half = self.half(system, h, xi)
        return system.group.compose(half, half)

    def chart(self, system: System, record: State, h: Array) -> Array | float:
        return self.difference_map.chart(system.group, 0.5 * h * record.xi)
