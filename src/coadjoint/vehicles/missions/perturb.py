"""Members of a mission that differ: parameters with normal deviations from a seed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.mechanics.members import Each

if TYPE_CHECKING:
    from coadjoint.vehicles.missions.file import MissionFile

SYMMETRIC = ("inertia", "added_mass")


def perturbed(file: MissionFile, system: Any, kinds: Mapping[str, Any]) -> Any:
    """The system with co.each of p + σ ζ for every parameter of [perturb], ζ normal and independent.

    σ is a number in the parameter's unit, or a text such as "5 %" of the parameter itself; of an array each entry has
    its own ζ, of a symmetric matrix each pair. kinds: what the parameters measure. Raises ArgumentError.
    """
    from coadjoint.vehicles.missions.measures import parameters_in_si

    given = {key: value for key, value in file.perturb.items() if key != "seed"}
    deviations = parameters_in_si("perturb", given, kinds)
    random = np.random.default_rng(_seed(file))
    return system.replace(**_varied(deviations, system.parameters, file.run.members, random)) if deviations else system


def _varied(deviations: Mapping[str, Any], values: Any, members: int, random: np.random.Generator) -> dict[str, Any]:
    """p + σ ζ of each member in the place of σ."""
    import coadjoint as co

    found: dict[str, Any] = {}
    for name, given in deviations.items():
        value = getattr(values, name)
        if isinstance(given, Mapping):
            found[name] = _varied(given, value, members, random)
            continue
        value = np.asarray(value, dtype=float)
        zeta = random.standard_normal((members, *value.shape))
        if name in SYMMETRIC:
            zeta = np.triu(zeta) + np.swapaxes(np.triu(zeta, 1), 1, 2)
        found[name] = co.each(value + _deviation(name, given, value) * zeta)
    return found


def seeds(file: MissionFile) -> Any:
    """A seed for each member's random current; None for one member, unless [perturb] has one of each."""
    import coadjoint as co

    if isinstance(own := file.perturb.get("seed"), Each):
        return own
    count = file.run.members
    return co.each(_seed(file) * count + np.arange(count)) if count > 1 else None


def _seed(file: MissionFile) -> int:
    seed = file.perturb.get("seed", 0)
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ArgumentError(f"[perturb] seed must be a whole number, 0 or more, but is {seed!r}.")
    return seed


def _deviation(name: str, given: Any, value: np.ndarray) -> np.ndarray:
    """σ of a parameter, a number of its unit or a share of it."""
    text = given.strip() if isinstance(given, str) else ""
    try:
        found = np.asarray(float(text[:-1]) / 100 * np.abs(value) if text.endswith("%") else given, dtype=float)
        found = np.broadcast_to(found, value.shape)
    except (TypeError, ValueError) as error:
        raise ArgumentError(
            f'[perturb] {name} must be a standard deviation, a number or a share such as "5 %", but is {given!r}.'
        ) from error
    if not np.all(np.isfinite(found)):
        raise ArgumentError(f"[perturb] {name} must be finite, but is {given!r}.")
    if not np.all(found >= 0):
        raise ArgumentError(f"[perturb] {name} must not be negative, but is {given!r}.")
    return found
