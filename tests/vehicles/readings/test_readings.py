"""Readings of runs: rates, latencies, places in closed form, and the same to the bit from a seed."""

import warnings
from functools import cache, partial
from typing import Any

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.groups import attitude
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.simulation import plan
from coadjoint.simulation import store as streaming
from coadjoint.simulation.progress import Progress
from coadjoint_vehicles.parts import Damping, Thrusters
from coadjoint_vehicles.readings import observations, of_run, readings
from coadjoint_vehicles.readings.of_run import at_times, in_blocks
from coadjoint_vehicles.sensors import Ahrs, Altimeter, Depth, Dvl, Errors, Gps, Imu, Kinematics, Usbl
from coadjoint_vehicles.serving.inertial import inertial

SENSORS = (
    Imu(name="imu", rate=50, position=(0.3, 0.05, -0.1), latency=0.004, gyroscope=Errors(noise_density=1e-4)),
    Dvl(name="dvl", rate=7, latency=0.2, highest=26, velocity=Errors(noise=0.01), dropout=0.1),
    Depth(name="depth", rate=3, depth=Errors(noise=0.05, bias_instability=0.1, bias_time=5)),
    Gps(name="gps", rate=1),
)
WANTED: Any = {"push": [9.0]}


@cache
def craft():
    """A float that rights itself, pushed ahead, to one side and down by one thruster."""
    push = Thrusters(
        "push",
        positions=[[0.1, 0.02, 0.0]],
        directions=[[0.8, 0.0, 0.6]],
        curve={"linear": 1.0},
        limit=[-50, 50],
        lag=0.5,
    )
    vehicle = co.vehicles.Vehicle(
        name="float", mass=10.0, inertia=[0.1, 0.2, 0.2], added_mass=[2, 5, 5, 0.1, 0.1, 0.1], length=1.0,
        center_of_mass=(0, 0, 0.05), parts=(Damping("damping", quadratic=[10, 30, 30, 1, 1, 1]), push), sensors=SENSORS,
    )  # fmt: skip
    return co.vehicles.Craft(vehicle)


def ran(duration=12.0, **more):
    one = craft()
    return co.simulate(
        one.system, one.start(position=(0, 0, 2), speed=0.5), dt=0.05, duration=duration, inputs=WANTED, **more
    )


@cache
def run():
    return ran()


def circle(nodes, w=0.3, radius=8.0, end=6.0):
    """Kinematics at nodes of a steady turn to starboard at 2 m depth, heading north at t = 0."""
    t = np.linspace(0.0, end, nodes)
    position = radius * np.stack([np.sin(w * t), 1 - np.cos(w * t), np.full(nodes, 2.0 / radius)], axis=1)
    rows = np.ones((nodes, 1))
    return Kinematics(
        position=position, rotation=attitude.zyx(w * t, 0.0, 0.0), velocity=rows * [w * radius, 0, 0],
        omega=rows * [0, 0, w],
        acceleration=rows * [0, w**2 * radius, 0], angular_acceleration=rows * [0, 0, 0], gravity=rows[:, 0] * 9.81,
        current=rows * [0, 0, 0], head=rows[:, 0] * 2000.0, density=rows[:, 0] * 1000.0, t=t,
    )  # fmt: skip


def test_between_nodes_a_circle_is_read_to_fourth_order_and_its_accelerations_exactly():
    w, radius, r = 0.3, 8.0, np.array([0.5, 0.0, 0.0])
    times = np.linspace(0.1, 5.9, 37)
    heading = w * times
    antenna = np.stack(
        [radius * np.sin(heading) + r[0] * np.cos(heading), radius * (1 - np.cos(heading)) + r[0] * np.sin(heading)],
        axis=1,
    )
    errors = []
    for nodes in (7, 13, 25):
        where, _ = at_times(Gps(name="gps", rate=1, position=r), circle(nodes), times)
        turned, _ = at_times(Ahrs(name="ahrs", rate=1), circle(nodes), times)
        errors.append(max(np.max(np.abs(where - antenna)), np.max(np.abs(turned[:, 2] - heading))))
    assert np.all(np.log2(np.divide(errors[:-1], errors[1:])) > 3.7)
    imu, _ = at_times(Imu(name="imu", rate=1, position=r), circle(7), times)
    expected = [0, 0, w, -(w**2) * r[0], w**2 * radius, -9.81]
    np.testing.assert_allclose(imu, np.tile(expected, (37, 1)), atol=1e-14)


