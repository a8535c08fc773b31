"""Bricard's linkage: six hinges that counting locks, and that move with one freedom, from the reference to turned over.

Run as: python examples/bricard.py [duration in s: 10]
It prints the number of freedoms and how well the loop closes and the energy stays, and writes bricard.png: the
linkage at some times, and the path of the corner that begins at (1, −1, 1).

Five rods of 1 m and 1 kg and the ground along edges of a cube; each hinge is at right angles to both of its rods. 30
rows hold 30 velocities, but one row follows from the others. Benchmark A04 of IFToMM's library: González, Dopico,
Lugrís and Cuadrado, Multibody System Dynamics 16 (2006) 179.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint.models.multibody import Body, Joint, Mechanism

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
P = np.array([(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], float)


def rod(start, end):
    """A slender rod along the first axis of its frame."""
    along = end - start
    across = np.roll(np.abs(along), 1)
    frame = np.stack([along, across, np.cross(along, across)], axis=1)
    return Body(mass=1.0, inertia=(1e-4, 1 / 12, 1 / 12), position=(start + end) / 2, rotation=frame)


names = ["rod_1", "rod_2", "rod_3", "rod_4", "rod_5", "ground"]
ends = [(P[k], P[(k + 1) % 6]) for k in range(6)]
hinges = {}
for k in range(6):
    axis = np.cross(P[k] - P[k - 1], ends[k][1] - P[k])
    hinges[f"hinge_{k}"] = Joint("revolute", names[k - 1], names[k], at=P[k], axis=axis)
linkage = Mechanism(
    bodies={name: rod(*end) for name, end in zip(names[:5], ends, strict=False)},
    joints=hinges,
    gravity=(0, -9.81, 0),
    name="Bricard's linkage",
)
start = linkage.state()
run = co.simulate(linkage.system, start, dt=0.005, duration=duration, accuracy=False)
print(run)

R, centre = run.records.g, run.records.q.reshape(-1, 5, 3)
half = 0.5 * R[..., 0]
first, last = centre - half, centre + half  # the ends of every rod, (time, 5, 3)
loop = np.abs(first[:, 1:] - last[:, :-1]).max()
print(f"{linkage.freedoms(start)} freedom; the rods stay together within {loop:.0e} m")

figure = plt.figure(figsize=(10, 4.5))
left = figure.add_subplot(1, 2, 1, projection="3d")
for k in np.linspace(0, min(len(centre) - 1, 150), 5).astype(int):
    x, y, z = np.concatenate([first[k], last[k, -1:]]).T
    left.plot(z, x, y, "o-", ms=3, label=f"{run.records.t[k]:.2f} s")
left.set(xlabel="z (m)", ylabel="x (m)", zlabel="y (m)", title="the linkage at five times")
left.legend(fontsize=8)
right = figure.add_subplot(1, 2, 2)
for k, axis in enumerate("xyz"):
    right.plot(run.dataset.time, first[:, 3, k], label=axis)
right.set(xlabel="t (s)", ylabel="place (m)", title="path of a corner")
right.legend()
figure.tight_layout()
figure.savefig("bricard.png", dpi=110)
