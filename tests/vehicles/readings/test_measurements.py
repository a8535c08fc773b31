"""Readings of runs go into filters: what a filter expects of a sensor is what the sensor reads."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

import coadjoint as co
from coadjoint.estimation import Filter, ModelProcess, RandomWalk
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint_vehicles.parts import Damping, Thrusters
from coadjoint_vehicles.readings import kinematics, readings
from coadjoint_vehicles.sensors import Compass, Depth, Dvl, Errors, Gps, Imu, Usbl, measurement

H = 0.1
COMMANDS: Any = {"push": [9.0]}
IMU = Imu(
    name="imu", rate=10, position=(0.3, 0.05, -0.1), euler_zyx=(0.1, 0, 0),
    gyroscope=Errors(noise=0.002, turn_on_bias=0.01), accelerometer=Errors(noise=0.01, turn_on_bias=0.02),
)  # fmt: skip
SENSORS = (
    Dvl(name="dvl", rate=5, velocity=Errors(noise=0.01), position=(0.2, 0, 0), latency=0.3),
    Dvl(name="through", rate=5, velocity=Errors(noise=0.01), track="water"),
    Depth(name="pressure", rate=2, depth=Errors(noise=0.02), density=1025.0, position=(-0.4, 0, 0)),
    Compass(name="compass", rate=2, heading=Errors(noise=0.02), declination=0.1),
    Gps(name="gps", rate=1, fix=Errors(noise=1.0), deepest=1e3),
    Usbl(name="usbl", rate=1, beacon=(30.0, 40.0, 2.0), range=Errors(noise=0.3), direction=Errors(noise=0.02)),
    IMU,
)


@cache
def craft(water=None):
    """A float in fresh water that rights itself, pushed ahead, to one side and down by one thruster."""
    push = Thrusters(
        "push", positions=[[0.1, 0.02, 0.0]], directions=[[0.8, 0.0, 0.6]], curve={"linear": 1.0}, limit=[-50, 50]
    )
    vehicle = co.vehicles.Vehicle(
        name="float", mass=10.0, inertia=[0.1, 0.2, 0.2], added_mass=[2, 5, 5, 0.1, 0.1, 0.1], length=1.0,
        center_of_mass=(0, 0, 0.05), parts=(Damping("damping", quadratic=[10, 30, 30, 1, 1, 1]), push), sensors=SENSORS,
        fluid_density=1000.0,
    )  # fmt: skip
    return co.vehicles.Craft(vehicle, water=water or co.vehicles.water.UniformWater((0.1, -0.2, 0.0)))


@cache
def run():
    one = craft()
    start = one.start(position=(0, 0, 60), speed=0.5)
    return co.simulate(one.system, start, dt=H, duration=10.0, inputs=COMMANDS, monitors=False)


@cache
def process():
    biases = {"imu_gyroscope": RandomWalk([0.0] * 3), "imu_accelerometer": RandomWalk([0.0] * 3)}
    one = craft()
    start = one.start(position=(0, 0, 60), speed=0.5)
    noise = {"torque": 1e-3, "force": 1e-3}
    drifting = {"water.velocity": RandomWalk([1e-4, 1e-4, 0.0])}
    return ModelProcess(one.system, start, inputs=COMMANDS, noise=noise, drifting=drifting, biases=biases), start


@pytest.mark.long
@pytest.mark.cases(3)
@pytest.mark.parametrize("name", [one.name for one in SENSORS])
def test_a_filter_expects_of_a_sensor_what_it_reads_of_a_run(name):
    """At nodes, by the motion and by the kinematics of the craft."""
    model, start = process()
    sensor = next(one for one in SENSORS if one.name == name)
    read = readings(run())[name]
    node = round(read.time[3] / H)
    row = model.row(start)[None]
    for _ in range(node):
        row = model.advanced(row, H)
    motions = [kinematics(craft())] if name == "imu" else [None, kinematics(craft())]
    for motion in motions:
        one = measurement(sensor, kinematics=motion)
        read_of, space = model.reading(one.function, one.of_state), sensor.errors_in()
        expected = evaluate(lambda row, f=read_of, space=space: space.numbers(f(row)), row[0])
        assert np.allclose(expected, read.exact[3], rtol=1e-8, atol=1e-8)


@pytest.mark.long
def test_readings_lead_a_filter_to_the_motion_and_to_the_biases_of_its_sensors():
    """A DVL that is late, a depth sensor that was set to salt water, and an inertial unit with biases."""
    model, start = process()
    names = ["dvl", "pressure", "compass", "usbl", "imu"]
    read = readings(run(), sensors=names, seed=4)
    at = kinematics(craft())
    known = {name: measurement(read[name].sensor) for name in names[:-1]}
    known["imu"] = measurement(IMU, kinematics=at, biased=("gyroscope", "accelerometer"))
    spread = {"g": 0.02, "q": [2.0, 2.0, 0.5], "xi": 0.01, "nu": 0.05, "water.velocity": [0.1, 0.1, 0.0]}
    spread |= {"imu_gyroscope": 0.01, "imu_accelerometer": 0.02}
    filter = Filter(model, start, measurements=known, deviations=spread, memory=1.0)
    filter.rows = model.moved(filter.rows, _first(model, filter.P[0]))
    arriving = sorted((r.arrival[k], name, k) for name, r in read.taken.items() for k in range(1, len(r.time)))
    scores = {name: [] for name in names}
    for _ in range(100):
        filter.predict(H)
        while arriving and arriving[0][0] <= filter.t + 1e-9:
            _, name, k = arriving.pop(0)
            found = filter.update({name: read[name].values[k]}, t=float(read[name].time[k]))[name]
            scores[name].append(found.nis)
    for name, values in scores.items():
        freedom = len(values) * read[name].sensor.size
        assert chi2.ppf(1e-4, freedom) < np.sum(values) < chi2.ppf(1 - 1e-4, freedom), name
    truth = at(run().final, run().system.parameters)
    place = np.asarray(filter.state.q) - np.asarray(truth.position)
    assert abs(place[2]) < 4 * filter.deviations["q[2]"] < 0.2
    bias = np.mean(read["imu"].values - read["imu"].exact, axis=0)
    off = filter.rows[0, -6:] - bias
    assert np.all(np.abs(off[:3]) < 0.002) and np.all(np.abs(off[3:]) < 0.02)


def _first(model, P):
    """An error of the first estimate, as likely as its deviations say."""
    values, vectors = np.linalg.eigh(P)
    numbers = np.random.default_rng(1).normal(size=len(P))
    e = vectors @ (np.sqrt(np.maximum(values, 0.0)) * numbers)
    e[-6:] = 0.0
    return e[None]


def test_a_bias_is_that_of_a_channel_and_what_a_measurement_reads_is_that_of_its_sensor():
    with pytest.raises(co.errors.ArgumentError, match="no channel `gyro`"):
        measurement(IMU, biased=("gyro",))
    assert measurement(SENSORS[2]).covariance == pytest.approx(np.array([[0.02**2]]))
    sheared = co.Parameters(water=co.Parameters(surface=np.zeros(3)), fluid_density=1000.0)
    for sensor, what in ((SENSORS[1], "the velocity of the water"), (SENSORS[2], "the pressure of the water")):
        read: Any = measurement(sensor).function
        with pytest.raises(co.errors.ArgumentError, match=f"reads {what}.*kinematics"):
            read(None, sheared)


@pytest.mark.long
def test_what_the_parameters_do_not_say_is_refused():
    water = co.vehicles.water.Sheared(
        co.vehicles.water.UniformWater((0.1, 0.0, 0.0)), co.vehicles.water.LinearProfile(80.0)
    )
    one = craft(water)
    start = one.start(position=(0, 0, 60), speed=0.5)
    model = ModelProcess(one.system, start, inputs=COMMANDS)
    for name, what in (("through", "the velocity of the water"), ("pressure", "the pressure of the water")):
        sensor = next(one for one in SENSORS if one.name == name)
        with pytest.raises(co.errors.ArgumentError, match=f"reads {what}.*kinematics"):
            Filter(model, start, measurements={name: measurement(sensor)}, deviations={"q": 1.0})
        Filter(
            model, start, measurements={name: measurement(sensor, kinematics=kinematics(one))}, deviations={"q": 1.0}
        )
    with pytest.raises(co.errors.ArgumentError, match="no bias `imu_gyroscope` of 3 numbers"):
        known = measurement(IMU, kinematics=kinematics(one), biased=("gyroscope",))
        Filter(model, start, measurements={"imu": known}, deviations={"q": 1.0})
