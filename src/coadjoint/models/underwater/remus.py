"""REMUS 100: a torpedo-shaped vehicle with two pairs of stern fins and a propeller."""

from __future__ import annotations

from math import pi, radians, sqrt
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint.groups import SO3
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import Force, Motion, State
from coadjoint.mechanics.system import System
from coadjoint.models.orientation import orientation
from coadjoint.models.quantities import positive, vector
from coadjoint.models.underwater import hydrodynamics as water
from coadjoint.models.underwater.autopilot import at_rest, autopilot
from coadjoint.models.underwater.general_form import kinetic, potential
from coadjoint.models.underwater.paper_form import UNITS
from coadjoint.spaces import Defining

LENGTH, DIAMETER, DENSITY, GRAVITY = 1.6, 0.19, 1026.0, 9.81  # PVS
MASS = 4 / 3 * pi * DENSITY * (LENGTH / 2) * (DIAMETER / 2) ** 2  # PVS: the ellipsoid's, 31.03 kg
INERTIA = (0.1120, 4.0278, 4.0278)  # PVS, about the mass centre
ADDED_MASS = (0.8389, 29.4376, 29.4376, 0.0336, 3.4262, 3.4262)  # PVS: Lamb's k-factors, 0.3 I_x in roll
CENTER_OF_MASS = (0.0, 0.0, 0.02)  # PVS, from the centre of buoyancy


def _linear_damping() -> np.ndarray:
    """D = (M_1/20 s, M_2/20 s, M_3/20 s, 2ζ√(M_4 W z_g), 2ζ√(M_5 W z_g), M_6/1 s), ζ = 0.3 in roll and 0.8 in pitch."""
    z = CENTER_OF_MASS[2]
    rigid = np.array([MASS, MASS, MASS, INERTIA[0] + MASS * z**2, INERTIA[1] + MASS * z**2, INERTIA[2]])
    M = rigid + np.array(ADDED_MASS)
    righting = MASS * GRAVITY * z
    return np.array(
        [M[0] / 20, M[1] / 20, M[2] / 20, 0.6 * sqrt(M[3] * righting), 1.6 * sqrt(M[4] * righting), M[5] / 1.0]
    )


REMUS_100: dict[str, Any] = {
    "mass": MASS,
    "inertia": INERTIA,
    "added_mass": ADDED_MASS,
    "buoyancy": MASS * GRAVITY,  # PVS: neutrally buoyant
    "center_of_mass": CENTER_OF_MASS,
    "center_of_buoyancy": (0.0, 0.0, 0.0),  # PVS
    "gravity": GRAVITY,
    "fluid_density": DENSITY,  # PVS
    "length": LENGTH,  # PVS
    "diameter": DIAMETER,  # PVS
    "damping": _linear_damping(),  # PVS
    "fading": (3.0, 3.0, 3.0, 0.0, 0.0, 3.0),  # PVS, with heave as sway: the hull is round
    "axial_drag": 0.42,  # Allen et al. (2000), on πd²/4
    "crossflow_drag": 1.1,  # Prestero (2001): a cylinder, after Hoerner
    "fin_area": 2 * 0.00665,  # MSS: a pair
    "fin_position": -LENGTH / 2,  # PVS
    "fin_lift_slope": 3.12,  # Prestero (2001), after Hoerner; the 0.5 and 0.7 of PVS leave out the flow's own angle
    "fin_stall": radians(20),  # MSS: its largest deflection
    "fin_limit": radians(15),  # PVS
    "fin_lag": 0.1,  # PVS
    "propeller_diameter": 0.14,  # PVS
    "thrust": (0.4566, (0.1798 - 0.4566) / 0.6632),  # PVS: Wageningen, at advance numbers 0 and 0.6632
    "torque": (0.0700, (0.0312 - 0.0700) / 0.6632),  # PVS
    "thrust_deduction": 0.1,  # PVS
    "advance": 0.944,  # Allen et al. (2000)
    "torque_fraction": 0.1,  # MSS: K_prop/10
    "revolutions_limit": 1525 / 60,  # PVS, 1/s
    "propeller_lag": 1.0,  # PVS
    "period": 0.1,
    "delay": 0.0,
    "depth_gains": (0.2, 0.005, 0.1),
    "pitch_gains": (1.5, 0.0, 0.8),
    "pitch_limit": radians(30),
    "heading_gains": (1.2, 0.02, 1.0),
    "speed_gains": (20.0, 5.0, 0.0),
}
"""SI units. PVS, MSS: cybergalactic/PythonVehicleSimulator and MSS, remus100 (Fossen).

Gains, period and delay are this library's own."""


_PARAMETERS = {**REMUS_100, "inertia": np.diag(INERTIA), "added_mass": np.diag(ADDED_MASS)}


