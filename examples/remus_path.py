"""REMUS 100 along three legs in a current, by its shipped controllers and by model predictive control.

Run as: python examples/remus_path.py [where it ends, m to the north]
Both know place, attitude and velocities over ground and through the water. `LineOfSight` steers `Cruise` between way
points. The predictive controller chooses fins δ and revolutions n for 8 s, in which it takes the current to stay as it
is; with the distances e beside and f below a path with rounded corners, and the speed u along it,
    min ∫ (3e)² + (2f)² + (u − 1.43)² + |ω|² + (2δ_r/15°)² + (2δ_s/15°)² + ¼(n − 15)² dt.
The other's speed is such that both take as long. It prints the shaft's work ∫ 2πnQ dt and distances from the path,
and writes remus_path.png."""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint.control import Input, Problem, squares
from coadjoint_vehicles import Craft, load, water
from coadjoint_vehicles.controllers import Cruise, LineOfSight

END = float(sys.argv[1]) if len(sys.argv) > 1 else 148.0
POINTS = np.array([(0.0, 0.0, 5.0), (50.0, 50.0, 8.0), (100.0, 0.0, 5.0), (150.0, 50.0, 8.0)])  # m
vehicle, LEGS, FULL, H = load("remus_100"), np.diff(POINTS, axis=0), np.radians(15), 0.25
FIN, TURNS = Input((), -FULL, FULL, rate=1.0), Input((), 5.0, 25.4, rate=5.0, guess=15.0)  # rad, rad/s; 1/s, 1/s²
INPUTS = {"stern_planes": FIN, "rudder": FIN, "propeller": TURNS}
BEGIN = {"position": POINTS[0], "speed": 1.5, "euler_zyx": (np.pi / 4, 0, 0), "actuators": {"propeller": 15.0}}


def current(x, np=jnp):
    return np.stack([0.0 * x[0] - 0.1, 0.35 * np.exp(-(((x[0] - 70) / 30) ** 2)), 0.0 * x[0]])


def errors(motion, p):
    beyond, slopes, u = motion.q[0] - POINTS[1:-1, 0], (LEGS[:, 1:] / LEGS[:, :1]).T, motion.inputs
    root, turns = jnp.sqrt(beyond**2 + 1.2**2), 0.5 * np.diff(slopes)
    slope, path = slopes[:, 0] + turns @ (1 + beyond / root), slopes[:, 0] * motion.q[0] + turns @ (beyond + root)
    beside, below = (motion.q[1:] - POINTS[0, 1:] - path) / jnp.sqrt(1 + slope**2)
    ahead = jnp.append(1.0, slope) @ (motion.g @ motion.nu) / jnp.sqrt(1 + slope @ slope)
    parts = 3 * beside, 2 * below, ahead - 1.43, 2 * u.rudder / FULL, 2 * u.stern_planes / FULL, u.propeller / 2 - 7.5
    return jnp.stack([*parts, *motion.xi])


def judged(craft, inputs):
    r = co.simulate(craft.system, craft.start(**BEGIN), inputs=inputs, **timing).records
    own, last = vehicle.part("propeller"), int(np.argmax(r.q[:, 0] > END))
    q, n = r.q[:last], r.internal.propeller[:last]
    ahead = (1 - own.wake_fraction) * (r.nu[:last, 0] - np.sum(r.g[:last, :, 0].T * current(q.T, np), axis=0))
    torque = vehicle.fluid_density * own.diameter**4 * n * (own.torque[0] * n * own.diameter + own.torque[1] * ahead)
    share = np.clip(np.sum((q[:, None] - POINTS[:-1]) * LEGS, 2) / np.sum(LEGS**2, 1), 0, 1)
    away = np.min(np.linalg.norm(q[:, None] - POINTS[:-1] - share[..., None] * LEGS, axis=2), axis=1)
    return r.t[last], np.trapezoid(2 * np.pi * n * torque, r.t[:last]), away.max(), np.sqrt(np.mean(away**2)), q, away


model, sea = Craft(vehicle, water=water.UniformWater((0.0, 0.0, 0.0))), water.CurrentField(current)
problem = Problem(model.system, model.start(**BEGIN), dt=H, steps=32, inputs=INPUTS, cost=squares(errors))
steering, craft, answers = problem.controller(changing=("water",)), Craft(vehicle, water=sea), []
stepper = co.Stepper(craft.system, craft.start(**BEGIN), dt=0.05, inputs=dict.fromkeys(INPUTS, 0.0))
while stepper.state.q[0] < END + 1:
    steering.change(water={"velocity": current(stepper.state.q, np)})
    answers.append(steering(stepper.state, velocities=True))
    stepper.step(answers[-1].command, n=5)
begins, speed = H * np.arange(len(answers)), 1.5
moved = {name: co.Held(begins - 1e-6, np.array([answer.command[name] for answer in answers])) for name in INPUTS}
timing = {"dt": 0.05, "duration": begins[-1] + 20, "monitors": False, "accuracy": False}
found = {"predictive": judged(craft, moved)}
helm = LineOfSight(way_points=POINTS, look_ahead=3.0, acceptance=6.0, gain=0.4, helm=Cruise(vertical="pitch"))
for _ in range(2):
    found["shipped"] = judged(Craft(vehicle, controller=helm, water=sea), {"speed": speed})
    speed += np.linalg.norm(LEGS[0]) / 50 * END * (1 / found["predictive"][0] - 1 / found["shipped"][0])
figure, (track, off) = plt.subplots(2, 1, figsize=(7.2, 6.4), layout="constrained")
for (name, (took, work, most, rms, q, away)), style in zip(found.items(), ("C0", "C1--"), strict=True):
    print(f"{name}: {took:.2f} s, {work:.0f} J, {rms:.3f} m from the path (RMS), {most:.2f} m at most")
    track.plot(*q[:, :2].T, style)
    off.plot(q[:, 0], away, style, label=name)
track.plot(*POINTS[:, :2].T, "k:")
track.set(xlabel="north (m)", ylabel="east (m)", aspect="equal", xlim=(38, 62), ylim=(42, 51), title="the first corner")
off.set(xlabel="north (m)", ylabel="distance from the path (m)", ylim=(0, None))
off.legend(frameon=False)
figure.savefig("remus_path.png", dpi=110)
