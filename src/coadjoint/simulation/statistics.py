"""What the members of an ensemble do on the whole: mean, standard deviation and quantiles at every node."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray

from coadjoint.errors import ArgumentError

ANGLES = "euler_angles"


def statistics(
    made: xarray.Dataset, variables: str | Sequence[str] | None = None, quantiles: Sequence[float] = (0.05, 0.5, 0.95)
) -> xarray.Dataset:
    """The variables of an ensemble's dataset with a dimension `statistic` in place of `member`.

    Its labels are "mean", "std" (with N − 1), "min", "max" and "5%", "50%", "95%" for quantiles 0.05, 0.5, 0.95.
    Members that have failed do not count from there on; `members` is how many are left at each node, and where
    there are none the statistics are NaN. Euler angles are counted from the mean direction, so that headings about
    south are not torn apart at ±π. Raises ArgumentError for a variable that the dataset does not have, and for numbers
    that are no quantiles.
    """
    if "member" not in made.dims:
        raise ArgumentError("Statistics are over the members of an ensemble, but this dataset has none.")
    names = _known(made, variables)
    wanted = _quantiles(quantiles)
    labels = ["mean", "std", "min", "max", *(f"{100 * q:.12g}%" for q in wanted)]
    mu = np.isfinite(made["mu"].transpose("member", "time", ...).values)
    left = mu.reshape(*mu.shape[:2], -1).all(axis=-1).sum(axis=0)
    found = {}
    for name in names:
        array = made[name].transpose("member", ...)
        values = _angles(array.values, wanted) if name == ANGLES else _rows(array.values, wanted)
        found[name] = (("statistic", *array.dims[1:]), values, array.attrs)
    coordinates = {str(key): value for key, value in made.coords.items() if "member" not in value.dims}
    return xarray.Dataset(found, coords={"statistic": labels, **coordinates}).assign_coords(members=("time", left))


def _known(made: xarray.Dataset, variables: str | Sequence[str] | None) -> list[str]:
    with_members = [str(name) for name, array in made.data_vars.items() if {"member", "time"} <= set(array.dims)]
    if variables is None:
        return with_members
    names = [variables] if isinstance(variables, str) else list(variables)
    for name in names:
        if name not in with_members:
            raise ArgumentError(f"The ensemble has no variable `{name}`; it has: {', '.join(with_members)}.")
    return names


def _quantiles(given: Sequence[float]) -> list[float]:
    found = [float(q) for q in given]
    for q in found:
        if not 0 <= q <= 1:
            raise ArgumentError(f"Argument `quantiles` must hold numbers from 0 to 1, such as 0.95, but holds {q:g}.")
    return found


def _rows(values: np.ndarray, quantiles: list[float]) -> np.ndarray:
    """Statistics over the first axis, (statistic, …), of what is no NaN."""
    good = np.isfinite(values)
    count = good.sum(axis=0)
    if good.all() and len(values) > 1:
        rest = [values.mean(axis=0), values.std(axis=0, ddof=1), values.min(axis=0), values.max(axis=0)]
        return np.stack([*rest, *np.quantile(values, quantiles, axis=0)])
    some = count > 0
    filled = np.where(good | ~some, values, np.nan)
    mean = np.divide(np.where(good, values, 0.0).sum(axis=0), count, out=np.full(count.shape, np.nan), where=some)
    square = np.where(good, values - mean, 0.0) ** 2
    spread = np.divide(square.sum(axis=0), count - 1, out=np.full(count.shape, np.nan), where=count > 1)
    least = np.where(some, np.where(good, values, np.inf).min(axis=0), np.nan)
    most = np.where(some, np.where(good, values, -np.inf).max(axis=0), np.nan)
    inside = np.full((len(quantiles), *count.shape), np.nan)
    if some.any() and quantiles:
        inside[:, some] = np.nanquantile(filled[:, some], quantiles, axis=0)
    return np.stack([mean, np.sqrt(spread), least, most, *inside])


def _angles(values: np.ndarray, quantiles: list[float]) -> np.ndarray:
    """Statistics of angles, counted from their mean direction within half a turn of it."""
    good = np.isfinite(values)
    sine, cosine = (np.where(good, f(values), 0.0).sum(axis=0) for f in (np.sin, np.cos))
    middle = np.arctan2(sine, cosine)
    turned = values - middle
    found = _rows(np.arctan2(np.sin(turned), np.cos(turned)), quantiles)
    found[np.arange(len(found)) != 1] += middle
    return found
