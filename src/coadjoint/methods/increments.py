"""Base classes of steps by the dependence of their increment F on ξ."""

from __future__ import annotations

from coadjoint.arrays import Array, Scalar
from coadjoint.groups.group import Element
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.step import Step


class FullStep(Step):
    """F = τ(hξ) of the difference map τ."""

    def relative(self, system: System, record: State, h: Scalar) -> Element:
        return self.difference_map.tau(system.group, h * record.xi)


class HalfStepSquared(Step):
    """F = H² with H = σ(hξ/2) of the difference map σ; the map need only reach half of the step (mathematics: 6).

    ν is that of the middle, in the frame H⁻¹.
    """

    def turn(self, system: System, h: Scalar, xi: Array) -> Element:
        """H = σ(hξ/2)."""
        return self.difference_map.tau(system.group, 0.5 * h * xi)

    def relative(self, system: System, record: State, h: Scalar) -> Element:
        half = self.turn(system, h, record.xi)
        return system.group.compose(half, half)

    def chart(self, system: System, record: State, h: Scalar) -> Array | float:
        return self.difference_map.chart(system.group, 0.5 * h * record.xi)
