"""Hydrodynamic derivatives: forces as sums of monomials of velocities and of a deflection."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import jax.numpy as jnp

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.mechanics import Force
from coadjoint.mechanics.members import Each
from coadjoint.models.quantities import number, positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, measured, not_negative
from coadjoint_vehicles.parts.part import Command, Flow, Part

AXES = "XYZKMN"
VELOCITIES = "uvwpqr"
_FACTOR = re.compile(r"\|[uvwpqr]\||[uvwpqr]")


class Monomial(NamedTuple):
    """A force or torque along one axis: coefficient × Π velocities × deflection^k."""

    axis: int
    factors: tuple[tuple[int, bool], ...]
    """Which velocity, and whether its size counts."""
    deflections: int

    @property
    def length_power(self) -> int:
        """k of ½ρL^k: 2 for forces, 3 for torques, and one more for each rate p, q, r."""
        return 2 + (self.axis > 2) + sum(which > 2 for which, _ in self.factors)

    def value(self, V: Array, deflection: PyTree) -> Array:
        """The product of its factors."""
        product = jnp.ones(())
        for which, size in self.factors:
            product = product * (jnp.abs(V[which]) if size else V[which])
        for _ in range(self.deflections):
            product = product * deflection
        return product


@dataclass(frozen=True, eq=False)
class Derivatives(Part):
    """(X, Y, Z, K, M, N)_i = Σ c · monomial, as in Y_vr v r, Z_u|w| u|w| or N_uu_rudder u² δ.

    coefficients: c by name: an axis, an underscore and factors u v w p q r or |u| … |r|; then, of a part `rudder` that
    is moved, `_rudder` once for each power of its deflection δ. Signs are those of the equations: Y_v|v| < 0 brakes. In
    SI, or, with a `length` L, dimensionless: two velocities each, times ½ρL^k, k = 2 for forces and 3 for torques and
    one more for each of p, q, r (the prime system). Derivatives by accelerations are added mass, with the Coriolis
    terms that follow from it: they belong to the vehicle's `added_mass`, not here. length: L, m. limit: largest |δ|,
    rad; with it the part is commanded. lag: of its actuator, s. rate: of its actuator, rad/s. Raises ArgumentError for
    unknown names. Sources: SNAME (1950); Healey and Lienard (1993).
    """

    kind: ClassVar[str] = "derivatives"
    coefficients: Mapping[str, PyTree]
    length: Measured = measured(u.LENGTH, positive, default=None)
    limit: Measured = measured(u.ANGLE, positive, default=None)
    lag: Measured = measured(u.TIME, not_negative, default=None)
    rate: Measured = measured(u.ANGULAR_VELOCITY, positive, default=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        whose = f"derivatives `{self.name}"
        if not isinstance(self.coefficients, Mapping) or not self.coefficients:
            raise ArgumentError(
                f"Argument `coefficients` of the {whose}` must be a dictionary such as {{'Y_vr': 1.2}}."
            )
        checked = {
            name: value if isinstance(value, Each) else number(value, f"{name}` of the {whose}")
            for name, value in self.coefficients.items()
        }
        monomials = tuple(_monomial(name, self.name, self.limit is not None) for name in checked)
        if self.length is not None:
            for name, monomial in zip(checked, monomials, strict=True):
                if len(monomial.factors) != 2:
                    raise ArgumentError(
                        f"The dimensionless coefficient `{name}` of the {whose}` must have two velocities, but has "
                        f"{len(monomial.factors)}: write Y_v as Y_uv, or state it in SI units without `length`."
                    )
        self.set(coefficients=checked)
        object.__setattr__(self, "_monomials", monomials)

    def parameters(self) -> dict[str, PyTree]:
        """The coefficients by name, and the numbers of the actuator."""
        return {**self.coefficients, **super().parameters()}

    @property
    def monomials(self) -> tuple[Monomial, ...]:
        """Its monomials, in the order of the coefficients."""
        return getattr(self, "_monomials")  # noqa: B009

    @property
    def passive(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Unless it is moved: a deflection may steer by any force."""
        return self.limit is None

    @property
    def command(self) -> Command | None:
        return None if self.limit is None else Command("rad")

    def force(self, flow: Flow, actual: PyTree, own: Named) -> Force:
        V = jnp.concatenate([flow.velocity, flow.omega])
        totals = [jnp.zeros(()) for _ in AXES]
        for name, monomial in zip(self.coefficients, self.monomials, strict=True):
            scale = 1.0 if self.length is None else 0.5 * flow.density * own.length**monomial.length_power
            value = getattr(own, name) * scale * monomial.value(V, actual)
            totals[monomial.axis] = totals[monomial.axis] + value
        return Force(force=jnp.stack(totals[:3]), torque=jnp.stack(totals[3:]))


def _monomial(name: object, part: str, moved: bool) -> Monomial:
    """Y_v|r|_rudder as a monomial; raises ArgumentError."""
    axis, _, rest = name.partition("_") if isinstance(name, str) else ("", "", "")
    product, *deflected = rest.split(f"_{part}")
    factors = _FACTOR.findall(product)
    if len(axis) != 1 or axis not in AXES or not factors or "".join(factors) != product or any(deflected):
        raise ArgumentError(
            f"The coefficient {name!r} of the derivatives `{part}` must be an axis X Y Z K M N, an underscore and "
            f"factors u v w p q r or |u| … |r|, as in 'Y_vr' or 'Z_u|w|', then `_{part}` for each power of its angle."
        )
    if deflected and not moved:
        raise ArgumentError(
            f"The coefficient {name!r} needs a deflection: give the derivatives `{part}` a `limit` in rad."
        )
    places = tuple((VELOCITIES.index(factor.strip("|")), factor[0] == "|") for factor in factors)
    return Monomial(AXES.index(axis), places, len(deflected))
