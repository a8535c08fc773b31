"""Compositions of a method with itself and with its adjoint (mathematics: section 7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from coadjoint import checks
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError
from coadjoint.methods.left_rectangle import LeftRectangle
from coadjoint.methods.method import Claims, Method, Start
from coadjoint.methods.order_conditions import composed_order
from coadjoint.methods.right_rectangle import RightRectangle
from coadjoint.methods.step import Step

NegativeSubsteps = Literal["refuse", "allow"]


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
class _OverBase(Method):
    """A method made of steps of another one.

    base: that method, such as co.Midpoint(). start: as in `Method`, by default that of the base.
    """

    base: Method

    def _set(self, base: Method, start: Start | None, **more: object) -> None:
        values = {"difference_map": base.difference_map, "start": start or base.start, "base": base, **more}
        for name, value in values.items():
            object.__setattr__(self, name, value)
        self.__post_init__()

    @property
    def symmetric(self) -> bool:
        return True

    @property
    def claims(self) -> Claims:
        """The claims of the base, at this order."""
        return self.base.claims._replace(order=self.order, symmetric=True)

    @property
    def regular(self) -> bool:
        return self.base.regular

    @property
    def remedies(self) -> tuple[str, str]:
        return self.base.remedies

    @property
    def title(self) -> str:
        return f"{type(self).__name__}({self.base.title})"


@dataclass(frozen=True, init=False)
class Symmetrised(_OverBase):
    """Φ_{h/2} ∘ Φ*_{h/2} of any method Φ with its adjoint Φ*_h = Φ₋ₕ⁻¹: symmetric, of the next even order at least.

    Over a rule of order 1 this is Strang's symmetrisation; `Symmetrised(RightRectangle())` is `LeftRight()`.
    Raises ArgumentError for a method whose adjoint is not known.
    """

    def __init__(self, base: Method, start: Start | None = None):
        _require_method(base, "Symmetrised")
        self._set(base, start)
        self.stages  # noqa: B018  raises if no adjoint exists

    @property
    def order(self) -> int:
        return 2 * (self.base.order // 2 + 1) if not self.base.symmetric else self.base.order

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        both = (*self.base.adjoint.stages, *self.base.stages)
        return tuple((step, 0.5 * fraction) for step, fraction in both)


@dataclass(frozen=True, init=False)
class Composition(_OverBase):
    """Φ_{γ_s h} ∘ … ∘ Φ_{γ_1 h} of a symmetric method Φ, with γ_i = γ_{s+1−i} and Σγ = 1.

    coefficients: γ, (s,). order: a claim, which the coefficients must meet; by default none. The order itself follows
    from the order conditions that they meet, in the free algebra of the base's error terms. negative_substeps:
    "refuse" (the default) or "allow". A negative γ is a backward substep, which amplifies motions that forces damp:
    runs with dissipation raise ArgumentError unless this is "allow". Raises ArgumentError for a base that is not
    symmetric, and for coefficients that do not add up to 1, are not palindromic, or have a lower order than claimed.
    """

    coefficients: tuple[float, ...]
    negative_substeps: NegativeSubsteps

    def __init__(
        self,
        base: Method,
        coefficients: Sequence[float],
        order: int | None = None,
        start: Start | None = None,
        negative_substeps: NegativeSubsteps = "refuse",
    ):
        _require_method(base, type(self).__name__)
        if not base.symmetric:
            raise ArgumentError(
                f"{type(self).__name__} needs a symmetric method, such as co.Midpoint(co.Cayley()), but got {base!r}; "
                "co.methods.Symmetrised(method) makes one."
            )
        if any(step.tolerant for step, _ in base.stages):
            raise ArgumentError(f"{type(self).__name__} needs a method of fixed step, but got {base!r}.")
        fits = negative_substeps in ("refuse", "allow")
        checks.expect(fits, negative_substeps, "negative_substeps", '"refuse" or "allow"')
        self._set(base, start, coefficients=_coefficients(coefficients), negative_substeps=negative_substeps)
        if order is not None and self.order < order:
            raise ArgumentError(
                f"Argument `coefficients` must give order {order} over a base of order {base.order}, but gives "
                f"{self.order}: check their digits and signs."
            )

    @property
    def order(self) -> int:
        return composed_order(self.coefficients, self.base.order)

    @property
    def substeps(self) -> tuple[float, ...]:
        return tuple(part * fraction for part in self.coefficients for fraction in self.base.substeps)

    @property
    def pattern(self) -> tuple[tuple[Step, float], ...]:
        return self.base.pattern

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return tuple((step, part * fraction) for part in self.substeps for step, fraction in self.pattern)


def _require_method(base: object, name: str) -> None:
    checks.instance(base, f"The base of {name}", Method, "a method such as co.Midpoint(co.Cayley())")


def _coefficients(given: object) -> tuple[float, ...]:
    """Coefficients that are consistent and symmetric."""
    numbers = np.atleast_1d(float64(given, "Argument `coefficients`"))
    fits = numbers.ndim == 1 and len(numbers) and np.all(numbers)
    checks.expect(fits, given, "coefficients", "a row of numbers other than 0, such as (γ, 1 - 2*γ, γ)")
    if np.max(np.abs(numbers - numbers[::-1])) > 1e-14:
        raise ArgumentError(
            "Argument `coefficients` must read the same backwards, so that the composition is symmetric, but is "
            f"{given!r}."
        )
    if abs(np.sum(numbers) - 1) > 1e-13:
        raise ArgumentError(
            f"Argument `coefficients` must add up to 1, so that a step lasts h, but adds up to {np.sum(numbers):.16g}."
        )
    return tuple(numbers.tolist())
