"""Added mass from the numeric output of WAMIT: files `.1`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal

import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import FileError, warn
from coadjoint.models.quantities import positive
from coadjoint.texts import file_text
from coadjoint_vehicles.hydrodynamics.added_mass import computed_added_mass

LARGEST = 16_000_000
"""The most bytes of a file: hundreds of periods of six modes take one megabyte."""
POWER = 3 + np.add.outer([0, 0, 0, 1, 1, 1], [0, 0, 0, 1, 1, 1])
"""k of A = ρLᵏĀ: 3 between forces, 4 between a force and a moment, 5 between moments."""


def wamit_added_mass(
    path: str | os.PathLike[str],
    *,
    length: float,
    fluid_density: float,
    axes: PyTree,
    origin: object = (0.0, 0.0, 0.0),
    infinite_frequency: Literal["zero", "negative"] | None = None,
) -> Array:
    """The added mass matrix (6, 6) at infinite frequency of one body, from a file `.1` of WAMIT.

    Rows are PERIOD I J Ā(I,J) [B̄(I,J)], and A = ρLᵏĀ with k = 3 for I, J ≤ 3, 5 for I, J ≥ 4, 4 otherwise. PERIOD = 0
    is infinite frequency and PERIOD < 0 is zero frequency. Pairs that the file leaves out are zero by symmetry.

    path: the file. length: L, m, ULEN of the geometry file. fluid_density: ρ, kg/m³. axes: "z_up" if the axes of the
    file are forward, port, up; "z_down" if forward, starboard, down; or the rotation (3, 3) from them to the body's.
    origin: the body's origin in the axes of the file, from the point to which its moments refer, (3,) m.
    infinite_frequency: "zero" if PERIOD = 0 marks it, as in WAMIT, "negative" for files that mark it by PERIOD < 0, as
    Capytaine 2.3 and, for some bodies, HAMS write them. By default "zero", with a warning where the file has one limit
    only, so that nothing shows which one it is.
    Returns kg, kg m, kg m² in the axes of the body, for `general_vehicle`. Raises FileError for a file that is not such
    a one, has several bodies, or lets more water move at infinite frequency than at zero; ArgumentError. Warns where
    the mean of A and Aᵀ is more than 1 % away. Source: WAMIT user manual, chapter 4.
    """
    if infinite_frequency is not None:
        checks.choice(infinite_frequency, "infinite_frequency", ("zero", "negative"))
    L, density = positive(length, "length"), positive(fluid_density, "fluid_density")
    source = Path(path)
    rows = _rows(source)
    zero_period = _entries(rows, source, lambda period: period == 0)
    negative_period = _entries(rows, source, lambda period: period < 0)
    infinite, steady = zero_period, negative_period
    if infinite_frequency == "negative":
        infinite, steady = steady, infinite
    if not infinite:
        sign = "< 0" if infinite_frequency == "negative" else "= 0"
        raise FileError(
            f"The file {source} has no rows at infinite frequency (PERIOD {sign}), only {_periods(rows)}: add it to "
            "the periods that the program computes."
        )
    found = _matrix(infinite, source)
    if steady:
        _require_order(found, _matrix(steady, source), source)
    elif infinite_frequency is None:
        warn(
            f"The file {source} has rows at PERIOD = 0 but none at PERIOD < 0, so that nothing shows whether they are "
            "of infinite frequency, as WAMIT writes them, or of zero frequency, as Capytaine 2.3 and HAMS may; they "
            'are taken as infinite. If that is known, pass infinite_frequency="zero"; otherwise compute both limits.',
            stacklevel=2,
        )
    return computed_added_mass(density * L**POWER * found, source, axes, origin)


Row = tuple[int, float, int, int, float]
"""Line, PERIOD, I, J, Ā(I,J)."""


def _rows(source: Path) -> list[Row]:
    """The rows of the file, after an optional header line."""
    lines = file_text(source, most=LARGEST).splitlines()
    split = [(number, line.split()) for number, line in enumerate(lines, start=1) if line.strip()]
    if split and not _is_number(split[0][1][0]):
        split = split[1:]
    if not split:
        raise FileError(f"The file {source} has no rows PERIOD I J A(I,J).")
    return [_row(number, words, source) for number, words in split]


def _row(number: int, words: list[str], source: Path) -> Row:
    where = f"Line {number} of {source}"
    if len(words) not in (4, 5):
        raise FileError(
            f"{where} must hold PERIOD I J A(I,J), and B(I,J) at finite periods, but holds {len(words)} columns: is "
            "it a file `.1`?"
        )
    if not all(_is_number(word) for word in words):
        raise FileError(f"{where} must hold numbers only, but holds {' '.join(words)!r}.")
    period, i, j, value = (_number(word) for word in words[:4])
    if not np.all(np.isfinite([period, i, j, value])):
        raise FileError(f"{where} must hold finite numbers, but holds {' '.join(words)!r}.")
    if i != int(i) or j != int(j) or i < 1 or j < 1:
        raise FileError(
            f"{where} must hold modes from 1 to 6 in its columns I and J, but holds {words[1]} and {words[2]}."
        )
    if max(i, j) > 6:
        raise FileError(
            f"{where} holds mode {int(max(i, j))}: the file has several bodies or generalized modes. Compute the body "
            "alone with its six rigid modes."
        )
    return number, period, int(i), int(j), value


def _number(word: str) -> float:
    """A number as Fortran writes it: 1.0D-03 is 0.001."""
    return float(word.upper().replace("D", "E"))


def _is_number(word: str) -> bool:
    try:
        _number(word)
    except ValueError:
        return False
    return True


def _entries(rows: list[Row], source: Path, chosen: Any) -> dict[tuple[int, int], float]:
    """Ā(I,J) of the rows whose period is chosen."""
    found: dict[tuple[int, int], float] = {}
    for number, period, i, j, value in rows:
        if not chosen(period):
            continue
        if (i, j) in found:
            raise FileError(f"Line {number} of {source} gives A({i},{j}) at PERIOD = {period:g} for the second time.")
        found[i, j] = value
    return found


def _matrix(entries: dict[tuple[int, int], float], source: Path) -> Array:
    missing = [i for i in range(1, 7) if (i, i) not in entries]
    if missing:
        raise FileError(
            f"The file {source} gives no A({missing[0]},{missing[0]}) at a limiting frequency, only "
            f"{len(entries)} entries: compute all six modes."
        )
    alone = [(i, j) for i, j in entries if (j, i) not in entries]
    if alone:
        i, j = alone[0]
        raise FileError(f"The file {source} gives A({i},{j}), but not A({j},{i}): one of the rows is lost.")
    found = np.zeros((6, 6))
    for (i, j), value in entries.items():
        found[i - 1, j - 1] = value
    return found


def _require_order(infinite: Array, steady: Array, source: Path) -> None:
    """A(0) − A(∞) = (2/π)∫B(ω)/ω² dω has no negative diagonal, since waves only take energy (Ogilvie 1964)."""
    difference = np.trace((steady - infinite)[:3, :3])
    if difference < -1e-3 * np.trace(infinite[:3, :3]):
        raise FileError(
            f"The file {source} lets more water move at infinite frequency than at zero, which no body does: the two "
            "are exchanged. Where PERIOD < 0 marks infinite frequency, as in files of Capytaine 2.3 and HAMS, pass "
            'infinite_frequency="negative"; WAMIT and Capytaine 3.0 mark it by 0: "zero".'
        )


def _periods(rows: list[Row]) -> str:
    periods = sorted({period for _, period, *_ in rows})
    shown = ", ".join(f"{period:g}" for period in periods[:4])
    return f"PERIOD = {shown}" + (f" and {len(periods) - 4} more" if len(periods) > 4 else "")
