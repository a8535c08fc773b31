"""Comparison of two runs: their settings, their conserved quantities, and the distance between them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.groups.attitude import zyx
from coadjoint.texts import Table

CONSERVED = (
    "energy_error_max",
    "discrete_energy_error_max",
    "kelvin_noether_error_max",
    "energy_budget_error_max",
    "kelvin_noether_budget_error_max",
    "balance_max",
    "newton_residual_max",
    "group_defect_max",
)
"""Numbers of the certificate that measure the conservation of mechanical quantities."""
SET = ("system", "group", "method", "dt", "steps")
Merits = tuple[float | str | None, float | str | None]
"""A figure of both runs; None of the one that lacks it."""
LEFT_OUT = ("internal_controller_sample", "internal_controller_release", "internal_controller_pending")


@dataclass(frozen=True)
class Comparison:
    """Two runs: `setting` and `conserved` numbers of both, and the differences of variables.

    `final`, `largest`: |x_a − x_b| at the last common time, and over all common times, of every variable that both
    have, with its unit; `common`: the number of common times, `last` the latest of them (s). `merits`: figures of both
    by name (`merits`), such as those of missions and sea trials.
    """

    names: tuple[str, str]
    setting: dict[str, tuple[Any, Any]]
    conserved: dict[str, tuple[float | None, float | None]]
    final: dict[str, float]
    largest: dict[str, float]
    units: dict[str, str]
    common: int
    last: float
    merits: dict[str, Merits] = field(default_factory=dict)

    def summary(self) -> Table:
        """All of it as plain numbers."""
        a, b = self.names
        return {
            "runs": [a, b],
            "setting": {key: list(pair) for key, pair in self.setting.items()},
            "conserved": {key: list(pair) for key, pair in self.conserved.items()},
            "mission": {key: list(pair) for key, pair in self.merits.items()},
            "common_times": self.common,
            "last_common_time": self.last,
            "difference_final": self.final,
            "difference_max": self.largest,
            "units": self.units,
        }


def compare(first: Any, second: Any, names: tuple[str, str] = ("first", "second")) -> Comparison:
    """Compare the datasets of two runs; raises ArgumentError unless they fit.

    They fit if they are of one group with states of one shape, and have times in common.
    """
    for dataset, name in zip((first, second), names, strict=True):
        if "member" in dataset.dims:
            raise ArgumentError(f"{name} holds an ensemble: choose a member of each with dataset.isel(member=0).")
    _require_one_system(first, second, names)
    here, there = _common_times(first, second, names)
    a, b = first.isel(time=here), second.isel(time=there)
    final, largest, units = {}, {}, {}
    for name in map(str, first.data_vars):
        if name not in second or "time" not in first[name].dims or name.startswith(LEFT_OUT):
            continue
        if first[name].shape[1:] != second[name].shape[1:]:
            raise ArgumentError(
                f"Variable `{name}` has shape {first[name].shape[1:]} in {names[0]}, but "
                f"{second[name].shape[1:]} in {names[1]}: the runs are not of one system."
            )
        gap = _gap(name, np.asarray(a[name], dtype=float), np.asarray(b[name], dtype=float))
        final[name], largest[name] = float(gap[-1]), float(np.max(gap))
        units[name] = str(first[name].attrs.get("units", ""))
    return Comparison(
        names,
        {key: (_plain(first.attrs.get(key)), _plain(second.attrs.get(key))) for key in SET},
        {
            key: (_plain(first.attrs.get(key)), _plain(second.attrs.get(key)))
            for key in CONSERVED
            if key in first.attrs or key in second.attrs
        },
        final,
        largest,
        units,
        len(here),
        float(a["time"][-1]),
    )


def merits(first: Table, second: Table) -> dict[str, Merits]:
    """The figures of `mission` in two summaries side by side, those of a sea trial first; "trial.period" joins keys."""
    a, b = (_figures(summary.get("mission", {})) for summary in (first, second))
    names = sorted({**a, **b}, key=lambda name: not name.startswith("trial."))
    return {name: (a.get(name), b.get(name)) for name in names}


def _figures(value: PyTree, name: str = "") -> dict[str, float | str]:
    """The numbers and words in nested tables and lists by their joined names, without computing times."""
    if isinstance(value, (dict, list)):
        inner = value.items() if isinstance(value, dict) else enumerate(value)
        return {
            key: one
            for part, held in inner
            for key, one in _figures(held, f"{name}.{part}" if name else str(part)).items()
        }
    return {name: value} if isinstance(value, (int, float, str)) and name != "times_real_time" else {}


def _require_one_system(first: Any, second: Any, names: tuple[str, str]) -> None:
    groups = [_group(dataset.attrs) for dataset in (first, second)]
    if groups[0] != groups[1]:
        raise ArgumentError(f"{names[0]} is on {groups[0]}, but {names[1]} on {groups[1]}: they cannot be compared.")
    shared = [name for name in ("mu", "q", "n", "x") if name in first and name in second]
    if not shared:
        raise ArgumentError(f"{names[0]} and {names[1]} have no state in common: they cannot be compared.")


def _group(attributes: Any) -> str:
    """The group of a run, and on which side it is invariant, if not on the left."""
    right = ", right-invariant" if attributes.get("invariance") == "right" else ""
    return f"{attributes.get('group', '')}{right}"


def _common_times(first: Any, second: Any, names: tuple[str, str]) -> tuple[np.ndarray, np.ndarray]:
    """The indices of times that both have, up to round-off; raises ArgumentError where there are none but the start."""
    s, t = np.asarray(first["time"]), np.asarray(second["time"])
    near = np.clip(np.searchsorted(t, s), 1, max(len(t) - 1, 1))
    left = near - 1
    best = np.where(
        np.abs(t[left] - s) <= np.abs(t[np.minimum(near, len(t) - 1)] - s), left, np.minimum(near, len(t) - 1)
    )
    same = np.abs(t[best] - s) <= 1e-9 * max(np.max(np.abs(s)), 1e-300)
    here = np.flatnonzero(same)
    if len(here) < 2:
        raise ArgumentError(
            f"{names[0]} (saved every {_spacing(s)} up to {s[-1]:g} s) and {names[1]} (every {_spacing(t)} up to "
            f"{t[-1]:g} s) have {len(here)} saved times in common, too few: choose dt and save_every so that they have."
        )
    return here, best[here]


def _spacing(times: np.ndarray) -> str:
    return f"{np.median(np.diff(times)):g} s" if len(times) > 1 else "no time"


def _gap(name: str, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """|a − b| at each time; of Euler angles the angle of R_aᵀR_b, rad, 2 asin(‖R_a − R_b‖/√8)."""
    difference = a - b
    if name == "euler_angles":
        one, other = (zyx(*np.moveaxis(angles, -1, 0)) for angles in (a, b))
        chord = np.linalg.norm(one - other, axis=(-2, -1)) / np.sqrt(8.0)
        difference = 2 * np.arcsin(np.minimum(chord, 1.0))
    return np.linalg.norm(difference.reshape(len(difference), -1), axis=1)


def _plain(value: object) -> PyTree:
    return value.item() if isinstance(value, np.generic) else value
