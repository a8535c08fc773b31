"""The figure of the README: the paper's underwater vehicle, its path and its energy error by three methods.

python docs/figures/readme.py        writes docs/figures/vehicle.png
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co

p = co.Parameters(mass=123.8, added_mass=np.diag([65, 70, 75]), inertia=np.diag([5.46, 5.29, 5.72]),
                  net_weight=123.8 * 9.81 - 1215.8, buoyancy=1215.8, center_of_buoyancy=[0, 0, -0.007])  # fmt: skip


def lagrangian(xi, n, nu, a, p):
    kinetic = 0.5 * nu @ (p.mass * nu + p.added_mass @ nu) + 0.5 * xi @ p.inertia @ xi
    return kinetic + p.net_weight * n @ a - p.buoyancy * p.center_of_buoyancy @ a


vehicle = co.System(co.SO3(), lagrangian, additional=co.Defining(), advected=co.Defining(), parameters=p)
start = vehicle.state(q=[0, 0, 1], xi=np.radians([10, 0, 20]), qdot=[0.1, 0.1, 0.8], a0=[0, 0, 1])
methods = {
    "left rectangle, order 1: the paper's": (co.LeftRectangle(start="velocity"), 0.01, "#c44e52"),
    "midpoint, order 2: the default": (co.Midpoint(), 0.01, "#4c72b0"),
    "Suzuki, order 4, at equal work": (co.Suzuki4(co.Midpoint()), 0.05, "#55a868"),
}
plt.rcParams.update({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False})
figure = plt.figure(figsize=(7.4, 2.9), layout="constrained")
space, energy = figure.add_subplot(1, 2, 1, projection="3d"), figure.add_subplot(1, 2, 2)

for label, (method, dt, colour) in methods.items():
    data = co.simulate(vehicle, start, dt=dt, duration=500, method=method, save_every=round(0.5 / dt)).dataset
    # The paper's energy is the discrete one of its own rule; for the others it is that of the nodes.
    E = (data.discrete_energy if label.startswith("left") else data.energy).values
    energy.semilogy(data.time[1:], np.maximum(abs(E[1:] / E[0] - 1), 1e-13), color=colour, linewidth=0.8, label=label)

x, y, z = data.q.values.T
space.plot(x, y, z, color="#4c72b0", linewidth=1.2)
space.plot(x, y, np.full_like(z, z.max()), color="0.6", linewidth=0.8)
space.scatter(*data.q.values[0], color="black", s=12)
space.text(*(data.q.values[0] + [0, 0, -12]), "start", fontsize=7)
space.invert_zaxis()
space.view_init(elev=18, azim=-60)
space.set(xlabel="x (m)", ylabel="y (m)", zlabel="z (m), down", xticks=[0, 25, 50], yticks=[0, 25, 50])
space.set_box_aspect((1, 1, 1.2), zoom=1.05)
energy.set(xlabel="time (s)", ylabel="relative energy error", ylim=(1e-13, 1e1), yticks=10.0 ** np.arange(-13, 0, 2))
energy.legend(frameon=False, loc="upper left", borderaxespad=0.1)
energy.grid(alpha=0.25)
figure.savefig(Path(__file__).with_name("vehicle.png"), dpi=130)
