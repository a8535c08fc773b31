"""Parameters that are uncertain: normal deviations with the standard deviations of the vehicle file, or with others."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.paths import paths
from coadjoint_vehicles.environments.nested import nested
from coadjoint_vehicles.model.craft import Craft

REACHES = (5.0, 4.0, 3.0, 2.5, 2.0)
"""In standard deviations: as far as this a parameter is drawn, the first at which it still can be."""
TRIES = 1000
SYMMETRIC = ("inertia", "added_mass")


class Uncertain:
    """Draws p + σ ζ of parameters, ζ normal and independent; of a symmetric matrix each pair has one.

    given: path → σ, a number in the unit of the parameter (SI) or a share such as "5 %". ζ is drawn again beyond
    `reach`, the first of 5, 4, 3, 2.5, 2 at which both p ± reach σ are possible. Raises ArgumentError.
    """

    def __init__(self, craft: Craft, given: Mapping[str, object]):
        known = paths(craft.parameters)
        for path in given:
            checks.known(path, known, "parameter", craft.vehicle.name)
        self.nominal = {path: np.asarray(known[path], dtype=float) for path in given}
        self.deviations = {path: deviation(path, given[path], self.nominal[path]) for path in given}
        self.reaches = {path: self._reach(craft, path) for path in given}

    def _reach(self, craft: Craft, path: str) -> float:
        error: ArgumentError | None = None
        for reach in REACHES:
            try:
                for sign in (-1, 1):
                    off = self.nominal[path] + sign * reach * self.deviations[path]
                    craft.replace(**nested({path: off if off.ndim else float(off)}))
                return reach
            except ArgumentError as found:
                error = found
        raise ArgumentError(
            f"The uncertainty of `{path}` is so large that 2 standard deviations away it cannot be: make it smaller. "
            f"({error})"
        )

    def __call__(self, random: np.random.Generator) -> dict[str, np.ndarray]:
        """One draw, path → value."""
        return {path: self._drawn(path, random) for path in self.nominal}

    def _drawn(self, path: str, random: np.random.Generator) -> np.ndarray:
        value, of = self.nominal[path], self.deviations[path]
        for _ in range(TRIES):
            zeta = _within(random, value.shape, self.reaches[path])
            if path not in SYMMETRIC:
                return value + of * zeta
            found = value + of * (np.triu(zeta) + np.triu(zeta, 1).T)
            if np.linalg.eigvalsh(found)[0] > (0.0 if path == "inertia" else -1e-12):
                return found
        raise ArgumentError(
            f"The uncertainty of `{path}` is so large that hardly a draw of it can be: make it smaller."
        )


def _within(random: np.random.Generator, shape: tuple[int, ...], reach: float) -> np.ndarray:
    """Normal numbers between ±reach."""
    zeta = random.standard_normal(shape)
    while np.any(beyond := np.abs(zeta) > reach):
        zeta = np.where(beyond, random.standard_normal(shape), zeta)
    return zeta


def deviation(path: str, given: object, value: np.ndarray) -> np.ndarray:
    """σ of a parameter, of its shape; raises ArgumentError."""
    text = given.strip() if isinstance(given, str) else ""
    try:
        found = np.asarray(float(text[:-1]) / 100 * np.abs(value) if text.endswith("%") else given, dtype=float)
        if found.ndim == 1 and value.shape == (*found.shape, *found.shape):
            found = np.diag(found)
        found = np.broadcast_to(found, value.shape)
    except (TypeError, ValueError):
        found = np.full(1, np.nan)
    fits = not isinstance(given, bool) and np.all(np.isfinite(found)) and (not np.any(found < 0))
    checks.expect(fits, given, f"The uncertainty of `{path}`", 'a number of at least 0, or a share such as "5 %"')
    return found


def of_file(craft: Craft) -> dict[str, object]:
    """The uncertainties that the vehicle's file states, by the paths of parameters; raises ArgumentError for none."""
    vehicle, known = craft.vehicle, paths(craft.parameters)
    found: dict[str, PyTree] = {}
    for key, quantity in vehicle.provenance.items():
        if quantity.uncertainty is None:
            continue
        room, _, name = key.partition(".")
        path = {"body": name, "added_mass": "added_mass"}.get(room, key)
        path = "volume" if path == "buoyancy" else path
        derived = (path == "volume" and name == "buoyancy") or (room == "added_mass" and name != "matrix")
        if derived and not isinstance(quantity.uncertainty, str):
            raise ArgumentError(
                f'The parameter `{path}` is worked out of {key}, whose uncertainty must be a share such as "5 %", but '
                f"is {quantity.uncertainty}."
            )
        if path not in known:
            raise ArgumentError(f"{key} has an uncertainty, but is not a parameter by itself: give those of others.")
        found[path] = quantity.uncertainty
    if not found:
        raise ArgumentError(
            f"The file of {vehicle.name} states no uncertainties: add them to its quantities, as in uncertainty = "
            '"5 %", or give them, as in randomise={"mass": "2 %"}.'
        )
    return found
