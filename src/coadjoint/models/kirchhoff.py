"""A body in an ideal fluid without weight, on SE(3): Kirchhoff's equations, and the case that Clebsch integrated."""

from __future__ import annotations

from functools import partial

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.groups import SE3
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.orientation import orientation
from coadjoint.models.quantities import checked, positive, positive_definite, vector

UNITS = {
    "x": "m",
    "energy": "J",
    "discrete_energy": "J",
    "linear_casimir": "kg² m²/s²",
    "angular_casimir": "kg² m³/s²",
    "clebsch_integral": "kg² m⁴/s²",
    # Three angular components and three linear ones share an array.
    "xi": "rad/s, m/s",
    "xi_spatial": "rad/s, m/s",
    "mu": "kg m²/s, kg m/s",
    "kelvin_noether": "kg m²/s, kg m/s",
}


CHECKS = {"inertia": positive_definite, "mass": positive_definite}
"""Of the parameters, when one is made and when they are replaced."""


def lagrangian(xi, p):
    """ℓ(Ω, V) = ½ Ω·JΩ + ½ V·MV."""
    return 0.5 * xi[:3] @ p.inertia @ xi[:3] + 0.5 * xi[3:] @ p.mass @ xi[3:]


def linear_casimir(state):
    """P·P, a Casimir function of SE(3)."""
    return state.mu[3:] @ state.mu[3:]


def angular_casimir(state):
    """Π·P, a Casimir function of SE(3)."""
    return state.mu[:3] @ state.mu[3:]


def clebsch_integral(state, p):
    """½ Π·Π + ½ ΣλᵢPᵢ² with λ₂ − λ₃ = J₁(1/m₂ − 1/m₃), λ₁ − λ₃ = J₂(1/m₁ − 1/m₃), λ₃ = 0."""
    J, m = p.inertia, p.mass
    first = J[1, 1] * (1 / m[0, 0] - 1 / m[2, 2])
    second = J[0, 0] * (1 / m[1, 1] - 1 / m[2, 2])
    spin, impulse = state.mu[:3], state.mu[3:]
    return 0.5 * (spin @ spin + first * impulse[0] ** 2 + second * impulse[1] ** 2)


def body(*, inertia: Quantity, mass: Quantity) -> System:
    """A neutrally buoyant body on SE(3): Π̇ = Π×Ω + P×V, Ṗ = P×Ω, with Π = JΩ and P = MV.

    All of the spatial momentum is conserved, P·P and Π·P are Casimir functions.

    inertia: J with added inertia, (3, 3) or its diagonal, kg m². mass: M with added mass, (3, 3) or its diagonal, kg.
    """
    return _body("Kirchhoff body", inertia, mass, {})


def clebsch(*, inertia: Quantity, mass: Quantity) -> System:
    """The Kirchhoff body of Clebsch: J₁(1/m₂ − 1/m₃) + J₂(1/m₃ − 1/m₁) + J₃(1/m₁ − 1/m₂) = 0.

    It has a fourth integral, ½ Π·Π + ½ ΣλᵢPᵢ², and so is integrable.

    inertia: (J₁, J₂, J₃), kg m², J₁ ≠ J₂. mass: (m₁, m₂), kg; m₃ follows from the condition.
    Raises ArgumentError where that gives no positive m₃. Source: Clebsch (1871).
    """
    J, (m1, m2) = vector(inertia, "inertia"), (positive(m, "mass") for m in vector(mass, "mass", size=2))
    if J[0] == J[1]:
        raise ArgumentError("Argument `inertia` must have J₁ ≠ J₂, from which m₃ follows; give the axes another order.")
    inverse = (J[0] / m2 - J[1] / m1 + J[2] * (1 / m1 - 1 / m2)) / (J[0] - J[1])
    if not inverse > 0:
        raise ArgumentError(f"Clebsch's condition must give a mass m₃ > 0, but gives 1/m₃ = {inverse:.6g}.")
    mass = np.array([m1, m2, 1 / inverse])
    return _body("Kirchhoff body of Clebsch", J, mass, {"clebsch_integral": clebsch_integral})


def _body(name: str, inertia: Quantity, mass: Quantity, quantities: dict[str, object]) -> System:
    p = Parameters(**checked(CHECKS, {"inertia": inertia, "mass": mass}))
    kept = {"units": UNITS, "checks": partial(checked, CHECKS)}
    watched = {"linear_casimir": linear_casimir, "angular_casimir": angular_casimir, **quantities}
    return System(SE3(), lagrangian, parameters=p, quantities=watched, name=name, **kept)


def start(
    system: System,
    *,
    position: Quantity = (0.0, 0.0, 0.0),
    velocity: Quantity = (0.0, 0.0, 0.0),
    rotation: Quantity | None = None,
    euler_zxz: Quantity | None = None,
    euler_zyx: Quantity | None = None,
    angular_velocity: Quantity | None = None,
    euler_rates: Quantity | None = None,
) -> State:
    """The state of a body at a position and attitude, with q̇ in the space frame: ξ = (Ω, R⁻¹q̇); see `orientation`."""
    R, omega = orientation(rotation, euler_zxz, euler_zyx, angular_velocity, euler_rates)
    xi = np.concatenate([omega, np.asarray(R).T @ vector(velocity, "velocity")])
    return system.state(g=(R, vector(position, "position")), xi=xi)
