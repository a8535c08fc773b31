"""Ellipsoids in an ideal fluid: Lamb's added mass, and a body whose motion Kirchhoff's equations describe."""

from __future__ import annotations

import numpy as np
from scipy.special import elliprd

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.mechanics import System
from coadjoint.models import general_vehicle
from coadjoint.models.quantities import positive, vector


def ellipsoid_added_mass(semi_axes: object, fluid_density: Scalar = 1025.0) -> Array:
    """The added mass matrix (6, 6) of an ellipsoid about its centre, axes along the body's: diagonal.

    α₀ = abc ∫₀^∞ ds/((a² + s)Δ), Δ = √((a² + s)(b² + s)(c² + s)), and β₀, γ₀ alike; α₀ + β₀ + γ₀ = 2;
    A₁₁ = m_f α₀/(2 − α₀), A₄₄ = (m_f/5)(b² − c²)²(γ₀ − β₀)/(2(b² − c²) + (b² + c²)(β₀ − γ₀)), cyclic; m_f = (4/3)πρabc.

    semi_axes: (a, b, c), m. fluid_density: ρ, kg/m³. Order (surge, sway, heave, roll, pitch, yaw).
    Raises ArgumentError unless the semi-axes and the density are positive. Source: Lamb (1932), §§ 114, 115.
    """
    axes = _axes(semi_axes)
    square = axes**2
    fluid = displaced_mass(axes, fluid_density)
    # α₀ by Carlson's integral R_D(x, y, z) = (3/2)∫₀^∞ ds/((z + s)√((x + s)(y + s)(z + s))).
    depth = np.array(
        [elliprd(square[(i + 1) % 3], square[(i + 2) % 3], square[i]) * 2 / 3 * np.prod(axes) for i in range(3)]
    )
    turning = [_turning(square[(i + 1) % 3], square[(i + 2) % 3], *np.roll(depth, -i)[1:]) for i in range(3)]
    return fluid * np.diag(np.concatenate([depth / (2 - depth), np.array(turning) / 5]))


def _turning(b2: Scalar, c2: Scalar, beta: float, gamma: float) -> Scalar:
    """A₄₄·5/m_f: zero where the cross section is a circle, which moves no fluid."""
    difference = b2 - c2
    if difference == 0:
        return 0.0
    return difference**2 * (gamma - beta) / (2 * difference + (b2 + c2) * (beta - gamma))


def displaced_mass(semi_axes: object, fluid_density: Scalar = 1025.0) -> float:
    """m_f = (4/3)πρabc, kg."""
    return float(4 / 3 * np.pi * positive(fluid_density, "fluid_density") * np.prod(_axes(semi_axes)))


def ellipsoid(
    *,
    semi_axes: object,
    fluid_density: Scalar = 1025.0,
    gravity: float = 9.81,
    center_of_mass: PyTree = (0.0, 0.0, 0.0),
) -> System:
    """A neutrally buoyant ellipsoid in an ideal fluid at rest: Kirchhoff's equations, and Leonard's bottom-heavy body.

    The general form with m = m_f, I_c = (m/5) diag(b² + c², c² + a², a² + b²), Lamb's M_A and the centre of buoyancy
    at the geometric centre O. With the mass centre there too, all of the spatial momentum (R P, q × R P + R Π) is
    conserved.

    semi_axes: (a, b, c), m. fluid_density: kg/m³. center_of_mass: r_g from O, (3,) m; below O, a bottom-heavy body.
    """
    axes = _axes(semi_axes)
    mass, square = displaced_mass(axes, fluid_density), axes**2
    return general_vehicle(
        mass=mass,
        inertia=mass / 5 * (np.sum(square) - square),
        added_mass=ellipsoid_added_mass(axes, fluid_density),
        center_of_mass=center_of_mass,
        gravity=gravity,
    )


def _axes(semi_axes: object) -> Array:
    axes = vector(semi_axes, "semi_axes")
    checks.expect(not np.any(axes <= 0), axes.tolist(), "semi_axes", "positive")
    return axes
