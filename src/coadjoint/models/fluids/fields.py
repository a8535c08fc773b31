"""Vorticity and stream function of a run by time, latitude and longitude, as datasets for netCDF files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.errors import ArgumentError, shown
from coadjoint.models.fluids.euler import vorticity
from coadjoint.models.fluids.harmonics import on_grid, power_spectrum

if TYPE_CHECKING:
    import xarray


def fields(fluid: Any, run: Any, latitudes: int = 91, longitudes: int = 180) -> xarray.Dataset:
    """Relative vorticity and stream function at the nodes of a run, with their spectra, as an xarray Dataset.

        Δψ = ω,   ½∫|∇ψ|² = Σ_l E_l,   E_l = ½ Σ_m |c_lm|²/(l(l + 1)),   ½∫ω² = Σ_l ½ Σ_m |c_lm|²

    Variables: `vorticity` and `stream_function` (time, latitude, longitude), 1/s, lengths in radii of the sphere;
    `energy_spectrum` and `enstrophy_spectrum` (time, degree), 1/s². Coordinates: time, s; latitude and longitude, in
    degrees north and east; degree. Attributes follow the CF conventions, version 1.11: `fields(…).to_netcdf("run.nc")`.

    fluid: the system that ran. run: what `co.simulate` returned. latitudes, longitudes: of the grid, from 2, by default
    91 and 180. Raises ArgumentError for others, and for an ensemble, of which a member is `run.member(i)`.
    """
    import xarray

    records, dataset = getattr(run, "records", None), getattr(run, "dataset", None)
    if records is None or dataset is None or np.ndim(records.mu) != 2:
        raise ArgumentError(f"Argument `run` must be one run of co.simulate, but is {shown(run)}.")
    c = vorticity(fluid, records)
    degree = np.arange(c.shape[-1])
    squares = np.where(degree > 0, degree * (degree + 1.0), 1.0)
    stream = -c / squares[:, None] * (degree > 0)[:, None]
    latitude, longitude, omega = on_grid(c, latitudes, longitudes)
    psi = on_grid(stream, latitudes, longitudes)[2]
    enstrophy = 0.5 * power_spectrum(c)
    grid, lines = ("time", "latitude", "longitude"), ("time", "degree")
    made = xarray.Dataset(
        {
            "vorticity": (grid, omega, _told("relative vorticity", "s-1")),
            "stream_function": (grid, psi, _told("stream function of the velocity", "s-1")),
            "energy_spectrum": (lines, enstrophy / squares, _told("kinetic energy by degrees", "s-2")),
            "enstrophy_spectrum": (lines, enstrophy, _told("enstrophy by degrees", "s-2")),
        },
        {
            "time": ("time", dataset["time"].values, {"units": "s", "long_name": "time", "axis": "T"}),
            "latitude": ("latitude", np.degrees(latitude), _axis("latitude", "degrees_north", "Y")),
            "longitude": ("longitude", np.degrees(longitude), _axis("longitude", "degrees_east", "X")),
            "degree": ("degree", degree, _told("degree of spherical harmonics", "1")),
        },
    )
    return made.assign_attrs(
        Conventions="CF-1.11",
        title=fluid.name,
        source=f"Zeitlin's model on U({len(degree)}), {dataset.attrs.get('method', '')}".rstrip(", "),
        comment="Lengths are in radii of the sphere.",
    )


def _told(name: str, units: str) -> dict[str, str]:
    return {"long_name": name, "units": units}


def _axis(name: str, units: str, axis: str) -> dict[str, str]:
    return {"standard_name": name, "long_name": name, "units": units, "axis": axis}
