"""Ten thousand REMUS missions at once: how far do errors of the model, of the start and of the current lead apart?

Run as: python examples/remus_fleet.py [duration in s] [members]
Every member has its own drag, fins, weight, start and current. It prints the certificate, statistics over all members
at the end and how much faster than real time they were, and writes remus_fleet.png.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint_vehicles import Craft
from coadjoint_vehicles.controllers import Cruise
from coadjoint_vehicles.water import UniformWater

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 300.0
members = int(sys.argv[2]) if len(sys.argv) > 2 else 10_000
random = np.random.default_rng(1)


def about(value, deviation):
    """A value for each member, normally distributed; the deviation is relative."""
    return co.each(value * (1 + deviation * random.standard_normal(members)))


craft = Craft(vehicles.load("remus_100"), controller=Cruise(), water=UniformWater())
craft = craft.replace(
    mass=about(craft.vehicle.mass, 0.002),  # not quite neutrally buoyant
    hull={"axial_drag": about(0.42, 0.1), "crossflow_drag": about(1.1, 0.1)},
    rudder={"lift_slope": about(3.12, 0.1)},
    stern_planes={"lift_slope": about(3.12, 0.1)},
    water={"velocity": co.each(random.normal((0.0, 0.2, 0.0), (0.05, 0.05, 0.0), (members, 3)))},  # m/s
)
start = craft.start(
    speed=co.each(random.uniform(1.2, 1.8, members)),
    euler_zyx=co.each(np.radians(random.normal(0.0, 3.0, (members, 3)))),
    actuators={"propeller": 15.0},
)
legs = [0.0, 20.0, 100.0, 180.0]  # s
mission = {
    "depth": co.Held(legs, [0.5, 10.0, 10.0, 0.5]),  # m
    "heading": co.Held(legs, np.radians([0.0, 0.0, 90.0, 90.0])),
    "speed": co.Held(legs, [1.5, 1.5, 1.5, 1.5]),  # m/s through the water
}
fleet = co.simulate(craft.system, start, dt=0.05, duration=duration, inputs=mission, save_every=50)

print(fleet)
missions = members * duration / fleet.seconds
print(f"{members:,} missions of {duration:g} s took {fleet.seconds:.3g} s: {missions:,.0f} times faster than real time")
found = fleet.statistics(["q", "euler_angles"])
for statistic in found.statistic.values:
    north, east, depth = found.q.sel(statistic=statistic)[-1].values
    print(f"{statistic:>6}  north {north:8.2f} m  east {east:8.2f} m  depth {depth:6.3f} m")

heading = np.degrees(fleet.dataset.euler_angles[:, :, 0])
hunting = np.abs(heading[:, -20:] - heading[:, -20:].mean("time")).max("time").values > 2.0
slopes = fleet.system.parameters.rudder.lift_slope.values
print(f"{hunting.sum()} of {members:,} hunt about their course by more than 2°", end="")
print(f", with a rudder of {slopes[hunting].max():.2f} per rad or less" if hunting.any() else "")

q = fleet.dataset.q
figure, (track, course) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
track.plot(q[:200, :, 1].T, q[:200, :, 0].T, color="C0", alpha=0.1, linewidth=0.6)
track.plot(found.q.sel(statistic="mean")[:, 1], found.q.sel(statistic="mean")[:, 0], "k")
track.set(xlabel="east (m)", ylabel="north (m)", title="tracks of 200 members, and the mean")
yaw = np.degrees(found.euler_angles[:, :, 0])
for low, high, shade, label in (("min", "max", 0.2, "all"), ("5%", "95%", 0.5, "nine in ten")):
    band = (yaw.sel(statistic=statistic) for statistic in (low, high))
    course.fill_between(found.time, *band, color="C0", alpha=shade, linewidth=0, label=label)
course.plot(found.time, yaw.sel(statistic="50%"), "k", label="median")
course.set(xlabel="time (s)", ylabel="yaw (°)", title="heading")
course.legend(frameon=False)
figure.savefig("remus_fleet.png", dpi=110)
