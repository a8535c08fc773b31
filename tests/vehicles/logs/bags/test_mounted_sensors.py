"""Sensors that sit off the origin, turned in the body: a log says so, and identification compares them there."""

from __future__ import annotations

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.groups import attitude
from coadjoint.identification import identify
from coadjoint.identification.channels import Channels, seen
from coadjoint.identification.log import Log
from coadjoint.identification.smoothing import Pose, at_origin
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint_vehicles.logs import read_log, write_mcap
from coadjoint_vehicles.readings.of_run import readings
from coadjoint_vehicles.sensors import Ahrs, Depth, Dvl, Gps, Imu

pytest.importorskip("mcap.reader")

PLACE, TURN = (0.5, -0.2, 0.1), (0.6, -0.3, 0.2)
H = 0.05
SENSORS = (
    Dvl(name="dvl", rate=1 / H, position=PLACE, euler_zyx=TURN),
    Imu(name="imu", rate=1 / H, position=PLACE, euler_zyx=TURN),
    Ahrs(name="ahrs", rate=1 / H, euler_zyx=TURN),
    Gps(name="gps", rate=1 / H, position=PLACE, deepest=1e3),
    Depth(name="gauge", rate=1 / H, position=PLACE),
)
TOPICS = [f"/sensors/{one.name}" for one in SENSORS]


@pytest.fixture(scope="module")
def dive():
    """REMUS 100 in a zigzag, with readings without noise."""
    craft = co.vehicles.Craft(co.vehicles.load("remus_100"))
    t = H * np.arange(601)
    rudder = 0.2 * np.sign(np.sin(t) + 1e-9)
    commands = {"rudder": rudder, "stern_planes": 0.1 * np.sin(0.7 * t), "propeller": 18 + 0 * t}
    start = craft.start(position=(0, 0, 20), speed=1.5, actuators={"propeller": 18.0})
    inputs = {name: co.Held(t, values) for name, values in commands.items()}
    run = co.simulate(craft.system, start, dt=H, duration=30, inputs=inputs)
    readings(run, seed=1, sensors=SENSORS, craft=craft).add_to(run.dataset)
    return craft, start, run


@pytest.fixture(scope="module")
def bag(dive, tmp_path_factory):
    path = tmp_path_factory.mktemp("bags") / "dive.mcap"
    write_mcap(dive[2].dataset, path, axes="NED/FRD")
    return path


@pytest.mark.long
def test_a_bag_of_this_library_says_where_its_sensors_sit(dive, bag):
    """Speeds, rates and attitudes along the body; places as the sensor's, with r beside them."""
    log = read_log(bag, topics=TOPICS)
    data = dive[2].dataset
    R, q, omega, v = (np.asarray(data[name].values) for name in ("R", "q", "xi", "nu"))
    at = np.einsum("kij,j->ki", R, PLACE)
    for names, expected in (
        ("uvw", v + np.cross(omega, PLACE)),
        ("pqr", omega),
        (("north", "east"), (q + at)[:, :2]),
        (("depth",), (q + at)[:, 2:]),
        (("heading", "pitch", "roll"), np.stack(attitude.zyx_angles(R), axis=-1)),
    ):
        found = np.stack([log.columns[name] for name in names], axis=1)
        np.testing.assert_allclose(found, expected[np.rint(log.time / H).astype(int)], atol=1e-9)
    assert log.positions == dict.fromkeys(("north", "east", "depth", "u", "v", "w"), PLACE)
    assert log.between(0, 5).positions == log.positions


