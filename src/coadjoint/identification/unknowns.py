"""The parameters that are to be found, as coordinates in which they may take any value."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import jax
import numpy as np

from coadjoint import checks
from coadjoint.errors import ArgumentError
from coadjoint.identification.equalities import SIGN, NamedEntry, groups, require_equal, require_once
from coadjoint.kernels.packing import pack
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.system import System

_ENTRY = re.compile(r"^(?P<name>[^\[\]]+)(\[(?P<index>[\d,\s]+)\])?$")

MOST = 40
"""The most numbers estimated together: no log determines more, and each costs a simulation at every iteration."""


@dataclass(frozen=True)
class Unknown:
    """One number: entries of a parameter array that are equal, found by its logarithm or by itself.

    `places`: the places of the entries among all numbers of the parameters. `scale`: a large value in its unit.
    """

    label: str
    places: tuple[int, ...]
    prior: float
    positive: bool

    @property
    def scale(self) -> float:
        return 1.0 if self.positive else abs(self.prior) or 1.0

    def value(self, coordinate: float) -> float:
        return self.prior * float(np.exp(coordinate)) if self.positive else self.prior + self.scale * coordinate

    def slope(self, coordinate: float) -> float:
        """dvalue/dcoordinate."""
        return self.value(coordinate) if self.positive else self.scale

    def interval(self, coordinate: float, half: float) -> tuple[float, float]:
        return self.value(coordinate - half), self.value(coordinate + half)


@dataclass(frozen=True)
class Unknowns:
    """All unknowns of a system, with the numbers of its parameters; `matrices` must stay positive definite."""

    system: System
    each: tuple[Unknown, ...]
    numbers: np.ndarray
    matrices: tuple[tuple[int, int], ...]
    """(first place, size) of symmetric positive definite matrices that hold unknowns."""

    def filled(self, coordinates: np.ndarray) -> np.ndarray:
        """The numbers of all parameters."""
        found = self.numbers.copy()
        for unknown, coordinate in zip(self.each, coordinates, strict=True):
            found[list(unknown.places)] = unknown.value(coordinate)
        return found

    def definite(self, coordinates: np.ndarray) -> bool:
        """Whether every matrix that was positive definite still is."""
        numbers = self.filled(coordinates)
        blocks = (numbers[first : first + n * n].reshape(n, n) for first, n in self.matrices)
        return all(np.linalg.eigvalsh(block)[0] > 0 for block in blocks)

    def directions(self, coordinates: np.ndarray, active: Sequence[int]) -> np.ndarray:
        """dp/dcoordinate, (unknowns, active)."""
        found = np.zeros((len(self.each), len(active)))
        for row, (unknown, coordinate) in enumerate(zip(self.each, coordinates, strict=True)):
            found[row, [active.index(place) for place in unknown.places]] = unknown.slope(coordinate)
        return found

    @property
    def active(self) -> tuple[int, ...]:
        """All places that are changed, in order."""
        return tuple(sorted({place for unknown in self.each for place in unknown.places}))

    def replaced(self, coordinates: np.ndarray) -> System:
        """The system with the values of these coordinates."""
        layout, _ = pack(self.system.parameters)
        return replace_parameters(self.system, layout.unpack(self.filled(coordinates)))


def unknowns(system: System, parameters: Sequence[str], positive: Sequence[str]) -> Unknowns:
    """The unknowns named `parameters`: arrays, `"damping"`, or entries, `"added_mass[0,0]"`; `"a = b"` is one
    unknown for both.

    The name of a part of a craft stands for all its parameters: `"hull"` for `hull.axial_drag`, … The nonzero entries
    of an array are unknown. Pairs of a symmetric matrix stay equal. Unknown by their logarithms are those named in
    `positive` and the diagonals of positive definite matrices. Raises ArgumentError, with the nearest name there is,
    where `positive` names other parameters, and for more than MOST numbers.
    """
    if system.parameters is None:
        raise ArgumentError("This system has no parameters to identify: give it co.Parameters(…).")
    fits = not isinstance(parameters, str) and list(parameters)
    checks.expect(fits, parameters, "parameters", "a list of names, such as ['damping']")
    known = _arrays(system.parameters)
    positive = _expanded(positive, known)
    chosen: dict[tuple[int, ...], Unknown] = {}
    matrices: dict[int, int] = {}
    for tied in groups(parameters, known, _expanded):
        members = [_entries(text, known, matrices) for text in tied]
        require_equal(tied, members)
        for equal in zip(*members, strict=True):
            places = tuple(sorted({place for entry in equal for place in entry.places}))
            label, value = SIGN.join(entry.label for entry in equal), equal[0].value
            names = {entry.label for entry in equal} | {entry.label.partition("[")[0] for entry in equal}
            log = any(entry.definite for entry in equal) or not names.isdisjoint(positive)
            if log and not value > 0:
                raise ArgumentError(f"`{label}` cannot be sought as positive: it starts from {value:g}.")
            chosen.setdefault(places, Unknown(label, places, value, log))
    require_once(chosen)
    if not chosen:
        raise ArgumentError(f"All entries of {', '.join(parameters)} are zero: name those to find, as in `name[0]`.")
    _require_few([unknown.label for unknown in chosen.values()])
    _require_sought(positive, [name for unknown in chosen.values() for name in unknown.label.split(SIGN)])
    numbers = np.concatenate([array.reshape(-1) for _, array in known.values()])
    return Unknowns(system, tuple(chosen.values()), numbers, tuple(matrices.items()))


def _entries(text: str, known: dict[str, tuple[int, np.ndarray]], matrices: dict[int, int]) -> list[NamedEntry]:
    """The entries that a name stands for, the nonzero ones of an array; adds positive definite matrices to `matrices`,
    first place → size."""
    name, index = _parsed(text, known)
    first, array = known[name]
    paired = array.ndim == 2 and array.shape[0] == array.shape[1] and bool(np.allclose(array, array.T, rtol=1e-9))
    definite = paired and array.shape[0] > 1 and np.linalg.eigvalsh(array)[0] > 0
    if definite:
        matrices[first] = len(array)
    found: dict[tuple[int, ...], NamedEntry] = {}
    for entry in np.ndindex(array.shape) if index is None else [index]:
        if index is None and array[entry] == 0:
            continue
        places = {first + int(np.ravel_multi_index(entry, array.shape)) if entry else first}
        if paired:
            places.add(first + int(np.ravel_multi_index(entry[::-1], array.shape)))
        at = f"[{','.join(map(str, entry))}]" if entry else ""
        diagonal = bool(definite and entry[0] == entry[1])
        found.setdefault(
            tuple(sorted(places)), NamedEntry(name + at, tuple(sorted(places)), float(array[entry]), diagonal)
        )
    return list(found.values())


def _require_few(labels: Sequence[str]) -> None:
    """Raise ArgumentError for more numbers than any log determines, with the count of each name."""
    if len(labels) > MOST:
        names = [label.partition("[")[0] for label in labels]
        counts = ", ".join(f"{name} {names.count(name)}" for name in dict.fromkeys(names))
        raise ArgumentError(
            f"Argument `parameters` stands for {len(names)} numbers ({counts}), but at most {MOST} are estimated "
            "together: "
            f"name those that matter, or entries such as `{labels[-1]}`."
        )


def _require_sought(positive: Sequence[str], labels: Sequence[str]) -> None:
    for given in positive:
        if given not in {label.partition("[")[0] for label in labels}:
            checks.known(given, labels, "parameter", "Argument `positive`: the estimation")


def _arrays(parameters: Parameters) -> dict[str, tuple[int, np.ndarray]]:
    """Name → (where its numbers begin, array)."""
    found, start = {}, 0
    for path, leaf in jax.tree_util.tree_leaves_with_path(parameters):
        array = np.asarray(leaf, float)
        found[jax.tree_util.keystr(path).lstrip(".")] = (start, array)
        start += array.size
    return found


def _expanded(parameters: Sequence[str], known: dict[str, tuple[int, np.ndarray]]) -> list[str]:
    """The names, with that of a part replaced by those of its parameters that are not all zero."""
    found: list[str] = []
    for text in parameters:
        begins = f"{text}."
        parts = [name for name, (_, array) in known.items() if name.startswith(begins) and np.any(array)]
        found += parts if text not in known and parts else [text]
    return found


def _parsed(text: object, known: dict[str, tuple[int, np.ndarray]]) -> tuple[str, tuple[int, ...] | None]:
    match = _ENTRY.match(text) if isinstance(text, str) else None
    name = match["name"] if match else str(text)
    checks.known(name, known, "parameter", "The system")
    shape = known[name][1].shape
    if match is None or match["index"] is None:
        return name, None
    index = tuple(int(part) for part in match["index"].split(",") if part.strip())
    if len(index) != len(shape) or any(i >= size for i, size in zip(index, shape, strict=True)):
        raise ArgumentError(f"`{text}` is not an entry of `{name}`, which has shape {shape}, counted from 0.")
    return name, index


@dataclass(frozen=True)
class Estimate:
    """One parameter: its estimate, interval and standard error, and the prior value at which the search began."""

    name: str
    value: float
    low: float
    high: float
    standard_error: float
    prior: float

    def covers(self, truth: float) -> bool:
        """Whether the interval holds a value."""
        return self.low <= truth <= self.high