@pytest.mark.long
def test_every_sensor_reads_at_its_own_rate_and_with_its_own_latency():
    read = readings(run(), seed=1)
    assert list(read) == ["imu", "dvl", "depth", "gps"]
    np.testing.assert_array_equal(read["imu"].time, np.arange(601) / 50)
    np.testing.assert_array_equal(read["depth"].time, np.arange(37) / 3)
    dvl = read["dvl"]
    np.testing.assert_array_equal(dvl.time, dvl.number / 7)
    np.testing.assert_array_equal(dvl.arrival, dvl.time + 0.2)
    assert dvl.tried == 85 and 60 < len(dvl) < 85  # a tenth is lost
    assert len(read["gps"]) == 0 and read["gps"].values.shape == (0, 2)  # never at the surface


@pytest.mark.long
def test_readings_at_nodes_are_of_the_motion_there():
    found, records = readings(run(), seed=1), run().records
    node = 160  # 8 s: a node, and a reading of imu and of depth
    state = jax.tree.map(lambda leaf: leaf[node], records)
    p = craft().system.parameters
    unit = evaluate(partial(inertial, craft().system, SENSORS[0].position), state.holding(state.internal), p)
    exact = found["imu"].exact[400]
    np.testing.assert_allclose(exact, np.concatenate([unit.angular_velocity, unit.specific_force]), atol=1e-12)
    assert found["depth"].exact[24, 0] == pytest.approx(state.q[2], abs=1e-12)


@pytest.mark.long
def test_between_nodes_readings_are_of_the_motion_that_steps_of_the_method_lead_to():
    ahrs = Ahrs(name="ahrs", rate=1.3)
    sensors = [Depth(name="deep", rate=1.3), ahrs, Gps(name="high", rate=1.3, deepest=100.0)]
    read = readings(run(), sensors=sensors)
    there = run().at(read["deep"].time)
    yaw, pitch, roll = attitude.zyx_angles(there.g)
    np.testing.assert_allclose(read["deep"].exact[:, 0], there.q[:, 2], atol=2e-5)
    np.testing.assert_allclose(read["high"].exact, there.q[:, :2], atol=2e-5)
    for ours, theirs in zip(read["ahrs"].exact, np.stack([roll, pitch, yaw], axis=1), strict=True):
        np.testing.assert_allclose(ahrs.residual(ours, theirs), 0.0, atol=1e-4)


@pytest.mark.long
def test_the_bottom_is_locked_and_read_where_it_is_near():
    read = readings(run(), seed=1, bottom=30.0, sensors=["dvl", Altimeter(name="altimeter", rate=2)])
    depth = run().dataset.q[:, 2].values
    below = np.interp(read["dvl"].time, run().dataset.time, depth)
    assert np.all(30 - below <= 26 + 1e-6) and read["dvl"].time[0] > 2.0
    level = read["altimeter"].exact[-1, 0]
    assert level == pytest.approx(30 - depth[-1], abs=0.1)


def same(ours, theirs, until=np.inf):
    for name in ours:
        kept = theirs[name].time <= until
        assert np.array_equal(ours[name].time, theirs[name].time[kept]), name
        assert np.array_equal(ours[name].values, theirs[name].values[kept]), name


@pytest.mark.long
def test_readings_are_the_same_to_the_bit_in_a_shorter_run_and_without_the_other_sensors():
    read = readings(run(), seed=4)
    same(readings(ran(duration=7.0), seed=4), read, until=7.0)
    alone = readings(run(), seed=4, sensors=["depth"])
    assert np.array_equal(alone["depth"].values, read["depth"].values)
    assert not np.array_equal(readings(run(), seed=5)["depth"].values, read["depth"].values)