def declaration(axes="NED/FRD"):
    signs = np.array([1, 1, 1]) if axes == "NED/FRD" else np.array([1, -1, -1])
    return {
        "axes": axes,
        "position_m": (signs * PLACE).tolist(),
        "euler_zyx_deg": (signs[::-1] * np.degrees(TURN)).tolist(),
    }


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("axes", ["NED/FRD", "ENU/FLU"])
def test_a_declared_mounting_is_that_of_the_vehicle_file(dive, bag, tmp_path, axes):
    """The same bag without its metadata: the mounting stands in the declaration, in either axes."""
    from mcap.reader import make_reader
    from mcap.writer import Writer

    whole = tmp_path / "whole.mcap"
    write_mcap(dive[2].dataset, whole, axes=axes)
    foreign = tmp_path / "foreign.mcap"
    with whole.open("rb") as source, foreign.open("wb") as opened:
        writer, known = Writer(opened), {}
        writer.start()
        for schema, channel, message in make_reader(source).iter_messages(topics=["/sensors/dvl", "/sensors/imu"]):
            assert schema is not None
            if channel.id not in known:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                known[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, number)
            writer.add_message(known[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
    rows = [{"topic": f"/sensors/{name}", **declaration(axes)} for name in ("dvl", "imu")]
    log, ours = read_log(foreign, sensors={"sensor": rows}), read_log(bag, topics=["/sensors/dvl", "/sensors/imu"])
    for name in "uvwpqr":
        np.testing.assert_allclose(log.columns[name], ours.columns[name], atol=1e-12)
    assert log.positions.keys() == set("uvw")
    np.testing.assert_allclose(log.positions["u"], PLACE, atol=1e-15)
    bare = read_log(foreign, sensors={"sensor": [{"topic": "/sensors/dvl", "axes": axes}]})
    assert np.nanmax(np.abs(bare.columns["v"] - log.columns["v"][np.isfinite(log.columns["v"])])) > 0.1


@pytest.mark.long
@pytest.mark.parametrize(
    ("declared", "place", "turn"),
    [
        ({"position_m": [0.1, 0.0, 0.0]}, (0.1, 0.0, 0.0), TURN),
        ({"euler_zyx_deg": [0.0, 0.0, 0.0]}, PLACE, (0.0, 0.0, 0.0)),
        ({"position_m": [0.0, 0.0, 0.0], "euler_zyx_deg": [0.0, 0.0, 0.0]}, None, (0.0, 0.0, 0.0)),
    ],
)
def test_what_is_declared_of_a_mounting_is_that_and_the_rest_is_what_the_bag_tells(dive, bag, declared, place, turn):
    def dvl(**row):
        return read_log(bag, topics=["/sensors/dvl"], sensors={"sensor": [{"topic": "/sensors/dvl", **row}]})

    log, plain = dvl(axes="NED/FRD", **declared), dvl(axes="NED/FRD", euler_zyx_deg=[0.0, 0.0, 0.0])
    v = np.stack([plain.columns[name] for name in "uvw"], axis=1) @ np.asarray(attitude.zyx(*turn)).T
    np.testing.assert_allclose(np.stack([log.columns[name] for name in "uvw"], axis=1), v, atol=1e-12)
    assert log.positions == ({} if place is None else dict.fromkeys("uvw", place))
    (note,) = [note for note in log.notes if "count from there" in note] or [""]
    at = place and f"at {', '.join(f'{x:g}' for x in place)} m forward, starboard and down of the origin O"
    angles = f"turned by yaw, pitch and roll of {', '.join(f'{x:.4g}' for x in np.degrees(turn))}°"
    assert (at is not None and at in note, angles in note) == (place is not None, any(turn))


def test_first_velocities_are_those_of_the_origin_wherever_each_place_is_measured():
    """ν = Rᵀq̇ of places at three r, without a velocity in the log."""
    t, random = 0.1 * np.arange(12), np.random.default_rng(5)
    q, omega, v = random.normal(size=(3, 12, 3))
    R = np.stack([attitude.zyx(*angles) for angles in random.normal(size=(12, 3))])
    levers = {"north": (2.0, 0.3, 0.0), "depth": (-0.4, 0.0, 0.2)}
    qdot, at = np.einsum("kij,kj->ki", R, v), q.copy()
    for i, name in enumerate(("north", "east", "depth")):
        r = np.asarray(levers.get(name, (0.0, 0.0, 0.0)))
        at[:, i] += (R @ r)[:, i]
        qdot[:, i] += np.einsum("kij,kj->ki", R, np.cross(omega, r))[:, i]
    columns = dict(zip(("north", "east", "depth"), at.T, strict=True))
    log = Log(t, columns, {}, {}, positions=levers)
    measured = Pose(R, at, omega, np.einsum("kji,kj->ki", R, qdot))
    found = at_origin(measured, log)
    np.testing.assert_allclose(found.q, q, atol=1e-12)
    np.testing.assert_allclose(found.v, v, atol=1e-12)


@pytest.mark.long
def test_what_is_compared_is_what_a_sensor_of_that_place_reads(dive):
    """q + Rr and ν + ω × r."""
    names, (craft, _, run) = ("north", "east", "depth", "u", "v", "w"), dive
    plain = seen(craft.system, run.records, (*names, "p", "q", "r"))
    channels = Channels(names, levers=tuple((name, PLACE) for name in names))
    values = np.asarray(evaluate(jax.vmap(lambda state: channels.of(craft.system, state)), run.records))
    O = np.stack([plain[name] for name in names], axis=1)
    np.testing.assert_allclose(values[:, :3], O[:, :3] + np.asarray(run.records.g) @ PLACE, atol=1e-12)
    rates = np.stack([plain[name] for name in "pqr"], axis=1)
    np.testing.assert_allclose(values[:, 3:], O[:, 3:] + np.cross(rates, PLACE), atol=1e-12)


@pytest.mark.long
def test_a_model_from_sensors_off_the_origin_is_the_true_one(dive, bag):
    """Without the places the drags are 3 and 25 % off."""
    craft, start, _ = dive
    topics = [*TOPICS, "/command/rudder", "/command/stern_planes", "/command/propeller"]
    log = read_log(bag, topics=topics)
    drag, sigma = ["hull.axial_drag", "hull.crossflow_drag"], {"position": 0.1, "velocity": 0.01}
    asked = {"start": start, "parameters": drag, "noise": {**sigma, "attitude": 0.01, "rates": 0.01}}
    guess = craft.system.replace(hull={"axial_drag": 0.6})
    found = identify(guess, log, **asked)
    assert abs(found[drag[0]].value - 0.42) < 1e-6 and abs(found[drag[1]].value - 1.1) < 1e-6
    bare = Log(log.time, log.columns, log.inputs, log.units, log.notes, log.step, log.actual)
    off = identify(guess, bare, **asked)
    assert abs(off[drag[0]].value - 0.42) > 0.01 and abs(off[drag[1]].value - 1.1) > 0.01
