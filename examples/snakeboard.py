"""A snakeboard: a rider turns a rotor and the wheels in time, and the board goes on without a push from the ground.

Run as: python examples/snakeboard.py [duration in s: 25]
It prints where three gaits lead, and writes snakeboard.png: the paths of the board.

The board moves on SE(2), with the angles n = (ψ, φ) of rotor and wheels held at a gait by a constraint that depends
on time; the axles at both ends turn by φ and −φ, and do not slip sideways: two rows on ξ. Gaits ψ = 1.2 sin kt, φ =
0.6 sin lt with frequencies k : l of 1 : 1 drive, of 2 : 1 turn, of 3 : 2 go sideways. Ostrowski, Lewis, Murray and
Burdick, IEEE Conf. Robotics and Automation (1994) 2391.
"""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 25.0
mass, half, rotor, wheels = 6.0, 0.2, 0.1, 0.001  # kg, m, kg m²; inertias: the board's is m l² − rotor − 2 wheels
board = mass * half**2 - rotor - 2 * wheels


def lagrangian(xi, n, nu, p):
    turning = 0.5 * board * xi[0] ** 2 + 0.5 * rotor * (xi[0] + nu[0]) ** 2
    return turning + wheels * (xi[0] ** 2 + nu[1] ** 2) + 0.5 * mass * (xi[1] ** 2 + xi[2] ** 2)


def axles(n, p):
    s, c = jnp.sin(n[1]), jnp.cos(n[1])
    return jnp.stack([jnp.stack([half * c, -s, c, 0, 0]), jnp.stack([-half * c, s, c, 0, 0])])


def gait(n, p, *, t):
    return n - jnp.stack([1.2 * jnp.sin(p.rotor * t), 0.6 * jnp.sin(p.wheels * t)])


snakeboard = co.System(
    co.SE2(),
    lagrangian,
    additional=co.spaces.Trivial(2),
    parameters={"rotor": 1.0, "wheels": 1.0},
    constraints={"gait": co.Holonomic(gait), "axles": co.Nonholonomic(axles)},
)


def gone(k, l):
    """The run of a gait, from rest."""
    board = snakeboard.replace(rotor=k, wheels=l)
    start = board.project(board.state(q=[0, 0], qdot=[1.2 * k, 0.6 * l]))
    return co.simulate(board, start, dt=0.01, duration=duration, accuracy=False)


figure, axes = plt.subplots(1, 3, figsize=(11, 4))
runs = {"drive": gone(1.0, 1.0), "turn": gone(2.0, 1.0), "park": gone(3.0, 2.0)}
for (name, run), panel in zip(runs.items(), axes, strict=True):
    turn, place = run.records.g
    angle = np.unwrap(np.arctan2(turn[:, 1, 0], turn[:, 0, 0]))
    print(f"{name:6} to x = {place[-1, 0]:.3f} m, y = {place[-1, 1]:.3f} m, turned by {np.degrees(angle[-1]):.1f}°")
    print(f"       slip {run.extrema['constraint_rate'][1]:.0e}; gait within {run.extrema['constraint_gap'][1]:.0e}")
    panel.plot(*place.T)
    panel.plot(*place[0], "o")
    panel.set(xlabel="x (m)", ylabel="y (m)", title=name, aspect="equal")
figure.tight_layout()
figure.savefig("snakeboard.png", dpi=110)
