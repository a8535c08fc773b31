"""Turbulence of an ideal fluid on a sphere: small vortices merge into large ones, and energy goes to large scales.

Run as: python examples/turbulent_sphere.py [duration in s]
It prints the certificate and how well Casimirs are kept, and writes turbulent_sphere.png, turbulent_sphere.gif and
turbulent_sphere.nc.

Zeitlin's model has the vorticity as a matrix of U(N) and the Poisson bracket as a commutator, so that all integrals of
functions of the vorticity have counterparts that are conserved, the eigenvalues of the matrix. A field with its
enstrophy at the degrees 8 to 12 is advected for a third of the time as an ideal fluid. Then viscosity takes what has
come to small scales, and vortices merge: the energy goes to low degrees.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray

import coadjoint as co
from coadjoint.models import fluids
from coadjoint.plotting import sphere

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 12.0
size, degree = 48, 12
fluid = fluids.euler(size)
shares = np.where(np.arange(degree + 1) >= 8, 1.0, 0.0)
start = fluids.start(fluid, fluids.random_vorticity(seed=4, degree=degree, enstrophy=40.0, spectrum=shares))
options = {"dt": 0.01, "save_every": 10, "accuracy": False}
run = co.simulate(fluid, start, duration=duration / 3, method=co.IsospectralMidpoint(), **options)
print(run)
method = fluids.DampedMidpoint(viscosity=1e-3)
viscous = co.simulate(fluid, run.final, duration=2 * duration / 3, method=method, **options)


def eigenvalues(state):
    """Of −iW, in order: all Casimirs."""
    return np.linalg.eigvalsh(-1j * co.groups.complex_form(np.asarray(co.Un(size).hat(state.mu))))


with co.float64():
    change = np.max(np.abs(eigenvalues(run.final) - eigenvalues(start)))
energy = run.relative_change("kinetic_energy")
print(f"as an ideal fluid: largest change of an eigenvalue {change:.1e}, of energy {energy:.1e}")

parts = [fluids.fields(fluid, one) for one in (run, viscous)]
fields = xarray.concat([parts[0], parts[1].isel(time=slice(1, None))], "time", combine_attrs="override")
fields.to_netcdf("turbulent_sphere.nc", engine="h5netcdf")
sphere.animation(fields, "turbulent_sphere.gif", frames=60)

figure = plt.figure(figsize=(8, 4.6), layout="constrained")
times = [0.0, duration / 3, duration]
largest = float(np.max(np.abs(fields.vorticity)))
for place, t in enumerate(times):
    omega = fields.vorticity.sel(time=t, method="nearest")
    axes = figure.add_subplot(2, 2, place + 1, projection="mollweide")
    east = np.radians(np.append(omega.longitude - 180, 180.0))
    values = np.roll(omega.values, omega.longitude.size // 2, axis=1)
    values = np.hstack([values, values[:, :1]])
    mesh = axes.pcolormesh(
        east, np.radians(omega.latitude), values, cmap="RdBu_r", vmin=-largest, vmax=largest, shading="gouraud"
    )
    axes.set(xticklabels=[], yticklabels=[], title=f"vorticity at {t:.3g} s")
figure.colorbar(mesh, ax=figure.axes, shrink=0.5, label="1/s", location="left")
axes = figure.add_subplot(2, 2, 4)
for t in times:
    spectrum = fields.energy_spectrum.sel(time=t, method="nearest")[1:]
    seen = spectrum > 1e-12
    axes.loglog(spectrum.degree[seen], spectrum[seen], linewidth=1, label=f"{t:.3g} s")
axes.xaxis.set_minor_formatter("")
axes.set(xlabel="degree l", ylabel="energy (1/s²)", title="energy by degrees")
axes.legend(fontsize=7)
figure.savefig("turbulent_sphere.png", dpi=150)
