"""BlueROV2 Heavy comes to a station and holds it in a tide that it is not told of, by model predictive control.

Run as: python examples/rov_in_tide.py [duration in s]
The inputs are the eight thrusts, between their limits and with their lag, once in 0.2 s; plans look 4 s ahead. What of
its motion q the last plan did not foresee, q̂, is taken for a current c, with which the next ones count:
    c ← c + (q − q̂) · 4/s.
It prints how far from the station it stays, and writes rov_in_tide.png."""

import sys
from dataclasses import replace

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint.control import Input, Problem, squares
from coadjoint_vehicles import Craft, load
from coadjoint_vehicles.parts.force_curves import Linear
from coadjoint_vehicles.water import TimeCurrent, UniformWater

duration, H, STATION, TURN = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0, 0.2, np.array([0.0, 0.0, 2.0]), 60.0
vehicle = load("bluerov2_heavy_von_benzon")
thrusters = vehicle.part("thrusters")
low, high = thrusters.extremes
by_force = replace(thrusters, curve=Linear(1.0), unit="N", limit=[low, high])  # thrusts instead of pulses
vehicle = replace(vehicle, parts=tuple(by_force if part is thrusters else part for part in vehicle.parts))


def tide(t):
    angle = 2 * jnp.pi * t / TURN
    return 0.3 * jnp.stack([jnp.cos(angle), jnp.sin(angle), 0.0 * angle])


def away(motion, p):
    turned = jnp.ravel(motion.g - jnp.eye(3))
    parts = 6 * (motion.q - STATION), 3 * turned, motion.nu, 0.5 * motion.xi, motion.inputs.thrusters / 40
    return jnp.concatenate(parts)


model, rov = Craft(vehicle, water=UniformWater((0.0, 0.0, 0.0))), Craft(vehicle, water=TimeCurrent(tide))
steering = Problem(
    model.system, model.start(), dt=H, steps=20, inputs={"thrusters": Input((8,), low, high)}, cost=squares(away)
).controller(changing=("water",))  # fmt: skip
begin = rov.start(position=(0.5, -0.3, 2.2), euler_zyx=(0.3, 0.1, 0.0))
stepper = co.Stepper(rov.system, begin, dt=H / 4, inputs={"thrusters": np.zeros(8)})
places = [[steering.names.index(f"{name}") for name in row] for row in
          ([f"g[{i}, {j}]" for i in range(3) for j in range(3)], [f"n[{i}]" for i in range(3)])]  # fmt: skip
found, current, expected = [], np.zeros(3), np.asarray(begin.q)
for _ in range(round(duration / H)):
    state = stepper.state
    current = current + 4.0 * (state.q - expected)
    steering.change(water={"velocity": current})
    answer = steering(state, velocities=True)
    R, n = (answer.nodes[1, place] for place in places)
    expected = R.reshape(3, 3) @ n
    found.append((float(state.t), *(state.q - STATION), *current, *answer.command["thrusters"]))
    stepper.step(answer.command, n=4)
t, off, known, thrusts = np.split(np.array(found), [1, 4, 7], axis=1)
settled = np.linalg.norm(off[t[:, 0] > 10], axis=1)
print(steering)
print(f"after 10 s within {100 * settled.max():.2f} cm of the station")
figure, axes = plt.subplots(3, 1, figsize=(7.2, 7.2), sharex=True, layout="constrained")
for column, name in zip(off.T, ("north", "east", "down"), strict=True):
    axes[0].plot(t, 100 * column, label=name)
axes[0].set(ylabel="off the station (cm)", ylim=(-10, 10))
axes[0].legend(frameon=False)
truth = np.array([tide(time) for time in t[:, 0]])
for k in (0, 1):
    axes[1].plot(t, known[:, k], f"C{k}")
    axes[1].plot(t, truth[:, k], f"C{k}--")
axes[1].set(ylabel="current, true dashed (m/s)")
axes[2].plot(t, thrusts, linewidth=0.8)
axes[2].set(xlabel="time (s)", ylabel="thrusts (N)")
figure.savefig("rov_in_tide.png", dpi=110)
