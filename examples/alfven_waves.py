"""Alfvén waves of a magnetic fluid on the sphere: their frequencies, and how flow and field exchange energy.

Run as: python examples/alfven_waves.py [duration in s]
It prints measured frequencies beside those in closed form, and writes alfven_waves.png.

The field of θ = b cos ϑ runs along the circles of latitude. A small vorticity of degree l and order m on it swings with
the frequency m b √(1 − 2/(l(l + 1))), exactly so for matrices of every size N > l. All degrees swing in one run here,
each so small that it does not see the others.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint.models import fluids

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 12.0

strength, size, order, degrees = 1.0, 10, 1, np.arange(2, 9)
fluid = fluids.magnetohydrodynamics(size)
fluid = fluid.watching(co.mechanics.trace_casimirs(fluid, degree=3))

field = np.zeros((2, 2), complex)
field[1, 0] = strength * np.sqrt(4 * np.pi / 3)
waves = np.zeros((size, size), complex)
waves[degrees, order] = 1e-5
start = fluids.carrying_start(fluid, waves, field)
run = co.simulate(fluid, start, dt=0.01, duration=duration, method=co.IsospectralMidpoint(), accuracy=False)
print(run)

# Of a swinging number, c(t + τ) + c(t − τ) = 2 cos(ωτ) c(t).
time = run.dataset.time.values
c = np.real(fluids.vorticity(fluid, run.records)[:, degrees, order]) / 1e-5
shift = 40
middle, ends = c[shift:-shift], c[2 * shift :] + c[: -2 * shift]
cosine = np.sum(ends * middle, axis=0) / (2 * np.sum(middle**2, axis=0))
measured = np.arccos(cosine) / (time[shift] - time[0])
exact = order * strength * np.sqrt(1 - 2 / (degrees * (degrees + 1)))
for degree, one, other in zip(degrees, measured, exact, strict=True):
    print(f"degree {degree}: {one:.6f} rad/s, in closed form {other:.6f} rad/s")
error = np.max(np.abs(measured / exact - 1))
casimirs = max(np.ptp(run.dataset[name].values) for name in ("trace_a_2", "trace_a_3", "trace_mu_a_2"))
print(f"largest relative error {error:.1e}; Casimir functions change by {casimirs:.1e} at most")

magnetic = run.dataset.magnetic_energy.values
figure, (dispersion, swings, energies) = plt.subplots(1, 3, figsize=(10, 3), layout="constrained")
fine = np.linspace(1.9, 8.2, 100)
dispersion.plot(fine, order * strength * np.sqrt(1 - 2 / (fine * (fine + 1))), linewidth=1, label="closed form")
dispersion.plot(degrees, measured, "o", label="measured")
dispersion.set(xlabel="degree l", ylabel="frequency (rad/s)", title="dispersion, m = 1")
dispersion.legend()
for degree in (2, 3, 8):
    swings.plot(time, c[:, degree - 2], linewidth=1, label=f"l = {degree}")
swings.set(xlabel="time (s)", ylabel="vorticity, relative", title="each degree swings", ylim=(-1.1, 1.6))
swings.legend(loc="upper center", ncols=3, frameon=False, handlelength=1, columnspacing=1)
energies.plot(time, run.dataset.kinetic_energy.values * 1e10, linewidth=1, label="flow")
energies.plot(time, (magnetic - magnetic[0]) * 1e10, linewidth=1, label="field, gained")
energies.set(xlabel="time (s)", ylabel="energy (1e-10 /s²)", title="flow and field", ylim=(-0.02, 0.5))
energies.legend(loc="upper center", ncols=2, frameon=False)
figure.savefig("alfven_waves.png", dpi=150)
