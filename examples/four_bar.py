"""A four-bar linkage that a motor turns: its loop closes at every node, and the force in its joints is data.

Run as: python examples/four_bar.py [duration in s: 2]
It prints how far the loop is from its closed form, and writes four_bar.png: the paths of the joints in the plane, and
the force that the hinge between crank and coupler carries.

Crank, coupler and rocker are three bodies on four hinges, with 20 rows for 18 velocities: three rows follow from
others, and one freedom is left. Closed form: the ends of crank and rocker, from their angles, are the length of the
coupler apart.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint.models.multibody import Body, Joint, Mechanism

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 2.0
A, B, C, D = np.array([(0, 0, 0), (0, 0, 0.3), (0.75, 0, 0.6), (0.9, 0, 0)])


def bar(start, end):
    """A slender bar of 1 kg between two points, along the first axis of its frame."""
    length = np.linalg.norm(end - start)
    along, across = (end - start) / length, np.array([0, 1, 0])
    frame = np.stack([along, across, np.cross(along, across)], axis=1)
    inertia = (0.001, length**2 / 12, length**2 / 12)
    return Body(mass=1.0, inertia=inertia, position=(start + end) / 2, rotation=frame)


def hinge(first, second, at, **options):
    return Joint("revolute", first, second, at=at, axis=(0, 1, 0), **options)


linkage = Mechanism(
    bodies={"crank": bar(A, B), "coupler": bar(B, C), "rocker": bar(C, D)},
    joints={
        "drive": hinge("ground", "crank", A, motor=True),
        "knee": hinge("crank", "coupler", B),
        "elbow": hinge("coupler", "rocker", C),
        "pivot": hinge("ground", "rocker", D),
    },
    name="four-bar linkage",
)
start = linkage.state(coordinates={"drive": 0.4}, speeds={"drive": 6.0})
run = co.simulate(linkage.system, start, dt=0.005, duration=duration, inputs={"drive": 0.2}, accuracy=False)
print(run)


def turned(angle, point, about):
    """A point of the plane, (time, 3), turned about y by angles (time,)."""
    x, z = point[0] - about[0], point[2] - about[2]
    c, s = np.cos(angle), np.sin(angle)
    return about + np.stack([x * c + z * s, 0 * c, z * c - x * s], axis=1)


angles = linkage.joint_data(run)
knee, elbow = turned(angles.drive.values, B, A), turned(angles.pivot.values, C, D)
opening = np.abs(np.linalg.norm(elbow - knee, axis=1) - np.linalg.norm(C - B))
print(f"{linkage.freedoms(start)} freedom; the crank turns {angles.drive.values[-1] / (2 * np.pi):.2f} times")
print(f"the loop closes within {opening.max():.0e} m")

force = np.linalg.norm(run.dataset.reaction_knee.values[:, :3], axis=1)
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4))
for name, path in (("knee", knee), ("elbow", elbow)):
    left.plot(path[:, 0], path[:, 2], label=name)
left.plot(*np.stack([A, B, C, D])[:, [0, 2]].T, "o-", color="grey", label="reference")
left.set(xlabel="x (m)", ylabel="z (m)", aspect="equal", title="paths of the joints")
left.legend()
right.plot(run.dataset.time, force)
right.set(xlabel="t (s)", ylabel="force (N)", title="reaction between crank and coupler")
figure.tight_layout()
figure.savefig("four_bar.png", dpi=110)
