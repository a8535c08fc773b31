"""A soft rod that is clamped at one end and falls from the horizontal, as a chain on SE(2)^24.

Run as: python examples/falling_rod.py [duration in s]
It prints the certificate, compares the rod at rest with its run, and writes falling_rod.png.

Each of the 24 elements bends, shears and stretches; they are coupled one to the next, and the steps are solved by that.
The first end stays in its wall by an element that joins it to the ground. Without damping the energy stays, and the rod
swings about the shape in which it hangs at rest.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint.models import rods

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 0.6

# Rubber, 60 cm long and 2 cm thick.
section = rods.round_section(radius=0.01, density=1100.0, young=5e6, shear=5e6 / 3)
plane = {name: section[name] for name in ("EI", "EA", "GA", "mass")} | {"inertia": section["inertia"][2]}
rod = rods.planar(**plane, elements=24, length=0.6, ends="clamped", gravity=9.81)
start = rods.planar_start(rod)
run = co.simulate(rod, start, dt=0.001, duration=duration, accuracy=False)
print(run)

hanging = rods.equilibrium(rod, rods.planar_start(rod, curvature=-2.0))
print(f"at rest its end is {-rods.centerline(hanging)[-1, 1]:.3f} m below the wall")

figure, (plane, height) = plt.subplots(1, 2, figsize=(7.5, 3.2), layout="constrained")
paths, times = rods.centerline(run.records), run.dataset.time.values
for k in np.linspace(0, len(times) - 1, 9).astype(int):
    x, y = np.concatenate([[[0.0, 0.0]], paths[k]]).T
    plane.plot(x, y, color=plt.get_cmap("viridis")(0.9 * k / len(times)), linewidth=1.5)
plane.plot(*np.concatenate([[[0.0, 0.0]], rods.centerline(hanging)]).T, "k--", linewidth=1, label="at rest")
plane.set(aspect="equal", xlabel="x (m)", ylabel="y (m)", title=f"every {times[-1] / 8:.3g} s")
plane.legend()
height.plot(times, paths[:, -1, 1], label="end")
height.plot(times, paths[:, 11, 1], label="middle")
height.set(xlabel="time (s)", ylabel="height (m)")
height.legend()
figure.savefig("falling_rod.png", dpi=150)
