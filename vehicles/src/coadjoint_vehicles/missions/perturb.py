"""Members of a mission that differ: parameters with normal deviations from a seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint import checks
from coadjoint.checks import whole
from coadjoint.errors import ArgumentError
from coadjoint.sections import key
from coadjoint.texts import Table

if TYPE_CHECKING:
    from coadjoint.mechanics import System
    from coadjoint.mechanics.members import Each

SYMMETRIC = ("inertia", "added_mass")


def _seed(value: object, name: str) -> Any:
    return value if hasattr(value, "member") else whole(value, name, least=0)


@dataclass(frozen=True)
class PerturbSection:
    """Differences of members: the standard deviations of parameters, and the seed of all random numbers."""

    seed: Any = key("seed of all random numbers", check=_seed, default=0)
    given: Mapping[str, Any] = key("standard deviation of each parameter, a number or a share", rest=True, factory=dict)


def perturbed(section: PerturbSection, members: int, system: System, kinds: Mapping[str, object]) -> System:
    """The system with co.each of p + σ ζ for every parameter of [perturb], ζ normal and independent.

    σ is a number in the parameter's unit, or a text such as "5 %" of the parameter itself; of an array each entry has
    its own ζ, of a symmetric matrix each pair. kinds: the dimensions of the parameters. Raises ArgumentError.
    """
    from coadjoint_vehicles.missions.measures import parameters_in_si

    deviations = parameters_in_si("perturb", section.given, kinds)
    random = np.random.default_rng(section.seed)
    return system.replace(**_varied(deviations, system.parameters, members, random)) if deviations else system


def _varied(deviations: Mapping[str, object], values: object, members: int, random: np.random.Generator) -> Table:
    """p + σ ζ of each member in the place of σ."""
    import coadjoint as co

    found: Table = {}
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


def seeds(section: PerturbSection, members: int) -> Each | None:
    """A seed for each member's random current; None for one member, unless [perturb] has one of each."""
    from coadjoint.mechanics.members import each

    if hasattr(section.seed, "member"):
        return section.seed
    return each(section.seed * members + np.arange(members)) if members > 1 else None


def _deviation(name: str, given: object, value: np.ndarray) -> np.ndarray:
    """σ of a parameter, a number of its unit or a share of it."""
    text = given.strip() if isinstance(given, str) else ""
    try:
        found = np.asarray(float(text[:-1]) / 100 * np.abs(value) if text.endswith("%") else given, dtype=float)
        found = np.broadcast_to(found, value.shape)
    except (TypeError, ValueError) as error:
        raise ArgumentError(
            f'[perturb] {name} must be a standard deviation, a number or a share such as "5 %", but is {given!r}.'
        ) from error
    checks.expect(np.all(np.isfinite(found)), given, f"[perturb] {name}", "finite")
    if not np.all(found >= 0):
        raise ArgumentError(f"[perturb] {name} must not be negative, but is {given!r}.")
    return found