@pytest.mark.long
def test_readings_of_a_run_that_was_interrupted_and_resumed_are_the_same_to_the_bit(tmp_path, monkeypatch):
    monkeypatch.setattr(plan, "CAPACITY", 50)
    monkeypatch.setattr(streaming, "PERIOD", 0.0)
    monkeypatch.setattr(streaming, "BURDEN", 0.0)
    chunks = iter(range(2))

    def advance(self, steps, seconds):
        if next(chunks, None) is None:
            raise KeyboardInterrupt

    with monkeypatch.context() as cut, pytest.raises(KeyboardInterrupt):
        cut.setattr(Progress, "advance", advance)
        ran(store=tmp_path / "run")
    assert 0 < len(co.load(tmp_path / "run").dataset.time) < 241
    resumed = co.resume(tmp_path / "run", craft().system, inputs=WANTED)
    assert resumed.count == 241
    same(readings(resumed, seed=4), readings(run(), seed=4))


@pytest.mark.long
def test_where_fewer_nodes_were_saved_the_steps_between_are_taken_again():
    sparse = ran(save_every=9)
    read, again = readings(run(), seed=4), readings(sparse, seed=4)
    same(again, read)


@pytest.mark.long
def test_blocks_are_filled_up_and_cut_again(monkeypatch):
    monkeypatch.setattr(of_run, "BLOCK", 4)
    rows = {"x": np.arange(10.0)}
    assert np.array_equal(in_blocks(lambda row: 3 * row["x"], rows), 3 * np.arange(10.0))
    for duration in (0.15, 0.6):  # 4 and 13 nodes in blocks of 4
        short = ran(duration=duration)
        sparse = ran(duration=duration, save_every=50)
        assert len(readings(short, sensors=["imu"])["imu"]) == int(50 * duration + 1e-9) + 1
        same(readings(sparse, seed=4, sensors=["imu"]), readings(short, seed=4, sensors=["imu"]))


@pytest.mark.long
def test_the_dataset_and_the_table_name_times_units_and_components():
    read = readings(run(), seed=1, sensors=["imu", "dvl"])
    made = read.dataset
    assert made.sensor_imu_gyroscope.dims == ("sensor_imu_time", "sensor_imu_gyroscope_component")
    assert made.sensor_imu_accelerometer.attrs["units"] == "m/s²" and made.attrs["sensors_seed"] == 1
    assert made.sensor_dvl_arrival.attrs["tried"] == 85
    picked = made.sensor_imu_gyroscope.sel(sensor_imu_gyroscope_component="angular_velocity_z")
    assert np.array_equal(picked, read["imu"].of("angular_velocity_z"))
    assert np.array_equal(read["imu"].of("gyroscope"), made.sensor_imu_gyroscope)
    head, first, *_ = read["imu"].text.splitlines()
    assert head.startswith("time_s,arrival_s,angular_velocity_x_deg_s,") and head.endswith("specific_force_z_m_s2")
    assert float(first.split(",")[2]) == pytest.approx(np.degrees(read["imu"].values[0, 0]), rel=1e-10)


