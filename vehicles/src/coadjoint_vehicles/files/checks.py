"""Doubtful values of a vehicle: every sentence names a finding and a possible meaning."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from coadjoint_vehicles.files.check_parts import part_warnings
from coadjoint_vehicles.model.changed import rebuilt
from coadjoint_vehicles.model.loads import loads
from coadjoint_vehicles.model.vehicle import BODY, Vehicle

MODES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
SLENDER = 3.0
"""Length over breadth from which a body counts as slender."""
UNBALANCED = 0.03
"""(W − B)/W from which weight and buoyancy do not belong together."""


def check(vehicle: Vehicle) -> tuple[str, ...]:
    """Sentences on doubtful values of a vehicle, none for a sound one: balance, righting, axes, units, signs.

    These findings never stop a run: mechanics allows them. `Vehicle` and its parts raise for impossible values.
    """
    rules: tuple[Callable[[Vehicle], Iterator[str]], ...] = (
        _balance, _righting, _trim, _inertia, _added_mass, _axes, _surroundings, _sizes, _sensors, part_warnings,
    )  # fmt: skip
    return tuple(sentence for rule in rules for sentence in rule(vehicle))


def doubts_of_changes(craft: Any) -> list[str]:
    """Sentences on a craft's vehicle that is doubtful because of its parameters, not its own numbers."""
    vehicle, found = craft.vehicle, craft.parameters.asdict()
    body = {name: getattr(vehicle, name) for name in BODY}
    changed = rebuilt(vehicle, body, {name: found[name] for name in body})
    parts = [
        rebuilt(part, part.parameters(), found[part.name]) if part.name in found else part for part in vehicle.parts
    ]
    before = check(vehicle)
    return [sentence for sentence in check(replace(changed, parts=tuple(parts))) if sentence not in before]


def _balance(vehicle: Vehicle) -> Iterator[str]:
    all_of = loads(vehicle)
    W, B = all_of.mass * all_of.gravity, all_of.volume * all_of.density * all_of.gravity
    if W > 0 and abs(W - B) > UNBALANCED * W:
        word = "sinks" if W > B else "floats up"
        yield (
            f"its weight is {W:.4g} N and its buoyancy {B:.4g} N, {100 * (B - W) / W:+.1f} %: it {word} unless "
            "something holds it. Are both of one vehicle, in this water? Where it is trimmed: neutral = true."
        )


def _righting(vehicle: Vehicle) -> Iterator[str]:
    above = loads(vehicle).center_of_mass[2] - vehicle.center_of_buoyancy[2]  # down is positive
    if vehicle.gravity == 0:
        return
    if above < -1e-9:
        yield (
            f"its centre of buoyancy is {-1000 * above:.3g} mm below its centre of mass: it turns over. In axes that "
            "point down a centre above another has the smaller third component; was the file written with z up, FLU?"
        )
    elif above <= 1e-9:
        yield "its centres of mass and buoyancy are at one height: nothing rights it in roll and pitch."


def _trim(vehicle: Vehicle) -> Iterator[str]:
    arm = loads(vehicle).center_of_mass - np.asarray(vehicle.center_of_buoyancy)
    if vehicle.gravity == 0 or arm[2] <= 1e-9:
        return
    for offset, what in ((arm[0], "trim"), (arm[1], "heel")):
        angle = np.degrees(np.arctan2(offset, arm[2]))
        if abs(angle) > 10:
            side = {
                "trim": "nose down" if offset > 0 else "nose up",
                "heel": "to starboard" if offset > 0 else "to port",
            }
            yield (
                f"at rest it has a {what} of {abs(angle):.0f}° {side[what]}, since its centre of mass is "
                f"{1000 * abs(offset):.3g} mm off its centre of buoyancy: are both from one origin?"
            )


def _inertia(vehicle: Vehicle) -> Iterator[str]:
    I = np.asarray(vehicle.inertia)
    least = float(np.linalg.eigvalsh(0.5 * np.trace(I) * np.eye(3) - I)[0])
    if least < -1e-6 * np.trace(I):
        a, b, c = np.sort(np.linalg.eigvalsh(I))
        yield (
            f"its moments of inertia {a:.4g}, {b:.4g} and {c:.4g} kg m² break {c:.4g} ≤ {a:.4g} + {b:.4g}: no "
            "distribution of mass has them. Is added inertia in one of them?"
        )
    size = vehicle.length if vehicle.length is not None else 2 * np.cbrt(vehicle.volume)
    gyration = np.sqrt(np.max(np.linalg.eigvalsh(I)) / vehicle.mass)
    if gyration > size:
        yield (
            f"its largest radius of gyration, √(I/m) = {gyration:.3g} m, is more than its size of {size:.3g} m: check "
            "mass and inertia, and their units."
        )
    if gyration < 0.02 * size:
        yield f"its radii of gyration, √(I/m) ≤ {gyration:.2g} m, are tiny for a size of {size:.3g} m: check the units."


