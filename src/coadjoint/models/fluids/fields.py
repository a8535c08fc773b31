"""Vorticity and stream function of a run by time, latitude and longitude, as datasets for netCDF files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint import checks
from coadjoint.errors import ArgumentError
from coadjoint.models.fluids.euler import planetary, size_of
from coadjoint.models.fluids.harmonics import coefficients_of, on_grid, power_spectrum

if TYPE_CHECKING:
    import xarray


SAME = 1e-6
"""How far the energy of fields may be from that of the run, relative to the largest: round-off, also of files."""


def fields(fluid: Any, run: Any, latitudes: int = 91, longitudes: int = 180) -> xarray.Dataset:
    """Relative vorticity and stream function at the nodes of a run, with their spectra, as an xarray Dataset.

        Δψ = ω,   ½∫|∇ψ|² = Σ_l E_l,   E_l = ½ Σ_m |c_lm|²/(l(l + 1)),   ½∫ω² = Σ_l ½ Σ_m |c_lm|²

    Variables: `vorticity` and `stream_function` (time, latitude, longitude), 1/s, lengths in radii of the sphere;
    `energy_spectrum` and `enstrophy_spectrum` (time, degree), 1/s²; of a magnetic or buoyant fluid also `carried`
    (time, latitude, longitude), θ in 1/s or b in 1/s². Coordinates: time, s; latitude and longitude, in degrees north
    and east; degree. Attributes follow the CF conventions, version 1.11: `fields(…).to_netcdf("run.nc")`.

    fluid: the system that ran. run: what `co.simulate` returned, `co.load` of its file or folder, or its dataset; of an
    ensemble that of a member, `ensemble.dataset.isel(member=0)`. latitudes, longitudes: of the grid, from 2, by default
    91 and 180. Raises ArgumentError for others, and for a fluid of another size or rotation than that of the run.
    """
    import xarray

    size, dataset = size_of(fluid), getattr(run, "dataset", run)
    checks.expect(
        isinstance(dataset, xarray.Dataset) and "mu" in dataset and dataset["mu"].dims == ("time", "algebra"),
        run,
        "run",
        "one run of co.simulate, or of co.load, or the dataset of one, as ensemble.dataset.isel(member=0)",
    )
    if dataset.sizes["algebra"] != size**2:
        raise ArgumentError(
            f"Argument `fluid` must be the one that ran, but has N = {size}, and the run N = "
            f"{int(np.sqrt(dataset.sizes['algebra']))}."
        )
    c = coefficients_of(size, dataset["mu"].values - planetary(fluid))
    degree = np.arange(c.shape[-1])
    squares = np.where(degree > 0, degree * (degree + 1.0), 1.0)
    stream = -c / squares[:, None] * (degree > 0)[:, None]
    omega = on_grid(c, latitudes, longitudes)[2]
    psi = on_grid(stream, latitudes, longitudes)[2]
    enstrophy = 0.5 * power_spectrum(c)
    north, east = np.linspace(-90, 90, latitudes), np.arange(longitudes) * 360 / longitudes
    grid, lines = ("time", "latitude", "longitude"), ("time", "degree")
    _require_same(fluid, np.sum(enstrophy / squares, axis=1), dataset)
    made = xarray.Dataset(
        {
            "vorticity": (grid, omega, _attributes("relative vorticity", "s-1")),
            "stream_function": (grid, psi, _attributes("stream function of the velocity", "s-1")),
            "energy_spectrum": (lines, enstrophy / squares, _attributes("kinetic energy by degrees", "s-2")),
            "enstrophy_spectrum": (lines, enstrophy, _attributes("enstrophy by degrees", "s-2")),
        },
        {
            "time": ("time", dataset["time"].values, {"units": "s", "long_name": "time", "axis": "T"}),
            "latitude": ("latitude", north, _axis("latitude", "degrees_north", "Y")),
            "longitude": ("longitude", east, _axis("longitude", "degrees_east", "X")),
            "degree": ("degree", degree, _attributes("degree of spherical harmonics", "1")),
        },
    )
    if "a" in dataset:
        values = on_grid(coefficients_of(size, dataset["a"].values), latitudes, longitudes)[2]
        units = dict(fluid.units).get("a", "").replace("1/s^2", "s-2").replace("1/s", "s-1")
        made["carried"] = grid, values, _attributes("function carried by the flow", units)
    return made.assign_attrs(
        Conventions="CF-1.11",
        title=fluid.name,
        source=f"Zeitlin's model on U({len(degree)}), {dataset.attrs.get('method', '')}".rstrip(", "),
        comment="Lengths are in radii of the sphere.",
    )


def _require_same(fluid: Any, kinetic_energy: np.ndarray, dataset: xarray.Dataset) -> None:
    """Raise ArgumentError where the kinetic energy of fields is not the one that the run observed."""
    if "kinetic_energy" in dataset:
        expected = dataset["kinetic_energy"].values
        if np.max(np.abs(kinetic_energy - expected)) > SAME * np.max(np.abs(expected)):
            raise ArgumentError(
                "Argument `fluid` must be the one that ran, but the kinetic energy of these fields is not that of the "
                f"run: rotation = {fluid.parameters.rotation:g} rad/s is another one."
            )


def _attributes(name: str, units: str) -> dict[str, str]:
    return {"long_name": name, "units": units}


def _axis(name: str, units: str, axis: str) -> dict[str, str]:
    return {"standard_name": name, "long_name": name, "units": units, "axis": axis}