@pytest.mark.cases(4)
@pytest.mark.parametrize(
    "make, sentence",
    [
        (lambda: readings(run().dataset), "`run` must be a run of co.simulate"),  # pyright: ignore[reportArgumentType]
        (lambda: readings(run(), sensors="imu"), "must be a row of names or sensors"),
        (lambda: readings(run(), sensors=["sonar"]), "has no sensor `sonar`: it knows depth, dvl"),
        (lambda: readings(run(), sensors=["imu", "imu"]), "Two sensors are named `imu`"),
        (lambda: readings(run(), seed=-1), "`seed` must be a whole number"),
        (lambda: readings(run(), sensors=["imu"])["dvl"], "The run has no sensor `dvl`: it knows imu"),
        (
            lambda: readings(run(), sensors=["imu"])["imu"].of("heading"),
            "reads no `heading`: it reads angular_velocity_x",
        ),
        (
            lambda: readings(run(), sensors=["imu"]).add_to("x"),
            "must be that of a run, such as run.dataset, but is 'x'",
        ),  # pyright: ignore[reportArgumentType]
        (lambda: readings(run(), bottom="20"), "`bottom` must be a number"),  # pyright: ignore[reportArgumentType]
        (lambda: readings(run(), bottom=-20.0), "`bottom` must be at least 0, but is -20"),
        (lambda: observations(craft(), ["dvl"], bottom=-20.0), "`bottom` must be at least 0, but is -20"),
        (lambda: readings(run(), bottom=np.nan), "`bottom` must be finite"),
        (
            lambda: readings(run(), sensors=[Altimeter(name="fast", rate=1e9)], bottom=50),
            "at 1e+09 readings in a second",
        ),
        (lambda: readings(run(), sensors=[Altimeter(name="altimeter", rate=1)]), "needs `bottom`"),
    ],
)
def test_mistakes_are_told_in_a_sentence(make, sentence):
    with pytest.raises(ArgumentError) as told:
        make()
    assert sentence in str(told.value)


@pytest.mark.long
def test_a_stepper_observes_sensors_by_name_as_a_run_is_read():
    one, start = craft(), run().start
    seen = observations(one, ["imu", "depth"])
    stepper = co.Stepper(one.system, start, dt=0.05, inputs={"push": [9.0]}, observe=seen, backend="native")
    found = stepper.step({"push": [9.0]}, n=40)  # 2 s: a node, and a reading of both
    read = readings(run(), sensors=["imu", "depth"])
    np.testing.assert_allclose(found["sensor_imu"], read["imu"].exact[100], atol=1e-10)
    np.testing.assert_allclose(found["sensor_depth"], read["depth"].exact[6], atol=1e-10)


def test_a_beacon_is_ranged_from_a_vehicle_under_way():
    usbl = Usbl(name="usbl", rate=0.5, beacon=(30, 10, 4), range=Errors(noise=0.1), direction=Errors(noise=0.01))
    read = readings(run(), seed=2, sensors=[usbl])["usbl"]
    q = run().dataset.q.values[::40]
    np.testing.assert_allclose(read.exact[:, 0], np.linalg.norm(q - [30, 10, 4], axis=1), atol=1e-9)
    assert np.max(np.abs(usbl.residual(read.values[1], read.exact[1])) / usbl.deviation) < 4


def test_a_latency_that_is_longer_than_the_run_is_told():
    late, there = Depth(name="late", rate=3, latency=12.5), Depth(name="there", rate=3, latency=11.5)
    with pytest.warns(UserWarning, match="No reading of `late` .* at 12 s, because its latency is 12.5 s") as told:
        read = readings(run(), sensors=[late, there])
    assert len(told) == 1 and read.warnings == (str(told[0].message),) and len(read["late"]) == 37
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert readings(run(), sensors=[there]).warnings == ()


def test_what_a_sensor_would_read_out_of_its_limits_need_be_no_number(monkeypatch):
    """An altimeter whose beam never meets the bottom reads nothing, and what it reads later has the errors it had."""

    def at(sensor, moving, times):
        exact, there = at_times(sensor, moving, times)
        return np.where(there[:, None] & (times > 3)[:, None], exact, np.nan), there & (times > 3)

    one = Altimeter(name="altimeter", rate=5, highest=40, range=Errors(noise=0.1, bias_instability=0.1, bias_time=2))
    whole = readings(run(), sensors=[one], bottom=20)["altimeter"]
    monkeypatch.setattr(of_run, "at_times", at)
    part = readings(run(), sensors=[one], bottom=20)["altimeter"]
    assert 0 < len(part) < len(whole) and np.array_equal(part.values, whole.values[-len(part) :])
