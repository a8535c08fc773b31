"""A thousand plates that fall in water: a body on SE(2) with two advected vectors, as a fleet.

Run as: python examples/falling_plates.py [duration in s]
It prints the certificate of the fleet and writes falling_plates.png: paths, and how far each spin carries a plate.

Each plate moves more easily along its chord than across it, weighs a little more than the water, and carries a magnet
in a uniform field. `up = g⁻¹(0, 1, 0)` is a covector whose last entry is the height of the plate's origin, and
`field = g⁻¹(b, 0)` a direction. Gravity breaks all symmetries but the horizontal translation.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 8.0
plates = 1000


def lagrangian(xi, a, p):
    spin, v = xi[0], xi[1:]
    kinetic = 0.5 * p.inertia * spin**2 + 0.5 * v @ p.masses @ v
    return kinetic - p.weight * p.center @ a.up + p.magnet @ a.field


plate = co.System(
    co.SE2(),
    lagrangian,
    advected={"up": co.spaces.Dual(), "field": co.Defining()},
    parameters={
        "inertia": 0.2,
        "masses": np.diag([1.2, 4.0]),
        "weight": 0.6,
        "center": [0.02, 0, 1],
        "magnet": [0, 0.1, 0],
    },
    name="plate",
)
spins = np.linspace(-3, 3, plates)
thrown = np.stack([spins, np.ones(plates), np.zeros(plates)], axis=1)
start = plate.state(xi=co.each(thrown), a0={"up": [0, 1, 0], "field": [1, 0, 0]})
fleet = co.simulate(plate, start, dt=0.01, duration=duration, save_every=5)
print(fleet)

paths = fleet.dataset.x.transpose("member", "time", ...).values
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 4), layout="constrained")
for k in range(0, plates, 25):
    left.plot(*paths[k].T, color=plt.cm.viridis(k / plates), linewidth=0.8)
left.set(xlabel="x (m)", ylabel="y (m)", title="paths", aspect="equal")
right.scatter(spins, paths[:, -1, 0], c=np.arange(plates), s=3)
right.set(xlabel="spin at the start (rad/s)", ylabel=f"x after {duration:g} s (m)", title="where they are")
figure.savefig("falling_plates.png", dpi=150)
