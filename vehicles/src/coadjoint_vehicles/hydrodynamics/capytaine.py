"""Added mass from datasets of Capytaine: netCDF files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal

import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.disk import require_file
from coadjoint.errors import FileError
from coadjoint.extending import engine_of
from coadjoint.models.quantities import positive
from coadjoint_vehicles.hydrodynamics.added_mass import computed_added_mass

MODES = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
INFINITE = {"omega": np.inf, "freq": np.inf, "wavenumber": np.inf, "period": 0.0, "wavelength": 0.0}
"""The value of each measure of frequency at infinite frequency."""
DEGREES = ("radiating_dof", "influenced_dof")
SAVE = "capytaine.export_dataset(path, dataset)"


def capytaine_added_mass(
    path: str | os.PathLike[str],
    *,
    axes: PyTree,
    origin: object = (0.0, 0.0, 0.0),
    fluid_density: float | None = None,
    frequency: Literal["infinite", "highest"] = "infinite",
) -> Array:
    """The added mass matrix (6, 6) at infinite frequency of one body, from a netCDF file of Capytaine.

    The file holds added_mass over omega (or period, freq, wavenumber, wavelength), radiating_dof and influenced_dof, in
    SI units for the density rho that it names; the entry at ω = ∞ (period 0) is taken.

    path: the file, netCDF 3 or 4, as `capytaine.export_dataset` writes it. axes: "z_up", the axes of Capytaine for a
    body that looks along x: forward, port, up; "z_down", or the rotation (3, 3) from the axes of the file to those of
    the body. origin: the body's origin in the axes of the file, from the centre of rotation of Roll, Pitch and Yaw,
    (3,) m. fluid_density: ρ, kg/m³, to which the added mass is scaled; by default the rho of the file. frequency:
    "highest" takes the highest frequency of a file that has no infinite one, in its place.
    Returns kg, kg m, kg m² in the axes of the body, for `general_vehicle`. Raises FileError for a file that is not such
    a one, has several bodies, densities or depths, a forward speed, or no infinite frequency; ArgumentError. Warns
    where the mean of A and Aᵀ is more than 1 % away. Source: Capytaine's manual, "Export outputs".
    """
    density = None if fluid_density is None else positive(fluid_density, "fluid_density")
    checks.choice(frequency, "frequency", ("infinite", "highest"))
    source = Path(path)
    dataset = _dataset(source)
    _require_one_body(dataset, source)
    found = _at_frequency(dataset, source, frequency)
    if not np.all(np.isfinite(found)):
        raise FileError(f"The added mass in {source} is not finite at {frequency} frequency: compute that case again.")
    if density is not None:
        found = found * (density / _density(dataset, source))
    return computed_added_mass(found, source, axes, origin)


def _dataset(source: Path) -> Any:
    import xarray

    require_file(source)
    try:
        with xarray.open_dataset(source.absolute(), engine=engine_of(source)) as opened:
            dataset = opened.load()
    except FileError:
        raise
    except Exception as error:
        if source.stat().st_size == 0:
            raise FileError(_empty(source)) from None
        raise FileError(f"The file {source} is not a netCDF file that can be read: write it by {SAVE}.") from error
    if not dataset.variables:
        raise FileError(_empty(source))
    if "added_mass" not in dataset:
        held = ", ".join(sorted(map(str, dataset.data_vars))[:6]) or "nothing"
        raise FileError(
            f"The file {source} holds no added_mass, but {held}: solve radiation problems, not only diffraction."
        )
    if dataset["added_mass"].dtype.kind not in "fiu":
        raise FileError(f"The added_mass in {source} must be real numbers, but is {dataset['added_mass'].dtype}.")
    missing = [name for name in DEGREES if name not in dataset["added_mass"].dims]
    if missing:
        raise FileError(f"The added_mass in {source} has no dimension {missing[0]}: it is not a dataset of Capytaine.")
    return dataset


def _empty(source: Path) -> str:
    return (
        f"The file {source} is empty: writing it was interrupted, as dataset.to_netcdf does with datasets of Capytaine "
        f"3.0. Write it by {SAVE}."
    )


def _require_one_body(dataset: Any, source: Path) -> None:
    """Raise FileError unless there is one body with its six rigid modes, at rest on average."""
    for degree in DEGREES:
        names = [_text(name) for name in np.atleast_1d(dataset[degree].values)]
        joined = ", ".join(names[:8])
        if any("__" in name for name in names) or dataset["added_mass"].sizes.get("body_name", 1) > 1:
            raise FileError(f"The file {source} has several bodies ({degree}: {joined}): compute each body alone.")
        if sorted(names) != sorted(MODES):
            raise FileError(
                f"The {degree} of {source} must be {', '.join(MODES)}, but is {joined}: give the body "
                "dofs=capytaine.rigid_body_dofs(rotation_center=...)."
            )
    if "forward_speed" in dataset and np.any(dataset["forward_speed"].values != 0):
        raise FileError(f"The file {source} was computed with a forward speed: the added mass of a vehicle needs none.")


def _at_frequency(dataset: Any, source: Path, frequency: str) -> Array:
    """A_ij, i the mode that feels the force (influenced) and j the one that moves (radiating)."""
    array = dataset["added_mass"]
    measure = next((name for name in INFINITE if name in array.dims), None)
    if measure is None:
        measure = next((name for name in INFINITE if name in dataset.coords), None)
    if measure is None:
        raise FileError(f"The added_mass in {source} has no omega, period or other frequency.")
    values, wanted = np.atleast_1d(dataset[measure].values), INFINITE[measure]
    if frequency == "highest":
        wanted = np.max(values) if wanted > 0 else np.min(values)
    chosen = np.flatnonzero(values == wanted)
    if len(chosen) == 0:
        raise FileError(
            f"The file {source} has no infinite frequency ({measure} = {INFINITE[measure]:g}), but "
            f"{_range(dataset[measure].values)}: add omega=numpy.inf to the cases that Capytaine solves, or take the "
            'highest in its place by frequency="highest".'
        )
    if len(chosen) > 1:
        raise FileError(f"The file {source} has {measure} = {wanted:g} {len(chosen)} times: keep one of them.")
    if measure in array.dims:
        array = array.isel({measure: int(chosen[0])})
    several = [str(name) for name in array.dims if name not in DEGREES and array.sizes[name] > 1]
    if several:
        raise FileError(
            f"The added_mass in {source} has several values of {several[0]}: keep one by dataset.sel({several[0]}=...)."
        )
    array = array.squeeze([name for name in array.dims if name not in DEGREES]).transpose(*reversed(DEGREES))
    order = [[[_text(name) for name in array[degree].values].index(mode) for mode in MODES] for degree in array.dims]
    return np.asarray(array.values, dtype=float)[np.ix_(*order)]


def _density(dataset: Any, source: Path) -> float:
    rho = dataset["rho"].values if "rho" in dataset else dataset.attrs.get("rho")
    try:
        return float(positive(float(np.asarray(rho).item()), "rho"))
    except (TypeError, ValueError) as error:
        raise FileError(
            f"The file {source} does not name one density rho, so its added mass cannot be scaled: leave out "
            "`fluid_density`."
        ) from error


def _text(name: object) -> str:
    return name.decode() if isinstance(name, bytes) else str(name)


def _range(values: PyTree) -> str:
    flat = np.atleast_1d(values)
    return f"{np.min(flat):g}" if len(flat) == 1 else f"{np.min(flat):g} to {np.max(flat):g}"