def _added_mass(vehicle: Vehicle) -> Iterator[str]:
    M = np.asarray(vehicle.added_mass)
    water = vehicle.fluid_density * vehicle.volume
    if not np.any(M):
        yield "it has no added mass at all: water that is pushed aside is left out."
        return
    for mode, entry in zip(MODES[:3], np.diag(M), strict=False):
        if entry > 5 * water:
            yield (
                f"its added mass in {mode}, {entry:.4g} kg, is {entry / water:.0f} times the water that it displaces "
                f"({water:.4g} kg): check the units."
            )
        if entry == 0:
            yield f"its added mass in {mode} is zero, which no body has."


def _axes(vehicle: Vehicle) -> Iterator[str]:
    """Signs that two axes have been exchanged, on slender bodies."""
    if vehicle.length is None or vehicle.diameter is None or vehicle.length < SLENDER * vehicle.diameter:
        return
    A = np.diag(vehicle.added_mass)
    for mode, entry in zip(MODES[1:3], A[1:3], strict=True):
        if 0 < entry < A[0]:
            yield (
                f"its added mass in {mode}, {entry:.4g} kg, is less than in surge, {A[0]:.4g} kg, on a body "
                f"{vehicle.length / vehicle.diameter:.1f} times as long as wide: are two axes exchanged?"
            )
    I = np.diag(vehicle.inertia)
    for mode, entry in zip(("y", "z"), I[1:], strict=True):
        if entry < I[0]:
            yield (
                f"its moment of inertia about {mode}, {entry:.4g} kg m², is less than about x, {I[0]:.4g} kg m², on a "
                f"body {vehicle.length / vehicle.diameter:.1f} times as long as wide: are two axes exchanged?"
            )


def _surroundings(vehicle: Vehicle) -> Iterator[str]:
    if not 950 <= vehicle.fluid_density <= 1100:
        yield f"its water has {vehicle.fluid_density:g} kg/m³, but natural waters have 990 to 1060 kg/m³."
    if vehicle.gravity != 0 and not 9.7 <= vehicle.gravity <= 9.9:
        yield f"gravity is {vehicle.gravity:g} m/s², but on the earth 9.76 to 9.84 m/s²."


def _sizes(vehicle: Vehicle) -> Iterator[str]:
    """Lengths that do not belong to the volume: mostly millimetres taken for metres."""
    L, d, V = vehicle.length, vehicle.diameter, vehicle.volume
    if L is not None and V > 1.2 * L**3:
        yield f"its volume of {V:.3g} m³ does not fit into a length of {L:.3g} m: check their units."
    if L is not None and V < 1e-5 * L**3:
        yield f"its volume of {V:.3g} m³ is tiny for a length of {L:.3g} m: check their units."
    if L is not None and d is not None:
        cylinder = np.pi / 4 * d**2 * L
        if d <= L and not 0.3 <= V / cylinder <= 1.6:
            yield (
                f"its volume of {V:.3g} m³ is {V / cylinder:.2g} times that of a cylinder of its length and diameter: "
                "check the units of the three."
            )
        if d > L:
            yield f"its diameter of {d:.3g} m is more than its length of {L:.3g} m: are they exchanged?"
    size = L if L is not None else 2 * np.cbrt(V)
    for name in ("center_of_mass", "center_of_buoyancy"):
        r = float(np.linalg.norm(getattr(vehicle, name)))
        if r > size:
            yield f"its {name} is {r:.3g} m from the origin, but its size is {size:.3g} m: millimetres?"


def _sensors(vehicle: Vehicle) -> Iterator[str]:
    """Sensors whose places are in another unit."""
    size = vehicle.length if vehicle.length is not None else 2 * np.cbrt(vehicle.volume)
    for one in vehicle.sensors:
        r = float(np.linalg.norm(one.position))
        if r > size:
            yield (
                f"its sensor `{one.name}` sits {r:.3g} m from the origin, but its size is {size:.3g} m: is that in "
                "millimetres?"
            )
