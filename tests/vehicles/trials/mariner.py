"""The Mariner class cargo ship of Chislett and Strøm-Tejsen (1965), as in MSS, and its turning circle there.

Coefficients, prime system about midships: cybergalactic/MSS, CRAFT/SHIP/models/mariner.m, commit 736a3d1. L = 160.93 m,
U₀ = 7.7175 m/s (15 knots); δ > 0 turns to port there, so that orders change their sign here.
"""

from __future__ import annotations

from typing import Any

LENGTH, SPEED = 160.93, 7.7175
X: dict[str, float] = {"u": -184, "uu": -110, "uuu": -215, "vv": -899, "rr": 18, "dd": -95, "udd": -190, "rv": 798}
X |= {"vd": 93, "uvd": 93}
Y: dict[str, float] = {"v": -1160, "r": -499, "vvv": -8078, "vvr": 15356, "vu": -1160, "ru": -499, "d": 278, "ddd": -90}
Y |= {"ud": 556, "uud": 278, "vdd": -4, "vvd": 1190, "": -4, "u": -8, "uu": -4}
N: dict[str, float] = {"v": -264, "r": -166, "vvv": 1636, "vvr": -5483, "vu": -264, "ru": -166, "d": -139, "ddd": 45}
N |= {"ud": -278, "uud": -139, "vdd": 13, "vvd": -489, "": 3, "u": 6, "uu": 3}
M11, M22, M33 = 840e-5, 1546e-5, 83e-5
M23, M32 = 798e-5 * -0.023 + 9.354e-5, 798e-5 * -0.023 - 4.646e-5

TURN_TO_PORT = {"steady_radius": 711, "maximum_transfer": 1315, "maximum_advance": 947, "tactical_diameter": 1311}
"""m, at 15° of rudder: the output of MSS's turncircle.m for this ship, Euler's method at 0.1 s, to whole metres."""


def accelerations(u: Any, v: Any, r: Any, delta: Any) -> tuple[Any, Any, Any]:
    """(u̇, v̇, ṙ) at the velocities u (m/s), v (m/s), r (rad/s) and the actual rudder δ (rad), positive to starboard."""
    square = u**2 + v**2
    U = square**0.5
    values = {"u": (u - SPEED) / U, "v": v / U, "r": r * LENGTH / U, "d": -delta}

    def total(coefficients: dict[str, float]) -> Any:
        found: Any = 0.0
        for name, value in coefficients.items():
            product = 1e-5 * value
            for letter in name:
                product = product * values[letter]
            found = found + product
        return found

    along, across, about = total(X), total(Y), total(N)
    determinant = M22 * M33 - M23 * M32
    return (
        along * square / LENGTH / M11,
        (M33 * across - M23 * about) * square / LENGTH / determinant,
        (M22 * about - M32 * across) * square / LENGTH**2 / determinant,
    )
