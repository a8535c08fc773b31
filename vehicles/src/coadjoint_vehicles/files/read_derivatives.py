"""Hydrodynamic derivatives of a vehicle file, without those that follow from the added mass."""

from __future__ import annotations

import re

import numpy as np

from coadjoint.texts import Table
from coadjoint_vehicles import axes as border
from coadjoint_vehicles.files.table import Section
from coadjoint_vehicles.model.vehicle import Quantity
from coadjoint_vehicles.parts.derivatives import AXES, VELOCITIES, Derivatives

PLAIN = re.compile(r"^[XYZKMN]_[uvwpqr]{2}$")
NOTHING = 1e-9
"""Up to this fraction of a coefficient, its difference from the added mass is round-off."""
SMALL = 0.01
"""Up to this part of the largest term of its kind, a term of the added mass may go unnamed."""


def read_derivatives(section: Section, name: str, values: Table, axes: border.Axes, body: Table) -> Derivatives:
    """The derivatives of one [[part]] with these fields: `coefficients`, a table with unit "SI" or "prime".

    with_added_mass = true: those of two velocities hold Coriolis and Munk terms of the added mass too, as most
    published sets do. The Lagrangian has these already, and they are taken away here.
    """
    table, unit = section.quantity("coefficients", None, special=("prime",), named=True)
    wrong = [key for key, value in table.items() if not isinstance(value, float)]
    if wrong:
        raise section.fail(f"coefficients: {wrong[0]} must be one number.")
    if "length" not in values and unit == "prime":
        if body["length"] is None:
            raise section.fail('coefficients have the unit "prime", for which [body] needs a `length`.')
        values["length"] = body["length"]
    with_added_mass = section.flag("with_added_mass")
    section.done()
    _remember(section, name, table)
    found = {key: sign_in(axes, key) * value for key, value in table.items()}
    if with_added_mass:
        scale = dict.fromkeys(found, 1.0)
        if "length" in values:
            scale = {key: 0.5 * body["fluid_density"] * values["length"] ** _power(key) for key in found}
        unnamed = _unnamed(found, body["added_mass"])
        if unnamed:
            shown = ", ".join(f"{key} = {value:.4g}" for key, value in list(unnamed.items())[:4])
            section.book.warn(
                f"{section.title} with_added_mass names no {', '.join(list(unnamed)[:4])}"
                f"{f' nor {len(unnamed) - 4} more' if len(unnamed) > 4 else ''}, so that the terms of the added mass "
                f"stay as they are ({shown} in SI): if the source leaves them out, as of a Munk moment that its lift "
                "holds, name each with its value, 0.0 where there is none; if it states damping only, leave out "
                "with_added_mass."
            )
        found = _without_added_mass(found, scale, body["added_mass"])
        if not found:
            raise section.fail("coefficients hold nothing but Coriolis terms of the added mass: leave the part out.")
    return Derivatives(name=name, coefficients=found, **values)


def _remember(section: Section, name: str, table: dict[str, float]) -> None:
    """Every coefficient in the provenance, under its own name."""
    told = section.book.provenance.pop(f"{name}.coefficients")
    for key, value in table.items():
        section.book.provenance[f"{name}.{key}"] = Quantity(value, told.unit, told.source, told.note)


def sign_in(axes: border.Axes, key: str) -> float:
    """The sign of a derivative in FRD over that in other axes: −1 for each of Y Z M N, and of v w q r outside bars."""
    diagonal = np.tile(np.diag(border.body_axes(axes)), 2)
    axis, _, rest = key.partition("_")
    signed = re.sub(r"\|.\|", "", rest.partition("_")[0])
    factors = [diagonal[AXES.index(axis)]] if len(axis) == 1 and axis in AXES else []
    factors += [diagonal[VELOCITIES.index(letter)] for letter in signed if letter in VELOCITIES]
    return float(np.prod(factors))


def _power(key: str) -> int:
    """k of ½ρL^k for a coefficient of two velocities."""
    axis, _, rest = key.partition("_")
    rates = sum(letter in "pqr" for letter in rest.partition("_")[0])
    return 2 + (axis in "KMN") + rates


def _without_added_mass(found: dict[str, float], scale: dict[str, float], M: np.ndarray) -> dict[str, float]:
    """The coefficients of two plain velocities minus the terms that follow from the added mass."""
    known = added_mass_derivatives(M)
    left: dict[str, float] = {}
    for key, value in found.items():
        if PLAIN.match(key):
            rest = value - known.pop(_canonical(key), 0.0) / scale[key]
            if abs(rest) <= NOTHING * abs(value):
                continue
            value = rest
        left[key] = value
    return left


def _unnamed(found: dict[str, float], M: np.ndarray) -> dict[str, float]:
    """Terms of the added mass, SI, without a coefficient, above 1 % of their kind's largest, in descending order."""
    named = {_canonical(key) for key in found if PLAIN.match(key)}
    known = added_mass_derivatives(M)
    alike: dict[tuple[bool, int], float] = {}
    for key, value in known.items():
        kind = (key[0] in "KMN", _power(key))
        alike[kind] = max(alike.get(kind, 0.0), abs(value))
    left = {
        key: value
        for key, value in known.items()
        if key not in named and abs(value) > SMALL * alike[key[0] in "KMN", _power(key)]
    }
    return dict(sorted(left.items(), key=lambda item: -abs(item[1])))


def _canonical(key: str) -> str:
    """Y_ru as Y_ur."""
    axis, _, rates = key.partition("_")
    return f"{axis}_{''.join(sorted(rates, key=VELOCITIES.index))}"


def added_mass_derivatives(M: np.ndarray) -> dict[str, float]:
    """The Coriolis and Munk terms of an added mass matrix as derivatives: "X_wq" is the coefficient of w q in X.

    F = −ω × P, T = −ω × Π − v × P with (P, Π) = M (v, ω), expanded in products of the six velocities.
    Source: Kirchhoff's equations; Lamb (1932), § 124.
    """
    found: dict[str, float] = {}
    for i in range(6):
        for j in range(i, 6):
            one, other = np.eye(6)[i], np.eye(6)[j]
            terms = _kirchhoff(one, M @ other)
            if i != j:
                terms = terms + _kirchhoff(other, M @ one)
            for axis, value in zip(AXES, terms, strict=True):
                if value != 0:
                    found[f"{axis}_{VELOCITIES[i]}{VELOCITIES[j]}"] = float(value)
    return found


def _kirchhoff(V: np.ndarray, momentum: np.ndarray) -> np.ndarray:
    v, omega, P, Pi = V[:3], V[3:], momentum[:3], momentum[3:]
    return np.concatenate([-np.cross(omega, P), -np.cross(omega, Pi) - np.cross(v, P)])
