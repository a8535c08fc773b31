"""Added mass per length of an elliptic section with flat fins, by conformal maps."""

from __future__ import annotations

import numpy as np

ANGLES = 4096
"""Points on the circle for the roll of a section with fins; the error falls as their inverse square."""


def crosswise_added_mass(across: np.ndarray, along: np.ndarray, fin: np.ndarray) -> np.ndarray:
    """m/ρ of an ellipse with two fins that moves across its fins, m².

    m = πρ(ℓ² − c² − 2bc), ℓ = ζ + (b + c)²/(4ζ), 2ζ = s + √(s² − b² + c²): the outside of ellipse and fins is mapped
    onto that of a flat plate of half length ℓ. A bare ellipse (s = b) has πρb², a circle with fins
    πρ(s² − b² + b⁴/s²), and fins along the motion change nothing.

    across: b, the semi-axis across the motion, that of the fins; along: c, the semi-axis along the motion; fin: s ≥ b,
    half span of the fins from the axis; arrays of one shape, m. Source: Newman (1977), table 4.3, for circles.
    """
    b, c = across, along
    return np.pi * (plate(b, c, fin) ** 2 - c**2 - 2 * b * c)


def plate(b: np.ndarray, c: np.ndarray, s: np.ndarray) -> np.ndarray:
    """ℓ: half the plate onto which an ellipse with fins along its semi-axis b is mapped."""
    zeta = 0.5 * (s + np.sqrt(np.maximum(s**2 - b**2 + c**2, 0.0)))
    return zeta + np.divide((0.5 * (b + c)) ** 2, zeta, out=np.zeros_like(zeta), where=zeta > 0)


def rolling_added_mass(b: float, c: float, horizontal: float, vertical: float) -> float:
    """m₄₄/ρ of an ellipse with horizontal and vertical fins that rolls about its axis, m⁴.

    m₄₄ = πρ Σ n a_n², where ½|z|² = Σ a_n cos nθ on the section and θ is the angle on the circle onto which its outside
    is mapped. An ellipse alone has (π/8)ρ(b² − c²)², four equal fins alone (2/π)ρs⁴, a plate (π/8)ρs⁴.

    b, c: horizontal and vertical semi-axis; horizontal, vertical: half spans of the fins, at least b and c; m.
    Source: Newman (1977), table 4.3, for the three limits; the energy of the stream function ½|z|².
    """
    if horizontal <= b and vertical <= c:
        return np.pi / 8 * (b**2 - c**2) ** 2
    square = _square_of_distance(b, c, horizontal, vertical)
    a = np.abs(np.fft.rfft(square)) / len(square)  # of |z|² a transform gives the halves: a_n of ½|z|²
    n = 2 * np.arange(len(a))
    return float(np.pi * np.sum(n * a**2))


def _square_of_distance(b: float, c: float, horizontal: float, vertical: float) -> np.ndarray:
    """|z|² on the section at equal steps of 2θ over one turn.

    z = ζ + e/ζ, e = (b² − c²)/4, takes a circle of radius r = (b + c)/2 to the ellipse; η = ζ + r²/ζ the circle with
    its fins to a cross with arms ℓ and h; η² = L²cos²θ − h², L² = ℓ² + h², the cross to a circle.
    """
    r, e = 0.5 * (b + c), 0.25 * (b**2 - c**2)
    # The vertical fins are the horizontal ones of the section turned by 90°: η turns too, and ℓ becomes √(h² + 4r²).
    ell = float(plate(*np.array([[b], [c], [horizontal]]))[0])
    h2 = max(float(plate(*np.array([[c], [b], [vertical]]))[0]) ** 2 - 4 * r**2, 0.0)
    theta = np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
    eta2 = (ell**2 + h2) * np.cos(theta) ** 2 - h2
    eta = np.sqrt(eta2.astype(complex))
    zeta = 0.5 * (eta + np.sqrt(eta2 - 4 * r**2 + 0j))
    zeta = np.where(np.abs(zeta) < r, 0.5 * (eta - np.sqrt(eta2 - 4 * r**2 + 0j)), zeta)
    z = zeta + np.divide(e, zeta, out=np.zeros_like(zeta), where=zeta != 0)
    return np.abs(z) ** 2
