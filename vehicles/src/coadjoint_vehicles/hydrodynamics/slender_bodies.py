"""Slender bodies: the added mass of a hull with fins from its sections, strip by strip."""

from __future__ import annotations

import numpy as np

from coadjoint import checks
from coadjoint.arrays import Scalar
from coadjoint.errors import ArgumentError
from coadjoint.models.quantities import positive
from coadjoint_vehicles.hydrodynamics.ellipsoids import ellipsoid_added_mass
from coadjoint_vehicles.hydrodynamics.sections import crosswise_added_mass, rolling_added_mass

NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)
"""Gauss points in each piece of hull: exact for its sections without fins, which are polynomials of degree four."""


def slender_body_added_mass(
    stations: object,
    half_breadth: object,
    half_height: object = None,
    *,
    fluid_density: float = 1025.0,
    horizontal_fins: object = 0.0,
    vertical_fins: object = 0.0,
) -> np.ndarray:
    """The added mass matrix (6, 6) of a slender body about x = 0 of its stations, by strip theory.

    A₂₂ = ∫m₂₂dx, A₂₆ = ∫x m₂₂dx, A₆₆ = ∫x²m₂₂dx, A₃₃ = ∫m₃₃dx, A₃₅ = −∫x m₃₃dx, A₅₅ = ∫x²m₃₃dx, A₄₄ = ∫m₄₄dx, where m
    belongs to the section at x: an ellipse with flat fins. A₁₁ is Lamb's for the ellipsoid of the same length, volume
    and ratio of breadth to height. The theory holds for a slender body: of an ellipsoid of fineness 8.4, A₂₂ is 5 %
    and A₆₆ 16 % too large.

    stations: x forward, rising, (n,) m; two sections at one x are a jump. half_breadth, half_height: semi-axes b, c of
    the sections, (n,) or one number, m; a body of revolution needs no half_height. Between stations they are linear.
    horizontal_fins, vertical_fins: half span from the axis to the tips, (n,) or one number, m; zero at stations without
    fins. fluid_density: ρ, kg/m³. Axes forward, starboard, down; every section is symmetric about its axis.
    Raises ArgumentError for stations that do not rise and for negative sizes. Source: Newman (1977), chapter 7.
    """
    x = _stations(stations)
    b = _sizes(half_breadth, "half_breadth", x)
    c = b if half_height is None else _sizes(half_height, "half_height", x)
    density = positive(fluid_density, "fluid_density")
    if not np.any(b * c > 0):
        raise ArgumentError("The hull has no volume: `half_breadth` and `half_height` must be positive somewhere.")
    horizontal, vertical = _sizes(horizontal_fins, "horizontal_fins", x), _sizes(vertical_fins, "vertical_fins", x)

    lengths = np.diff(x)
    share = 0.5 * (1 + NODES)
    weight = np.outer(lengths, 0.5 * WEIGHTS).ravel()

    def between(values: np.ndarray) -> np.ndarray:
        return (values[:-1, None] + np.outer(np.diff(values), share)).ravel()

    X, B, C = between(x), between(b), between(c)
    H, V = _tips(between(horizontal), B), _tips(between(vertical), C)
    sway = density * weight * crosswise_added_mass(C, B, V)
    heave = density * weight * crosswise_added_mass(B, C, H)
    roll = density * weight @ np.array([rolling_added_mass(*section) for section in zip(B, C, H, V, strict=True)])

    found = np.zeros((6, 6))
    found[0, 0] = _axial(x[-1] - x[0], B, C, weight, density)
    found[1, 1], found[2, 2], found[3, 3] = np.sum(sway), np.sum(heave), roll
    found[1, 5] = found[5, 1] = X @ sway
    found[2, 4] = found[4, 2] = -X @ heave
    found[4, 4], found[5, 5] = X**2 @ heave, X**2 @ sway
    return found


def _axial(length: float, B: np.ndarray, C: np.ndarray, weight: np.ndarray, density: Scalar) -> Scalar:
    """Lamb's A₁₁ of the ellipsoid with the hull's length, volume and ratio of mean square breadth to height."""
    a = 0.5 * length
    product = weight @ (B * C) / (4 / 3 * a)  # bc, from ∫πbc dx = (4/3)πabc
    ratio = np.sqrt((weight @ B**2) / (weight @ C**2))
    return ellipsoid_added_mass((a, np.sqrt(product * ratio), np.sqrt(product / ratio)), density)[0, 0]


def _tips(span: np.ndarray, hull: np.ndarray) -> np.ndarray:
    """Half spans; a fin inside the hull does not count."""
    return np.maximum(span, hull)


def _stations(stations: object) -> np.ndarray:
    x = checks.array(stations, "stations", "(n,)")
    checks.expect(len(x) > 1, x, "stations", "two stations or more")
    if np.any(np.diff(x) < 0) or x[0] == x[-1]:
        raise ArgumentError(
            "Argument `stations` must rise from the stern to the bow, but falls: sort the sections by x."
        )
    return x


def _sizes(sizes: object, name: str, x: np.ndarray) -> np.ndarray:
    found = checks.array(sizes, name, (), x.shape)
    if np.any(found < 0):
        raise ArgumentError(f"Argument `{name}` must not be negative, but has {np.min(found):g} m.")
    return np.broadcast_to(found, x.shape).astype(float)
