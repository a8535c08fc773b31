"""Compositions of a base method: the symmetric left–right pair and Suzuki's fourth order (mathematics: section 7)."""

from __future__ import annotations

from dataclasses import dataclass

from coadjoint.errors import ArgumentError
from coadjoint.methods.left_rectangle import LeftRectangle
from coadjoint.methods.method import Method, Start, Step
from coadjoint.methods.right_rectangle import RightRectangle


@dataclass(frozen=True)
class LeftRight(Method):
    """Left rectangle over h/2, then right rectangle over h/2: adjoint to each other, so symmetric and of order 2."""

    @property
    def order(self) -> int:
        return 2

    @property
    def symmetric(self) -> bool:
        return True

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return (LeftRectangle(self.difference_map), 0.5), (RightRectangle(self.difference_map), 0.5)


@dataclass(frozen=True, init=False)
class Suzuki4(Method):
    """Five steps of a symmetric base method of order 2 over (γ, γ, 1 − 4γ, γ, γ)h, γ = 1/(4 − 4^{1/3}): order 4.

    1 − 4γ is negative: with strong dissipation that substep is unsafe, and a run with forces says so. `start` is the
    base's unless given.
    """

    base: Method

    def __init__(self, base: Method, start: Start | None = None):
        if not isinstance(base, Method) or base.order != 2 or not base.symmetric:
            raise ArgumentError(
                f"Suzuki4 needs a symmetric method of order 2, such as co.Midpoint(co.Cayley()), but got {base!r}."
            )
        for name, value in (("difference_map", base.difference_map), ("start", start or base.start), ("base", base)):
            object.__setattr__(self, name, value)
        self.__post_init__()

    @property
    def order(self) -> int:
        return 4

    @property
    def symmetric(self) -> bool:
        return True

    @property
    def substeps(self) -> tuple[float, ...]:
        gamma = 1 / (4 - 4 ** (1 / 3))
        return (gamma, gamma, 1 - 4 * gamma, gamma, gamma)

    @property
    def pattern(self) -> tuple[tuple[Step, float], ...]:
        return self.base.stages

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return tuple((step, part * fraction) for part in self.substeps for step, fraction in self.pattern)

    @property
    def title(self) -> str:
        return f"Suzuki4({self.base.title})"
