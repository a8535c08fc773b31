"""REMUS 100 dives, turns and comes up by its own controllers, in a current.

Run as: python examples/remus_mission.py [duration in s]
It prints the certificate, the energy that each force put in and how much faster than real time it was, and writes
remus_mission.png (track, depth, attitude, actuators) and remus_energy.png.

Axes are north, east, down; angles are yaw, pitch and roll. Positive stern planes pitch the nose down, positive rudder
turns it to starboard. The controllers take a sample every 0.1 s and hold it; fins and propeller follow with lags.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint_vehicles.remus import remus_100, remus_start

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 300.0

vehicle = remus_100(current=(0.0, 0.2, 0.0))
start = remus_start(vehicle, speed=1.5, revolutions=15.0)
legs = [0.0, 20.0, 100.0, 180.0]  # s
mission = {
    "depth": co.Held(legs, [0.5, 10.0, 10.0, 0.5]),  # m
    "heading": co.Held(legs, np.radians([0.0, 0.0, 90.0, 90.0])),
    "speed": co.Held(legs, [1.5, 1.5, 1.5, 1.5]),  # m/s through the water
}
run = co.simulate(vehicle, start, dt=0.05, duration=duration, inputs=mission)

print(run)
print(f"{duration:g} s took {run.seconds:.3f} s on one core: {duration / run.seconds:,.0f} times faster than real time")
data = run.dataset
t, north, east, depth = data.time, data.q[:, 0], data.q[:, 1], data.q[:, 2]

figure, ((track, dive), (attitude, actuators)) = plt.subplots(2, 2, figsize=(9, 6.5), layout="constrained")
track.plot(east, north)
track.plot(east[0], north[0], "ko", markersize=4)
track.set(xlabel="east (m)", ylabel="north (m)", title="track", aspect="equal", adjustable="datalim")
dive.plot(t, data.inputs_depth, "k--", linewidth=0.8, label="wanted")
dive.plot(t, depth, label="depth")
dive.set(xlabel="time (s)", ylabel="depth (m)", title="depth")
dive.invert_yaxis()
for k, name in enumerate(("yaw", "pitch", "roll")):
    attitude.plot(t, np.degrees(data.euler_angles[:, k]), label=name)
attitude.set(xlabel="time (s)", ylabel="angle (°)", title="attitude")
actuators.plot(t, np.degrees(data.internal_stern_planes), label="stern planes (°)")
actuators.plot(t, np.degrees(data.internal_rudder), label="rudder (°)")
actuators.plot(t, data.internal_propeller, label="propeller (1/s)")
actuators.set(xlabel="time (s)", title="actuators")
for axes in (dive, attitude, actuators):
    axes.legend(frameon=False)
figure.savefig("remus_mission.png", dpi=110)
run.plot.budget(path="remus_energy.png")
