"""An underwater vehicle about any body origin, with a full added mass matrix, on SO(3) × ℝ³ and on SE(3)."""

from __future__ import annotations

from functools import partial

import jax.numpy as jnp

from coadjoint.arrays import Array
from coadjoint.groups import SE3, SO3
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.system import System
from coadjoint.models.paper_form import UNITS, start
from coadjoint.models.quantities import (
    checked,
    not_negative,
    place,
    positive,
    positive_definite,
    positive_semidefinite,
)
from coadjoint.spaces import Defining, Dual

SE3_UNITS = {
    "x": "m",
    "xi": "rad/s (3), m/s (3)",
    "xi_spatial": "rad/s (3), m/s (3)",
    "mu": "kg m²/s (3), kg m/s (3)",
    "a": "1 (3), m",
    "energy": "J",
    "discrete_energy": "J",
}


def kinetic(omega: Array, v: Array, p: Parameters) -> Array:
    """½ [v; ω]ᵀ(M_RB + M_A)[v; ω] = ½ m|v + ω×r_g|² + ½ ω·I_cω + ½ [v; ω]ᵀM_A[v; ω], J.

    omega: (3,), rad/s. v: (3,), m/s.
    """
    center = v + jnp.cross(omega, p.center_of_mass)
    both = jnp.concatenate([v, omega])
    return 0.5 * (p.mass * center @ center + omega @ p.inertia @ omega + both @ p.added_mass @ both)


def potential(depth: Array, down: Array, p: Parameters) -> Array:
    """U = −(mg − B) depth − (mg r_g − B r_b)·down, J. depth: one number, m. down: (3,) in the body frame."""
    weight = p.mass * p.gravity
    righting = weight * p.center_of_mass - p.buoyancy * p.center_of_buoyancy
    return -(weight - p.buoyancy) * depth - righting @ down


def lagrangian(xi, n, nu, a, p):
    """ℓ(ω, n, ν, a) on SO(3) × ℝ³: depth = n·a."""
    return kinetic(xi, nu, p) - potential(n @ a, a, p)


def se3_lagrangian(xi, a, p):
    """ℓ((ω, v), (a, depth)) on SE(3)."""
    return kinetic(xi[:3], xi[3:], p) - potential(a[3], a[:3], p)


CHECKS = {
    "mass": positive,
    "inertia": positive_definite,
    "added_mass": partial(positive_semidefinite, size=6),
    "buoyancy": not_negative,
    "center_of_mass": place,
    "center_of_buoyancy": place,
    "gravity": not_negative,
}
"""Of the parameters, when a vehicle is made and when they are replaced."""


def _parameters(mass, inertia, added_mass, buoyancy, center_of_mass, center_of_buoyancy, gravity) -> Parameters:
    m, g = positive(mass, "mass"), not_negative(gravity, "gravity")
    given = {
        "mass": m,
        "inertia": inertia,
        "added_mass": added_mass,
        "buoyancy": m * g if buoyancy is None else buoyancy,
        "center_of_mass": center_of_mass,
        "center_of_buoyancy": center_of_buoyancy,
        "gravity": g,
    }
    return Parameters(**checked(CHECKS, given))


def general_vehicle(
    *,
    mass: Quantity,
    inertia: Quantity,
    added_mass: Quantity,
    buoyancy: Quantity | None = None,
    center_of_mass: Quantity = (0.0, 0.0, 0.0),
    center_of_buoyancy: Quantity = (0.0, 0.0, 0.0),
    gravity: Quantity = 9.81,
) -> System:
    """An underwater vehicle on SO(3) × ℝ³ about any origin O fixed in the body, in still water.

    ℓ = ½ [ν; ω]ᵀ(M_RB + M_A)[ν; ω] + (mg − B) n·a + (mg r_g − B r_b)·a, M_RB = [[mI, −m r̂_g], [m r̂_g, I_c − m r̂_g²]];
    q = R n is the position of O, ν the body velocity of O, a = R⁻¹a₀ points down.

    mass: m, kg. inertia: I_c of the body alone about its mass centre, (3, 3) or its diagonal (3,), kg m².
    added_mass: M_A about O, (6, 6) or its diagonal (6,), in the order surge, sway, heave, roll, pitch, yaw; kg, kg m,
    kg m²; symmetric, without negative eigenvalues. buoyancy: B = ρ|V|g, N, by default the weight. center_of_mass,
    center_of_buoyancy: r_g, r_b from O in the body frame, (3,) m. gravity: g, m/s².
    Raises ArgumentError for what no vehicle can have. Source: mathematics, section 10; with O the mass centre, (P71).
    """
    p = _parameters(mass, inertia, added_mass, buoyancy, center_of_mass, center_of_buoyancy, gravity)
    return System(
        SO3(),
        lagrangian,
        additional=Defining(),
        advected=Defining(),
        parameters=p,
        name="underwater vehicle, general form",
        units=UNITS,
        checks=partial(checked, CHECKS),
    )


def se3_vehicle(
    *,
    mass: Quantity,
    inertia: Quantity,
    added_mass: Quantity,
    buoyancy: Quantity | None = None,
    center_of_mass: Quantity = (0.0, 0.0, 0.0),
    center_of_buoyancy: Quantity = (0.0, 0.0, 0.0),
    gravity: Quantity = 9.81,
) -> System:
    """The vehicle of `general_vehicle` on SE(3), where the pose g = (R, q) is one element and no n is needed.

    ℓ(ξ, a) with ξ = (ω, v) and a = g⁻¹a₀ ∈ (ℝ⁴)*, a₀ = (down, 0), so that a = (R⁻¹down, down·q): direction of gravity
    in the body frame and depth. The isotropy algebra of a₀ has dimension 3: horizontal momentum and the vertical
    moment are conserved by every method, on the grid too. Arguments and errors as in `general_vehicle`.
    """
    p = _parameters(mass, inertia, added_mass, buoyancy, center_of_mass, center_of_buoyancy, gravity)
    return System(
        SE3(),
        se3_lagrangian,
        advected=Dual(),
        parameters=p,
        name="underwater vehicle on SE(3)",
        units=SE3_UNITS,
        checks=partial(checked, CHECKS),
    )


se3_start = start
"""The state of a vehicle on SE(3), as of `paper_start`."""
