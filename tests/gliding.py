"""Steady gliding in a vertical plane, in closed form, and the trim that flies it."""

from __future__ import annotations

from math import atan2, cos, sin, sqrt, tan
from typing import NamedTuple, TypeVar

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.models.quantities import number, positive
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.ballast import Ballast
from coadjoint_vehicles.parts.lifting_body import LiftingBody
from coadjoint_vehicles.parts.moving_mass import MovingMass
from coadjoint_vehicles.parts.part import Part

Kind = TypeVar("Kind", bound=Part)


class Glide(NamedTuple):
    """A steady glide: path angle ξ (up positive), angle of attack α and pitch θ = ξ + α, rad; speed V, m/s.

    weight: net weight in the water, N, positive sinking.
    """

    path: float
    angle_of_attack: float
    pitch: float
    speed: float
    weight: float


def steady_glide(body: LiftingBody, path: float, speed: float) -> Glide:
    """The glide at a path angle ξ with speed V: D = −W sin ξ, L = W cos ξ, so that tan ξ = −D/L.

    (K_D0 + K_D α²) cos ξ + (K_L0 + K_L α) sin ξ = 0 for the smaller α, W² = D² + L². path: ξ, rad, negative going down.
    speed: V, m/s. Raises ArgumentError for a path that is flatter than the best glide. Source: Graver (2005), 4.1.
    """
    path, speed = float(number(path, "path")), float(positive(speed, "speed"))
    drag, lift = np.asarray(body.drag, dtype=float), np.asarray(body.lift, dtype=float)
    # K_D α² + K_L tan ξ α + K_D0 + K_L0 tan ξ = 0.
    slope = tan(path)
    discriminant = (lift[1] * slope) ** 2 - 4 * drag[1] * (drag[0] + lift[0] * slope)
    if path == 0 or abs(path) >= np.pi / 2 or discriminant < 0:
        down, up = flattest_glides(body)
        raise ArgumentError(
            f"`{body.name}` has no steady glide at a path angle of {np.degrees(path):.4g}°: it glides from "
            f"{np.degrees(down):.4g}° downwards and from {np.degrees(up):.4g}° upwards, to ±90°."
        )
    # The smaller root, in a form that does not cancel.
    alpha = -2 * (drag[0] + lift[0] * slope) / (lift[1] * slope + np.sign(slope) * sqrt(discriminant))
    D, L = (drag[0] + drag[1] * alpha**2) * speed**2, (lift[0] + lift[1] * alpha) * speed**2
    weight = -np.sign(path) * sqrt(D**2 + L**2)
    return Glide(float(path), float(alpha), float(path + alpha), float(speed), float(weight))


def flattest_glides(body: LiftingBody) -> tuple[float, float]:
    """The flattest paths down (negative) and up, rad.

    tan ξ = 2 (K_D/K_L)(K_L0/K_L ± √(K_L0²/K_L² + K_D0/K_D)). Source: Graver (2005), 4.1.
    """
    ratio, offset = body.drag[1] / body.lift[1], body.lift[0] / body.lift[1]
    root = sqrt(offset**2 + body.drag[0] / body.drag[1])
    return atan2(2 * ratio * (offset - root), 1.0), atan2(2 * ratio * (offset + root), 1.0)


def trim(vehicle: Vehicle, path: float, speed: float) -> tuple[Glide, dict[str, float]]:
    """The glide at a path angle and speed, and where it wants the vehicle's moving mass and ballast.

    Forces: W = (m + Σm_i)g − ρ(V + V_b)g. Torque about O, with d = (−sin θ, 0, cos θ) down in the body and v = V(cos α,
    0, sin α): g (Σ m r − ρ Σ V r) × d + (impulse of added mass) × v + (K_M0 + K_M α)V² = 0 about starboard.
    The vehicle has one LiftingBody, MovingMass and Ballast; forces of other parts are left out.
    Raises ArgumentError for another vehicle, for a path that it cannot glide, and for a trim out of range.
    """
    body, shifter, ballast = _only(vehicle, LiftingBody), _only(vehicle, MovingMass), _only(vehicle, Ballast)
    glide = steady_glide(body, path, speed)
    g, rho = float(vehicle.gravity), float(vehicle.fluid_density)
    volume = (g * (vehicle.mass + shifter.mass) - glide.weight) / (rho * g) - vehicle.volume
    down = np.array([-sin(glide.pitch), 0.0, cos(glide.pitch)])
    v = speed * np.array([cos(glide.angle_of_attack), 0.0, sin(glide.angle_of_attack)])
    moment = vehicle.mass * vehicle.center_of_mass + shifter.mass * shifter.position
    moment = moment - rho * (vehicle.volume * vehicle.center_of_buoyancy + volume * ballast.position)
    impulse = vehicle.added_mass[:3, :3] @ v
    known = (
        g * np.cross(moment, down)[1]
        + np.cross(impulse, v)[1]
        + (body.pitch[0] + body.pitch[1] * glide.angle_of_attack) * speed**2
    )
    shift = -known / (g * shifter.mass * np.cross(shifter.axis, down)[1])
    found = {shifter.name: float(shift), ballast.name: float(volume)}
    for part in (shifter, ballast):
        if not part.low <= found[part.name] <= part.high:
            raise ArgumentError(
                f"A glide at {np.degrees(path):.4g}° with {speed:g} m/s needs `{part.name}` at {found[part.name]:.4g}, "
                f"but its range is {part.low:g} to {part.high:g}."
            )
    return glide, found


def _only(vehicle: Vehicle, kind: type[Kind]) -> Kind:
    found = [part for part in vehicle.parts if isinstance(part, kind)]
    if len(found) != 1:
        raise ArgumentError(f"A trim needs one {kind.__name__} on `{vehicle.name}`, but there are {len(found)}.")
    return found[0]
