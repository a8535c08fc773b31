"""The underwater vehicle of the paper: attitude and position of the mass centre, added mass, off-centre buoyancy.

    vehicle = co.models.paper_vehicle()
    start = co.models.paper_start(vehicle)

Equations P57–P78; mathematics: section 10.

**Axes.** The advected parameter is a = R⁻¹a₀, and a₀ is the direction of gravity in the space frame: it points *down*.
The Lagrangian holds the weight as +(mg − B) n·a, whatever the axes are called.
- The paper's axes: z points down, a₀ = (0, 0, 1), and q_z is a depth. A vehicle that is lighter than its water
  (mg < B) has q_z fall: it floats up. What the paper calls rising is a dive. Body axes that point down too: a centre of
  buoyancy above the mass centre has a negative third component, as in Table 1. So have ships' axes (north, east, down;
  forward, starboard, down).
- z up: pass `down=(0, 0, -1)` to `start`. Nothing else changes: q_z is then a height. Body vectors and matrices
  (centres, added mass, inertia) are stated in the body's own axes; if these point up as well, a centre of buoyancy
  above the mass centre has a positive third component.
"""

from __future__ import annotations

from functools import partial

import jax.numpy as jnp

from coadjoint.groups import SE3, SO3
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.orientation import orientation
from coadjoint.models.quantities import (
    checked,
    direction,
    not_negative,
    place,
    positive,
    positive_definite,
    positive_semidefinite,
    vector,
)
from coadjoint.spaces import Defining

UNITS = {
    "xi": "rad/s",
    "xi_spatial": "rad/s",
    "mu": "kg m²/s",
    "n": "m",
    "nu": "m/s",
    "pi": "kg m/s",
    "q": "m",
    "qdot": "m/s",
    "a": "1",
    "energy": "J",
    "discrete_energy": "J",
    "kelvin_noether": "kg m²/s",
}


CHECKS = {
    "mass": positive,
    "added_mass": positive_semidefinite,
    "inertia": positive_definite,
    "buoyancy": not_negative,
    "center_of_buoyancy": place,
    "gravity": not_negative,
}
"""Of the parameters, when a vehicle is made and when they are replaced."""


def lagrangian(xi, n, nu, a, p):
    """ℓ(ω, n, ν, a) = ½ m ν·ν + ½ ν·M_Aν + ½ ω·Jω + (mg − B) n·a − B r·a (P71)."""
    linear = 0.5 * nu @ (p.mass * nu + p.added_mass @ nu)
    angular = 0.5 * xi @ p.inertia @ xi
    return linear + angular + (p.mass * p.gravity - p.buoyancy) * n @ a - p.buoyancy * p.center_of_buoyancy @ a


def vehicle(
    *,
    mass: Quantity,
    added_mass: Quantity,
    inertia: Quantity,
    buoyancy: Quantity | None = None,
    center_of_buoyancy: Quantity = (0.0, 0.0, 0.0),
    gravity: Quantity = 9.81,
) -> System:
    """An underwater vehicle on SO(3) with its position in ℝ³ and the direction of gravity as advected parameter.

    ℓ(ω, n, ν, a) = ½ ν·(mI + M_A)ν + ½ ω·Jω + (mg − B) n·a − B r·a; q = R n is the mass centre, q̇ = R ν, and
    a = R⁻¹a₀ points *down*. See the package for axes that point up.

    mass: m, kg. added_mass: M_A, (3, 3) or its diagonal (3,), kg, any symmetric matrix without negative eigenvalues.
    inertia: J in the body frame with the added inertia, (3, 3) or (3,), kg m². buoyancy: B = ρ|V|g, N; by default the
    weight mg, a neutrally buoyant vehicle. center_of_buoyancy: r from the mass centre, body frame, (3,) m.
    gravity: g, m/s². Raises ArgumentError for what no vehicle can have. Source: (P57)–(P71).
    """
    m, g = positive(mass, "mass"), not_negative(gravity, "gravity")
    given = {
        "mass": m,
        "added_mass": added_mass,
        "inertia": inertia,
        "buoyancy": m * g if buoyancy is None else buoyancy,
        "center_of_buoyancy": center_of_buoyancy,
        "gravity": g,
    }
    return System(
        SO3(),
        lagrangian,
        additional=Defining(),
        advected=Defining(),
        parameters=Parameters(**checked(CHECKS, given)),
        name="underwater vehicle",
        units=UNITS,
        checks=partial(checked, CHECKS),
    )


def start(
    vehicle: System,
    *,
    position: Quantity = (0.0, 0.0, 0.0),
    velocity: Quantity = (0.0, 0.0, 0.0),
    rotation: Quantity | None = None,
    euler_zxz: Quantity | None = None,
    euler_zyx: Quantity | None = None,
    angular_velocity: Quantity | None = None,
    euler_rates: Quantity | None = None,
    down: Quantity = (0.0, 0.0, 1.0),
) -> State:
    """The state of a vehicle at position q with velocity q̇, attitude R and angular velocity ω; a = R⁻¹down.

    position: q, (3,) m; velocity: q̇, (3,) m/s, both in the space frame. Attitude and angular velocity as in
    `orientation`: R = I and ω = 0 unless given. down: the direction of gravity in the space frame, a unit vector (3,).
    Of a vehicle on SE(3), g = (R, q), ξ = (ω, R⁻¹q̇) and a₀ = (down, 0).
    """
    R, omega = orientation(rotation, euler_zxz, euler_zyx, angular_velocity, euler_rates)
    q, qdot, a0 = vector(position, "position"), vector(velocity, "velocity"), direction(down, "down")
    if not isinstance(vehicle.group, SE3):
        return vehicle.state(g=R, q=q, xi=omega, qdot=qdot, a0=a0)
    xi = evaluate(lambda R, omega, v: jnp.concatenate([omega, R.T @ v]), R, omega, qdot)
    return vehicle.state(g=(R, q), xi=xi, a0=evaluate(lambda d: jnp.append(d, 0.0), a0))
