"""Doubtful parts of a vehicle: damping that drives, fins in front, thrusters that push nowhere."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.extending import evaluate
from coadjoint.mechanics.members import Each
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.allocator import LEAST_AUTHORITY
from coadjoint_vehicles.parts.damping import Damping
from coadjoint_vehicles.parts.derivatives import Derivatives
from coadjoint_vehicles.parts.fin import Fin
from coadjoint_vehicles.parts.hull import Hull
from coadjoint_vehicles.parts.lifting_body import LiftingBody
from coadjoint_vehicles.parts.mmg import Mmg
from coadjoint_vehicles.parts.part import Part
from coadjoint_vehicles.parts.propeller import Propeller
from coadjoint_vehicles.parts.thrusters import Thrusters

MODES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
BRAKES = (Damping, Hull, Derivatives, LiftingBody, Mmg)
FASTEST = 120.0
"""Revolutions a second that no marine propeller has."""
SLOWEST = 30.0
"""s: a lag beyond it is improbable for an actuator."""


def part_warnings(vehicle: Vehicle) -> Iterator[str]:
    """Sentences on the parts of a vehicle."""
    size = vehicle.length if vehicle.length is not None else 2 * float(np.cbrt(vehicle.volume))
    for part in vehicle.parts:
        if isinstance(part, Damping):
            yield from _damping(part)
        if isinstance(part, Derivatives):
            yield from _derivatives(part)
        if isinstance(part, Hull):
            yield from _hull(part, vehicle, size)
        if isinstance(part, Fin):
            yield from _fin(part, size)
        if isinstance(part, Propeller):
            yield from _propeller(part, size)
        if isinstance(part, Thrusters):
            yield from _thrusters(part, size)
        yield from _lag(part)
    yield from _fins_together(vehicle)
    yield from _thrusters_together(vehicle)
    if vehicle.commanded and not any(isinstance(part, BRAKES) for part in vehicle.parts):
        yield "it has actuators, but neither damping nor a hull: nothing brakes it."


def _damping(part: Damping) -> Iterator[str]:
    for key in ("linear", "quadratic", "forward"):
        value = getattr(part, key)
        if value is None:
            continue
        D = np.asarray(value, dtype=float)
        diagonal = D if D.ndim == 1 else np.diag(D)
        if np.any(diagonal < 0):
            worst = int(np.argmin(diagonal))
            yield (
                f"{key} of `{part.name}` has {diagonal[worst]:g} in {MODES[worst]}: it drives instead of braking. "
                "Damping is positive here, where derivatives such as X_u are negative."
            )
        elif D.ndim == 2 and key != "quadratic":
            # Scaled, so that N s/m and N m s count alike; antisymmetric parts, as of lift, do no work.
            scale = np.sqrt(np.maximum(np.diag(D), 1e-3 * max(np.max(np.diag(D)), 1e-300)))
            least = float(np.linalg.eigvalsh(0.5 * (D + D.T) / np.outer(scale, scale))[0])
            if least < -1e-6:
                yield (
                    f"the symmetric part of {key} of `{part.name}` has a negative eigenvalue: in some motions it puts "
                    "energy in. Check the signs of its entries off the diagonal."
                )


def _derivatives(part: Derivatives) -> Iterator[str]:
    """Coefficients such as X_u|u|, Y_v|v| or N_ur that push with their own velocity, going ahead."""
    for (name, value), monomial in zip(part.coefficients.items(), part.monomials, strict=True):
        signed = [which for which, size in monomial.factors if not size and which != 0]
        own = monomial.axis == 0 or signed == [monomial.axis]
        along = any(which == monomial.axis for which, _ in monomial.factors)
        brakes = own and along and not (monomial.axis == 0 and signed) and monomial.deflections == 0
        if brakes and float(np.max(value.values if isinstance(value, Each) else value)) > 0:
            yield (
                f"{name} of `{part.name}` is positive: it drives in {MODES[monomial.axis]} instead of braking. "
                "Derivatives that brake are negative."
            )


def _hull(part: Hull, vehicle: Vehicle, size: float) -> Iterator[str]:
    if part.length > 1.5 * size:
        yield f"the hull `{part.name}` is {part.length:.3g} m long on a vehicle of {size:.3g} m: check the units."
    sway, heave = np.diag(vehicle.added_mass)[1:3]
    if (part.width > 1.5 * part.height and heave < sway) or (part.height > 1.5 * part.width and sway < heave):
        yield (
            f"the hull `{part.name}` is {part.width:.3g} m wide and {part.height:.3g} m high, but the added mass is "
            f"{sway:.4g} kg in sway and {heave:.4g} kg in heave: are sway and heave exchanged?"
        )
    face = np.pi / 4 * vehicle.diameter**2 if vehicle.diameter is not None else size**2
    if part.axial_area > 5 * face:
        yield f"axial_area of `{part.name}` is {part.axial_area:.3g} m², but the vehicle shows {face:.3g} m²: units?"
    for drag, word in ((float(part.axial_drag), "axial_drag"), (float(np.max(part.crossflow_drag)), "crossflow_drag")):
        if drag > 3:
            yield f"{word} of `{part.name}` is {drag:g}; blunt bodies have 1 to 2 on their area."


def _fin(part: Fin, size: float) -> Iterator[str]:
    if part.stall > np.pi / 2:
        yield f"the fin `{part.name}` stalls at {np.degrees(part.stall):.0f}°, beyond 90°: degrees taken for radians?"
    if part.limit is not None and part.limit > np.pi / 2:
        yield f"the fin `{part.name}` turns to {np.degrees(part.limit):.0f}°, beyond 90°: degrees taken for radians?"
    if part.area > 0.25 * size**2:
        yield f"the fin `{part.name}` has {part.area:.3g} m² on a vehicle of {size:.3g} m: check its unit."
    yield from _far(part.name, part.position, size)


def _fins_together(vehicle: Vehicle) -> Iterator[str]:
    """Fins that turn a vehicle out of its course: their lift acts in front of the centre of buoyancy."""
    fins = [part for part in vehicle.parts if isinstance(part, Fin)]
    for axis, word in ((1, "yaw"), (2, "pitch")):
        arms = [
            part.area * part.lift_slope * part.normal[axis] ** 2 * (part.position[0] - vehicle.center_of_buoyancy[0])
            for part in fins
        ]
        if sum(arms) > 0:
            names = ", ".join(f"`{part.name}`" for part, arm in zip(fins, arms, strict=True) if arm > 0)
            yield (
                f"its fins {names} stand in front, so that they turn it out of its course in {word}: x is forward, and "
                "fins at the stern have a negative one."
            )


def _propeller(part: Propeller, size: float) -> Iterator[str]:
    if part.thrust[0] < 0 or part.axis[0] < 0:
        yield f"the propeller `{part.name}` pushes astern at positive revolutions: check its axis and K_T0."
    if part.thrust[1] > 0:
        yield f"the thrust of `{part.name}` grows with its advance: K_T1 is negative on every propeller."
    if part.limit > FASTEST:
        yield f"the propeller `{part.name}` turns {part.limit:g} times a second: are these revolutions a minute, rpm?"
    if part.diameter > size:
        yield f"the propeller `{part.name}` has a diameter of {part.diameter:.3g} m on a vehicle of {size:.3g} m."
    if not 0 <= part.thrust_deduction < 1 or not 0 <= part.wake_fraction < 1:
        yield f"thrust_deduction and wake_fraction of `{part.name}` should be from 0 to below 1."
    yield from _far(part.name, part.position, size)


def _thrusters(part: Thrusters, size: float) -> Iterator[str]:
    if np.any(np.max(np.abs(_matrix(part, effectiveness=1.0)[:3]), axis=0) < 1e-9):
        yield f"one of the thrusters `{part.name}` pushes nowhere: its column of the matrix has no force."
    if part.positions is not None:
        for position in part.positions:
            yield from _far(part.name, position, size)


def _thrusters_together(vehicle: Vehicle) -> Iterator[str]:
    """Thrusters of which none, and no propeller, pushes ahead."""
    found = [part for part in vehicle.parts if isinstance(part, Thrusters)]
    if not found or any(isinstance(part, Propeller) for part in vehicle.parts):
        return
    B = np.hstack([_matrix(part) for part in found])
    if np.max(np.abs(B[0])) < LEAST_AUTHORITY * np.max(np.abs(B)):
        names = ", ".join(f"`{part.name}`" for part in found)
        yield f"the thrusters {names} span no forward force: row X of their matrix is zero."


def _matrix(part: Thrusters, **changes: object) -> np.ndarray:
    return np.asarray(evaluate(part.matrix, part.nominal.replace(**changes)))


def _far(name: str, position: PyTree, size: float) -> Iterator[str]:
    r = float(np.linalg.norm(position))
    if r > 1.5 * size:
        yield f"`{name}` is {r:.3g} m from the origin of a vehicle of {size:.3g} m: millimetres taken for metres?"


def _lag(part: Part) -> Iterator[str]:
    lag = getattr(part, "lag", None)
    if lag is not None and float(np.max(lag)) > SLOWEST:
        yield f"`{part.name}` follows with a lag of {float(np.max(lag)):g} s: milliseconds taken for seconds?"
