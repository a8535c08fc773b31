"""A double pendulum: two rods on hinges, let go twice from almost the same place.

Run as: python examples/double_pendulum.py [duration in s: 15]
It prints the certificate and the rate at which the two motions part, and writes double_pendulum.png: the path of the
lower end, the two angles, and the distance between the motions.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint.models.multibody import Body, Joint, Mechanism

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 15.0
LENGTH, APART = 1.0, 1e-8


def rod(height):
    """A slender rod of 1 kg that hangs down, with its mass centre at a height."""
    across = LENGTH**2 / 12
    return Body(mass=1.0, inertia=(across, across, 1e-3), position=(0, 0, height))


pendulum = Mechanism(
    bodies={"upper": rod(-0.5 * LENGTH), "lower": rod(-1.5 * LENGTH)},
    joints={
        "shoulder": Joint("revolute", "ground", "upper", at=(0, 0, 0), axis=(0, 1, 0)),
        "elbow": Joint("revolute", "upper", "lower", at=(0, 0, -LENGTH), axis=(0, 1, 0)),
    },
    name="double pendulum",
)
start = pendulum.state(coordinates={"shoulder": co.each([2.0, 2.0 + APART]), "elbow": 0.5})
run = co.simulate(pendulum.system, start, dt=0.002, duration=duration, save_every=5)
print(run)

angles = pendulum.joint_data(run).transpose("member", "time")
shoulder, elbow = angles.shoulder.values, angles.elbow.values
apart = np.hypot(*(np.diff(angle, axis=0)[0] for angle in (shoulder, elbow)))
time = run.dataset.time.values
early = apart < 0.1
rate = np.polyfit(time[early], np.log(apart[early]), 1)[0]
print(f"two motions that start {APART:.0e} rad apart part as e^({rate:.1f} t/s)")

absolute = shoulder[0] + elbow[0]
x, z = (-LENGTH * (f(shoulder[0]) + f(absolute)) for f in (np.sin, np.cos))
figure, panels = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
panels[0].plot(x, z, lw=0.7)
panels[0].set(xlabel="x (m)", ylabel="z (m)", title="path of the lower end", aspect="equal")
panels[1].plot(time, shoulder[0], label="shoulder")
panels[1].plot(time, elbow[0], label="elbow")
panels[1].set(xlabel="t (s)", ylabel="angle (rad)")
panels[1].legend()
panels[2].semilogy(time, apart)
panels[2].set(xlabel="t (s)", ylabel="distance of the two motions (rad)")
figure.savefig("double_pendulum.png", dpi=110)