_ACTUATORS = {"rudder": "rad", "stern_planes": "rad", "revolutions": "1/s"}
_INTEGRALS = {"depth": "m s", "heading": "rad s", "speed": "m"}
_UNITS = {
    **UNITS,
    "a_current": "m/s",
    **{f"inputs_{name}": unit for name, unit in {"depth": "m", "heading": "rad", "speed": "m/s"}.items()},
    **{f"internal_{name}": unit for name, unit in _ACTUATORS.items()},
    **{f"internal_pilot_{name}": "s" for name in ("sample", "release")},
    **{
        f"internal_pilot_{when}_{name}": unit
        for when in ("value", "pending")
        for name, unit in {**_ACTUATORS, **_INTEGRALS}.items()
    },
}


def lagrangian(xi, n, nu, a, p):
    """ℓ(ω, n, ν, a) = ½[ν_r; ω]ᵀ(M_RB + M_A)[ν_r; ω] + (mg − B) n·d + (mg r_g − B r_b)·d, ν_r = ν − c.

    d is the direction of down, c the current, both in the body frame.

    With the body's own kinetic energy of ν instead of ν_r, ℓ differs by (d/dt)(m q_g·c₀), which moves nothing.
    """
    return kinetic(xi, nu - a.current, p) - potential(n @ a.down, a.down, p)


def _through_water(motion: Motion):
    return motion.nu - motion.a.current, motion.xi


def damping(motion: Motion, p: Any) -> Force:
    """Skin friction and wave making, linear in the velocities and fading with speed."""
    return water.linear_damping(*_through_water(motion), p.damping, p.fading)


def hull(motion: Motion, p: Any) -> Force:
    """Quadratic drag along and across the hull."""
    v, omega = _through_water(motion)
    along = water.axial_drag(v, p.fluid_density, p.axial_drag, jnp.pi / 4 * p.diameter**2)
    across = water.crossflow_drag(v, omega, p.fluid_density, p.crossflow_drag, p.diameter, p.length)
    return Force(torque=across.torque, force=along.force + across.force)


def stern_planes(motion: Motion, p: Any) -> Force:
    """The horizontal fins, at the angle `motion.internal.stern_planes`."""
    return water.stern_planes(*_through_water(motion), motion.internal.stern_planes, p)


def rudder(motion: Motion, p: Any) -> Force:
    """The vertical fins, at the angle `motion.internal.rudder`."""
    return water.rudders(*_through_water(motion), motion.internal.rudder, p)


def propeller(motion: Motion, p: Any) -> Force:
    """Thrust and torque at `motion.internal.revolutions`."""
    return water.propeller(_through_water(motion)[0], motion.internal.revolutions, p)


def remus_100(*, automatic: bool = True) -> System:
    """REMUS 100 on SO(3) × ℝ³ in a steady current: hull, fins, propeller, actuators and, if `automatic`, an autopilot.

    Advected parameters: `down`, `north`, `current` (m/s), vectors of the space frame as the body sees them. With the
    autopilot, runs take the inputs `depth` (m), `heading` (rad), `speed` (m/s through the water); without, the internal
    state stays as it starts, with fins and revolutions (1/s) fixed.
    Energy has a line for each of `damping`, `hull`, `stern_planes`, `rudder`, `propeller`. Other parameters than those
    of `REMUS_100`: `vehicle.replace(period=0.2)`.
    """
    return System(
        SO3(),
        lagrangian,
        additional=Defining(),
        advected={"down": Defining(), "north": Defining(), "current": Defining()},
        parameters=Parameters(**_PARAMETERS),
        forces={
            "damping": damping,
            "hull": hull,
            "stern_planes": stern_planes,
            "rudder": rudder,
            "propeller": propeller,
        },
        internal=autopilot if automatic else None,
        name="REMUS 100",
        units=_UNITS,
    )


def open_loop(*, fluid_density: float, axial_drag: float, crossflow_drag: float, fin_lift_slope: float) -> System:
    """REMUS 100 without its autopilot, with other values of what is known worst."""
    given = {"axial_drag": axial_drag, "crossflow_drag": crossflow_drag, "fin_lift_slope": fin_lift_slope}
    return remus_100(automatic=False).replace(fluid_density=positive(fluid_density, "fluid_density"), **given)


def remus_start(
    vehicle: System,
    *,
    position: Any = (0.0, 0.0, 0.0),
    speed: float = 0.0,
    euler_zyx: Any = (0.0, 0.0, 0.0),
    current: Any = (0.0, 0.0, 0.0),
    stern_planes: float = 0.0,
    rudder: float = 0.0,
    revolutions: float = 0.0,
) -> State:
    """The state at a position (north, east, depth) (m), going ahead at `speed` (m/s) through water with a `current`.

    euler_zyx: yaw, pitch, roll (rad). current: (3,) m/s in the space frame north, east, down. stern_planes,
    rudder: rad. revolutions: 1/s.
    """
    R, _ = orientation(None, None, euler_zyx, None, None)
    c = vector(current, "current")
    return vehicle.state(
        g=R,
        q=vector(position, "position"),
        qdot=np.asarray(R)[:, 0] * speed + c,
        a0={"down": [0, 0, 1], "north": [1, 0, 0], "current": c},
        internal={**at_rest(revolutions), "stern_planes": stern_planes, "rudder": rudder},
    )
