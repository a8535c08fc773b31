"""The figures of the page on controllers: a path in a current, a slew, and five vehicles on one mission, in a minute.

Run as: python docs/figures/controllers.py; it writes controllers.png and five_controllers.png beside itself.
"""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint_vehicles import Craft
from coadjoint_vehicles.controllers import LineOfSight, Pose
from coadjoint_vehicles.water import UniformWater

HERE = Path(__file__).parent
DT = 0.05
SQUARE = [(0, 0, 2), (120, 0, 6), (120, 120, 10), (0, 120, 6), (0, 0, 2)]
SPEEDS = {"remus_100": 1.5, "nps_auv_ii": 1.5, "lrauv_tethys": 1.0, "rexrov": 0.6, "bluerov2_heavy_von_benzon": 0.5}


def path(gain):
    """REMUS around a square in a current of 0.3 m/s to the east."""
    controller = LineOfSight(way_points=SQUARE, gain=gain)
    craft = Craft(vehicles.load("remus_100"), controller=controller, water=UniformWater((0.0, 0.3, 0.0)))
    start = craft.start(position=(0, 10, 2), speed=1.5, actuators={"propeller": 15.0})
    return co.simulate(craft.system, start, dt=DT, duration=360, inputs={"speed": 1.5}).dataset


def slew():
    """BlueROV2 Heavy level, nearly upside down, nose down and level again."""
    times = [0.0, 5.0, 35.0, 65.0]
    wanted = [np.eye(3), co.attitude.zyx(0, 0, np.radians(179)), co.attitude.zyx(0, -np.pi / 2, 0), np.eye(3)]
    craft = Craft(vehicles.load("bluerov2_heavy_von_benzon"), controller=Pose(weigh=1.0))
    inputs = {"north": 0.0, "east": 0.0, "depth": 5.0, "attitude": co.Held(times, wanted)}
    made = co.simulate(craft.system, craft.start(position=(0, 0, 5)), dt=DT, duration=95, inputs=inputs).dataset
    goals = np.stack(wanted)[np.searchsorted(times, made.time.values + 1e-9, side="right") - 1]
    cosine = (np.einsum("nij,nij->n", made.R.values, goals) - 1) / 2
    return made, np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def mission(name):
    """Down to 10 m, a quarter turn, and up, by the vehicle's own controller."""
    vehicle, legs = vehicles.load(name), [0.0, 20.0, 120.0, 220.0]
    inputs = {
        "depth": co.Held(legs, [1.0, 10.0, 10.0, 1.0]),
        "heading": co.Held(legs, np.radians([0.0, 0.0, 90.0, 90.0])),
        "speed": SPEEDS[name],
    }
    craft = Craft(vehicle, controller=vehicle.controller, water=UniformWater((0.05, 0.1, 0.0)))
    start = craft.start(position=(0, 0, 1), speed=SPEEDS[name])
    return vehicle, co.simulate(craft.system, start, dt=DT, duration=320, inputs=inputs).dataset


def draw_controllers():
    """controllers.png."""
    figure, ((track, beside), (angle, place)) = plt.subplots(2, 2, figsize=(9, 7), layout="constrained")
    for gain, label in ((0.0, "without integral"), (0.2, "with integral")):
        made = path(gain)
        track.plot(made.q[:, 1], made.q[:, 0], label=label)
        first = made.internal_controller_value_memory_leg.values == 0
        beside.plot(made.time[first], made.q[first, 1], label=label)
    corners = np.array(SQUARE)
    track.plot(corners[:, 1], corners[:, 0], "k--o", markersize=3, linewidth=0.8, label="legs")
    track.set(title="line of sight, 0.3 m/s to the east", xlabel="east (m)", ylabel="north (m)", aspect="equal")
    track.legend(frameon=False, fontsize=8)
    beside.axhline(0, color="k", linewidth=0.8)
    beside.set(title="off the first leg", xlabel="time (s)", ylabel="to starboard (m)")
    beside.legend(frameon=False, fontsize=8)
    made, off = slew()
    angle.plot(made.time, off)
    angle.set(title="slews on SO(3): 179° of roll, nose down, level", xlabel="time (s)", ylabel="angle to the goal (°)")
    for k, label in enumerate(("north", "east", "down")):
        place.plot(made.time, made.R[:, k, 2], label=label)
    place.set(title="the vehicle's own down, in space", xlabel="time (s)")
    place.legend(frameon=False, fontsize=8)
    figure.savefig(HERE / "controllers.png", dpi=80)


def draw_five():
    """five_controllers.png."""
    figure, axes = plt.subplots(2, 3, figsize=(10.5, 6.5), layout="constrained")
    track, depth, heading, pitch, speed, turn = axes.ravel()
    for name in SPEEDS:
        vehicle, made = mission(name)
        t, ahead = made.time, made.nu[:, 0]
        track.plot(made.q[:, 1], made.q[:, 0], label=vehicle.name)
        depth.plot(t, made.q[:, 2])
        angles = np.degrees(made.euler_angles)
        for axis, k in ((heading, 0), (pitch, 1), (turn, 2)):
            axis.plot(t, angles[:, k])
        speed.plot(t, ahead)
    track.set(title="track", xlabel="east (m)", ylabel="north (m)", aspect="equal", adjustable="datalim")
    depth.set(title="depth (m)")
    depth.invert_yaxis()
    for axis, title in (
        (heading, "heading (°)"),
        (pitch, "pitch (°)"),
        (turn, "roll (°)"),
        (speed, "speed over ground (m/s)"),
    ):
        axis.set(title=title)
    for axis in (depth, heading, pitch, speed, turn):
        axis.set(xlabel="time (s)")
    figure.legend(loc="outside lower center", ncols=5, frameon=False, fontsize=8)
    figure.savefig(HERE / "five_controllers.png", dpi=80)


if __name__ == "__main__":
    draw_controllers()
    draw_five()
