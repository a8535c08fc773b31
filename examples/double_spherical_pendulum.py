"""A double spherical pendulum: two bobs on strings, chaotic when let go, and on a cone when they turn together.

Run as: python examples/double_spherical_pendulum.py [duration in s: 20]
It prints what is conserved, and how far the bobs leave their cone, and writes double_spherical_pendulum.png: the path
of the lower bob from above and from the side, and the changes of energy and vertical momentum.

The strings are two constraints of the kind `distance`. Steady motion at the rate Ω with the angles θ₁, θ₂ of the
strings: g tan θ₂ = Ω²(l₁ sin θ₁ + l₂ sin θ₂), (m₁ + m₂)g tan θ₁ − m₂g tan θ₂ = m₁Ω²l₁ sin θ₁. Marsden and Scheurle,
ZAMP 44 (1993) 17, study its stability.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import fsolve

import coadjoint as co
from coadjoint.models.multibody import Body, Joint, Mechanism

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
g, m1, m2, l1, l2, rate = 9.81, 1.0, 0.6, 0.8, 0.6, 4.5


def bob(mass, position):
    return Body(mass=mass, inertia=3 * (0.4 * mass * 0.05**2,), position=position)


pendulum = Mechanism(
    bodies={"upper": bob(m1, (0, 0, -l1)), "lower": bob(m2, (0, 0, -l1 - l2))},
    joints={
        "first": Joint("distance", "ground", "upper", at=(0, 0, 0), to=(0, 0, -l1)),
        "second": Joint("distance", "upper", "lower", at=(0, 0, -l1), to=(0, 0, -l1 - l2)),
    },
    name="double spherical pendulum",
)


def begun(angles, turning):
    """The state with both strings in a plane at angles to the vertical, that turns."""
    down = np.array([[np.sin(x), 0, -np.cos(x)] for x in angles])
    places = np.cumsum([l1 * down[0], l2 * down[1]], axis=0)
    moving = np.cross([0, 0, turning], places)
    names = ("upper", "lower")
    return pendulum.state(
        poses={name: (np.eye(3), x) for name, x in zip(names, places, strict=True)},
        velocities=dict(zip(names, moving, strict=True)),
    )


def off_cone(x):
    s, t = np.sin(x), np.tan(x)
    return g * t[1] - rate**2 * (l1 * s[0] + l2 * s[1]), (m1 + m2) * g * t[0] - m2 * g * t[1] - m1 * rate**2 * l1 * s[0]


given = {"dt": 0.01, "duration": duration, "method": co.Suzuki4(co.Midpoint())}
cone = co.simulate(pendulum.system, begun(fsolve(off_cone, (0.9, 1.0)), rate), **given)
run = co.simulate(pendulum.system, begun((1.2, -0.9), 1.5), **given)
print(run)
height = cone.records.q.reshape(-1, 2, 3)[:, :, 2]
print(f"on the cone the heights stay within {np.ptp(height, axis=0).max():.1e} m")

q, qdot = (run.dataset[name].values.reshape(-1, 2, 3) for name in ("q", "qdot"))
momentum = np.cross(q, qdot)[:, :, 2] @ [m1, m2]
print(f"vertical momentum stays within {np.ptp(momentum) / abs(momentum[0]):.0e}")
figure, panels = plt.subplots(1, 3, figsize=(13, 4))
panels[0].plot(q[:, 1, 0], q[:, 1, 1], lw=0.7)
panels[0].set(xlabel="x (m)", ylabel="y (m)", title="from above", aspect="equal")
panels[1].plot(q[:, 1, 0], q[:, 1, 2], lw=0.7)
panels[1].set(xlabel="x (m)", ylabel="z (m)", title="from the side", aspect="equal")
energy = run.dataset.energy.values
panels[2].semilogy(run.dataset.time, np.abs(energy / energy[0] - 1) + 1e-17, label="energy")
panels[2].semilogy(run.dataset.time, np.abs(momentum / momentum[0] - 1) + 1e-17, label="vertical momentum")
panels[2].set(xlabel="t (s)", title="relative changes")
panels[2].legend()
figure.tight_layout()
figure.savefig("double_spherical_pendulum.png", dpi=110)
