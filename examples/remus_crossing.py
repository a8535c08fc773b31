"""REMUS 100 crosses a jet to a place upstream, once in the least time and once with the least energy.

Run as: python examples/remus_crossing.py [number of steps]
The steps of the whole vehicle, with hull, fins, propeller and their lags, are the constraints; its commands and the
duration are chosen. The current goes east, c = 1.2 exp(−((x − 50)/20)² − z/12) m/s; the depth z stays between 4 m and
12 m, and clear of a round column. The energy is that of the shaft, and 20 W for all else:
    min ∫ (2πn Q + 20 W) dt,    Q = ρD⁵ (K_Q0 n² + K_Q1 n V_a/D).
It prints both, and how far from the goal the commands end with finer steps, and writes remus_crossing.png."""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.control import Bounds, Input, Problem
from coadjoint_vehicles import water

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 160
GOAL, COLUMN, RADIUS, DEPTHS = np.array([100.0, -12.0, 8.0]), np.array([52.0, -14.0]), 8.0, (4.0, 12.0)  # m
LIMITS = {"stern_planes": (-0.26, 0.26), "rudder": (-0.26, 0.26), "propeller": (1.0, 25.4)}  # rad, rad, 1/s


def jet(place):
    return jnp.stack([0.0, 1.2 * jnp.exp(-(((place[0] - 50) / 20) ** 2) - place[2] / 12), 0.0])


def power(motion, p):
    own, n = p.propeller, motion.internal.propeller
    ahead = (1 - own.wake_fraction) * (motion.nu - motion.g.T @ jet(motion.q))[0]
    torque = p.fluid_density * own.diameter**5 * (own.torque[0] * n**2 + own.torque[1] * n * ahead / own.diameter)
    return 2 * jnp.pi * n * torque + 20.0


def fins(motion):
    return 0.1 * (motion.inputs.rudder**2 + motion.inputs.stern_planes**2)  # so that there is one best use of them


vehicle, sea = vehicles.load("remus_100"), water.CurrentField(jet)
craft, piloted = (vehicles.Craft(vehicle, controller=pilot, water=sea) for pilot in (None, vehicle.controller))
system = craft.system.watching({"watts": lambda state, p: power(craft.system.motion_at(state), p)})
begin = {"position": (0, 0, 8), "speed": 1.5, "euler_zyx": (-0.2, 0, 0), "actuators": {"propeller": 15.0}}
start, few = craft.start(**begin), {"dt": 45.0 / steps, "steps": steps, "monitors": False, "accuracy": False}
# The solver begins with the fins and revolutions by which the vehicle's own controller keeps the bow on the goal.
told = {"depth": co.Held([0.0], [8.0]), "speed": co.Held([0.0], [2.2]),
        "heading": lambda motion: jnp.arctan2(GOAL[1] - motion.q[1], GOAL[0] - motion.q[0])}  # fmt: skip
run = co.simulate(piloted.system, piloted.start(**begin), inputs=told, **few).records
moved = {name: co.Held(run.t[:-1], getattr(run.internal, name)[1:]) for name in LIMITS}
best = co.simulate(system, start, inputs=moved, **few)
around = Bounds(lambda motion, p: jnp.sum((motion.q[:2] - COLUMN) ** 2) / RADIUS**2, 1.0)
costs = {"least time": lambda m, p: 1.0 + fins(m), "least energy": lambda m, p: power(m, p) / 100 + fins(m)}
figure, (track, dive, turns) = plt.subplots(3, 1, figsize=(7.2, 7.2), layout="constrained")
found = {}
for name, cost in costs.items():
    optimum = Problem(
        system, start, dt=float(best.records.t[1]), steps=steps, free_duration=(30.0, 120.0), cost=cost,
        inputs={key: Input((), *limits) for key, limits in LIMITS.items()}, end=lambda motion, p: motion.q - GOAL,
        path={"depth": Bounds(lambda motion, p: motion.q[2], *DEPTHS), "clear of the column": around},
    ).solve(guess=best, tolerance=1e-6, options={"ipopt": {"mu_init": 1e-3}})  # fmt: skip
    best = optimum.run
    t, data = best.records.t, best.dataset
    held = {key: co.Held(t[:-1] - 1e-6, value) for key, value in optimum.inputs.items()}
    finer = co.simulate(system, start, dt=t[1] / 16, steps=16 * steps, inputs=held, monitors=False).records.q[-1]
    found[name] = t[-1], np.trapezoid(data.watts.values, t), np.linalg.norm(finer - GOAL), best.records.q
    print("{}: {:.2f} s, {:.0f} J; finer steps end {:.3f} m from the goal".format(name, *found[name][:3]))
    track.plot(*best.records.q[:, :2].T)
    dive.plot(*best.records.q[:, ::2].T, label=f"{name}: {t[-1]:.0f} s, {found[name][1] / 1000:.1f} kJ")
    turns.plot(t, 60 * best.records.internal.propeller)
x, y = np.meshgrid(np.linspace(0, 102, 103), [-24, 3])
shades = track.pcolormesh(x, y, 1.2 * np.exp(-(((x - 50) / 20) ** 2) - 8 / 12), cmap="Blues", shading="gouraud", vmax=1)
figure.colorbar(shades, ax=track, label="current at 8 m (m/s)", shrink=0.8)
track.fill(*(COLUMN[:, None] + RADIUS * np.array([np.cos(angles := np.linspace(0, 2 * np.pi)), np.sin(angles)])), "0.5")
track.plot(*GOAL[:2], "k*", markersize=9)
track.set(xlabel="north (m)", ylabel="east (m)", aspect="equal", ylim=(3, -24))
dive.set(xlabel="north (m)", ylabel="depth (m)", ylim=(12.5, 7))
dive.legend(frameon=False, loc="upper center")
turns.set(xlabel="time (s)", ylabel="propeller (rpm)", ylim=(0, 1600))
figure.savefig("remus_crossing.png", dpi=110)
