"""A charged particle in a magnetic field, as free motion on a group of our own: the Heisenberg group.

Run as: python examples/heisenberg.py [duration in s]
It prints the certificate, compares the path with a circle, and writes heisenberg.png.

The algebra has the basis e₁, e₂, e₃ with [e₁, e₂] = e₃. With ℓ = ½ m (ξ₁² + ξ₂²) + ½ I ξ₃² the momentum along e₃ is
conserved and acts as the charge: the particle's shadow in the plane is a circle, run through at the angular speed μ₃/m.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 40.0

heisenberg = co.MatrixGroup(
    [
        [[0, 1, 0], [0, 0, 0], [0, 0, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 0, 0]],
        [[0, 0, 1], [0, 0, 0], [0, 0, 0]],
    ],
    name="Heisenberg",
)


def lagrangian(xi, p):
    return 0.5 * p.mass * (xi[0] ** 2 + xi[1] ** 2) + 0.5 * p.third * xi[2] ** 2


particle = co.System(heisenberg, lagrangian, parameters={"mass": 2.0, "third": 1.0}, name="charged particle")
start = particle.state(xi=[1.0, 0.0, 0.8])
run = co.simulate(particle, start, dt=0.01, duration=duration, method=co.Midpoint(co.Cayley()))
print(run)

# An element is a matrix [[1, x, z], [0, 1, y], [0, 0, 1]].
x, y, z = (run.dataset.g.values[:, i, j] for i, j in ((0, 1), (1, 2), (0, 2)))
charge, mass, speed = 0.8, 2.0, 1.0
angle = charge / mass * run.dataset.time.values
radius = mass * speed / charge
exact = radius * np.stack([np.sin(angle), 1 - np.cos(angle)])
error = np.max(np.abs(np.stack([x, y]) - exact))
print(f"circle of radius {radius:g} m; largest distance from it in time and place {error:.1e} m")

figure, (plane, height) = plt.subplots(1, 2, figsize=(7, 3), layout="constrained")
plane.plot(x, y, linewidth=1)
plane.set(aspect="equal", xlabel="x", ylabel="y", title="shadow in the plane")
height.plot(run.dataset.time, z, linewidth=1)
height.set(xlabel="time (s)", ylabel="z", title="area swept, and the third velocity")
figure.savefig("heisenberg.png", dpi=150)
