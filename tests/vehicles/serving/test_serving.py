"""A craft that other programs step: what it measures, ArduSub's motors and lockstep, and plain requests."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from autopilot import RATE, listening, packet, told
from coadjoint.cli.main import main
from coadjoint.errors import ArgumentError
from coadjoint.groups import attitude
from coadjoint_vehicles import Craft
from coadjoint_vehicles.parts.thrusters import Thrusters
from coadjoint_vehicles.serving import frames
from coadjoint_vehicles.serving.ardupilot import Lockstep, unpacked
from coadjoint_vehicles.serving.frames import FRAMES, commands, motors, thrusters_of
from coadjoint_vehicles.serving.loop import Lateness, Loop
from coadjoint_vehicles.serving.plain import Service
from coadjoint_vehicles.serving.served import Served

NAME = "bluerov2_heavy_von_benzon"
IMU = (0.2, -0.1, 0.05)
AHEAD = [1450, 1450, 1550, 1550, 1500, 1500, 1500, 1520]


def errors_of_the_inertial_unit(served: Served) -> np.ndarray:
    """f − Rᵀ(d²(q + R r)/dt² − g e_z) and ω − log(R₀ᵀR₂)/2h by differences of places and attitudes, at t = 0.05 s."""
    moving = {"velocity": (0.8, 0.3, -0.2), "angular_velocity": (0.6, -0.5, 0.9), "actuators": {"thrusters": AHEAD}}
    served.reset(served.craft.start(position=(0, 0, 5.0), **moving))
    commands, h = {"thrusters": np.array(AHEAD, float)}, served.dt
    served.advance(commands, round(0.05 / h) - 1)
    readings = []
    for _ in range(3):
        readings.append(served.reading())
        served.advance(commands, 1)
    before, at, after = readings
    places = [reading.position + reading.rotation @ np.array(IMU) for reading in readings]
    acceleration = (places[2] - 2 * places[1] + places[0]) / h**2
    turned = attitude.rotation_vector(before.rotation.T @ after.rotation) / (2 * h)
    force = at.rotation.T @ (acceleration - [0, 0, served.craft.vehicle.gravity])
    assert at.t == pytest.approx(0.05) and np.max(np.abs(acceleration)) > 0.5
    return np.concatenate([at.specific_force - force, at.angular_velocity - turned])


@pytest.mark.long
def test_an_inertial_unit_off_the_origin_reads_what_its_place_and_attitude_do_to_second_order(fresh, craft):
    """Differences of step h are off by a quarter at h/2, and by 1e-3 of 5 m/s² at 400 Hz."""
    coarse = errors_of_the_inertial_unit(fresh)
    fine = errors_of_the_inertial_unit(Served(craft, craft.start(), 0.5 / RATE, IMU))
    assert np.max(np.abs(coarse)) < 2e-3
    seen = np.abs(coarse) > 5e-6
    assert np.sum(seen) >= 5
    np.testing.assert_allclose(coarse[seen] / fine[seen], 4.0, rtol=0.05)


@pytest.mark.long
def test_a_vehicle_that_rests_level_and_floats_neither_up_nor_down_feels_its_weight_alone():
    vehicle = vehicles.load(NAME)
    still = Craft(replace(vehicle, volume=vehicle.mass / vehicle.fluid_density))
    reading = Served(still, still.start(), 0.01).reading()
    np.testing.assert_allclose(reading.specific_force, [0, 0, -vehicle.gravity], atol=1e-12)
    np.testing.assert_array_equal(reading.angular_velocity, 0)


def thrusters_like(frame: str) -> Thrusters:
    """Thrusters that do what the motors of a frame are meant to, in another order, every third the other way round."""
    factors = np.array(FRAMES[frame], float)
    wrench = np.stack([factors[:, 4], factors[:, 5], -factors[:, 3], *factors[:, :3].T])
    order = np.arange(len(factors))[::-1]
    matrix = wrench[:, order] * np.where(order % 3 == 0, -1.0, 1.0)
    curve = vehicles.load(NAME).commanded[0].curve
    return Thrusters("thrusters", curve=curve, allocation=matrix, unit="us")


@pytest.mark.parametrize("frame", FRAMES)
def test_each_motor_of_a_frame_does_what_ardusub_means_it_to_do(frame):
    thrusters = thrusters_like(frame)
    found = motors(frame, thrusters)
    for number, factors in enumerate(FRAMES[frame]):
        pulses = [1500] * len(found)
        pulses[number] = 1600
        moved = commands(found, thrusters, pulses) - 1500
        roll, pitch, yaw, ascent, ahead, starboard = factors
        np.testing.assert_allclose(
            thrusters.nominal_matrix @ moved, 100 * np.array([ahead, starboard, -ascent, roll, pitch, yaw])
        )


def test_no_thruster_is_two_motors(monkeypatch):
    monkeypatch.setattr(frames, "_motor", lambda frame, number, *_: frames.Motor(min(number, 4), 1))
    with pytest.raises(ArgumentError, match="Two motors of ArduSub's frame vectored would be one thruster of"):
        motors("vectored", thrusters_like("vectored"))


@pytest.mark.long
def test_the_shipped_heavy_rov_turns_the_way_that_ardusub_asks(fresh):
    """Roll to starboard by motors 5 to 8 is a positive K; the source of its allocation has them in another order."""
    thrusters = thrusters_of(fresh.craft.vehicle)
    found = motors("vectored_6dof", thrusters)
    assert [motor.thruster for motor in found] == [0, 1, 2, 3, 5, 4, 7, 6]
    roll = np.array([factors[0] for factors in FRAMES["vectored_6dof"]])
    wrench = thrusters.nominal_matrix @ (commands(found, thrusters, (1500 + 100 * roll).astype(int)) - 1500)
    assert wrench[3] > 10 and np.max(np.abs(np.delete(wrench, 3))) < 1e-9


def test_commands_in_other_units_are_shares_of_their_limits():
    thrusters = replace(thrusters_like("vectored"), unit="1", curve={"linear": 40.0}, limit=(-0.5, 1.0))
    found = motors("vectored", thrusters)
    made = commands(found, thrusters, [1900, 1100, 1700, 1500, 0, 1500])
    by_motor = [made[motor.thruster] * motor.sign for motor in found]
    assert [motor.sign for motor in found] == [-1, 1, 1, -1, 1, 1]
    np.testing.assert_allclose(by_motor, [0.5, -0.5, 0.5, 0, 0, 0])


def test_a_frame_that_does_not_fit_is_told():
    thrusters = thrusters_like("vectored_6dof")
    with pytest.raises(ArgumentError, match="has 6 motors, but `thrusters` has 8"):
        motors("vectored", thrusters)
    with pytest.raises(ArgumentError, match="no frame `quad`"):
        motors("quad", thrusters)
    flat = replace(thrusters, allocation=np.where(np.arange(6)[:, None] == 3, 0.0, thrusters.allocation))
    with pytest.raises(ArgumentError, match=r"Motor 5 .* \+Z, \+K, -M: no thruster does"):
        motors("vectored_6dof", flat)
    with pytest.raises(ArgumentError, match=r"one part of the kind `thrusters`, but REMUS 100.* has 0"):
        thrusters_of(vehicles.load("remus_100"))


@pytest.mark.long
def test_lockstep_gives_the_motion_of_the_same_commands_to_the_bit(lockstep, craft):
    """As `co.simulate` with the same held commands; the time of a frame is its end."""
    answers = [told(lockstep.answer(packet(number, AHEAD))) for number in range(200)]
    order = [0, 1, 2, 3, 5, 4, 7, 6]
    held = np.array(AHEAD, float)[order]
    run = co.simulate(
        craft.system, craft.start(position=(0.0, 0.0, 2.0)), dt=1 / RATE, steps=200, inputs={"thrusters": held},
        progress=False, accuracy=False,
    )  # fmt: skip
    assert lockstep.counts == {"frames": 200}
    assert answers[-1]["timestamp"] == run.final.t
    q = np.asarray(run.final.g) @ np.asarray(run.final.n)
    np.testing.assert_allclose(answers[-1]["position"], q, rtol=0, atol=1e-14)
    R = attitude.from_quaternion(answers[-1]["quaternion"])
    np.testing.assert_allclose(R, run.final.g, rtol=0, atol=1e-14)
    assert answers[-1]["position"][0] > 0.02


@pytest.mark.long
def test_frames_that_come_twice_are_answered_again_and_a_new_start_begins_anew(lockstep):
    first = lockstep.answer(packet(0, AHEAD))
    second = lockstep.answer(packet(1, AHEAD))
    assert lockstep.answer(packet(1, [1900] * 8)) == second
    assert told(lockstep.answer(packet(5, AHEAD)))["timestamp"] == pytest.approx(3 / RATE)
    assert lockstep.answer(packet(0, AHEAD)) == first
    assert lockstep.counts == {"frames": 4, "duplicates": 1, "lost": 3, "restarts": 1}


def test_a_late_frame_moves_nothing_and_a_new_start_has_a_rate_of_its_own(fresh, caplog):
    thrusters, rates = thrusters_of(fresh.craft.vehicle), []

    def begin(rate: int) -> Served:
        rates.append(rate)
        return fresh

    lockstep = Lockstep(begin, thrusters, motors("vectored_6dof", thrusters))
    for number in range(20, 60):
        last = lockstep.answer(packet(number, AHEAD))
    assert lockstep.answer(packet(58, [1900] * 8)) == last == lockstep.answer(packet(50, AHEAD))
    assert told(lockstep.answer(packet(60, AHEAD)))["timestamp"] == pytest.approx(41 / RATE)
    assert told(lockstep.answer(packet(0, AHEAD, rate=100)))["timestamp"] == pytest.approx(1 / RATE)
    assert rates == [RATE, 100] and lockstep.counts["late"] == 2 and lockstep.counts["restarts"] == 1
    assert "ArduPilot began anew, at 100 Hz" in caplog.text


def test_32_outputs_are_read_and_outputs_that_are_off_are_neutral(lockstep, fresh):
    assert unpacked(packet(7, [1500] * 32)) == (RATE, 7, (1500,) * 32)
    lockstep.answer(packet(0, [0] * 20))
    np.testing.assert_array_equal(fresh.reading().actuators["thrusters"], 1500)


@pytest.mark.parametrize("data", [b"", b"\x1a", b"hello", packet(0, [1500])[:-1], packet(0, [1500]) + b"\0"])
def test_what_is_no_packet_is_told(lockstep, data):
    with pytest.raises(ArgumentError, match=f"A packet of ArduPilot has 40 bytes .* but {len(data)} bytes came"):
        lockstep.answer(data)


def test_frames_over_udp_are_none_lost_and_none_out_of_order(lockstep):
    loop = Loop("127.0.0.1", 0)
    with listening(loop, lockstep, 301) as ask:
        times = [told(ask(packet(number, AHEAD)))["timestamp"] for number in range(300)]
        assert told(ask(packet(299, AHEAD)))["timestamp"] == times[-1]
    np.testing.assert_allclose(times, np.arange(1, 301) / RATE, rtol=1e-12)
    assert lockstep.counts == {"frames": 300, "duplicates": 1} and loop.refused == 0


def test_a_paced_loop_answers_no_sooner_than_the_time_of_the_craft(lockstep):
    loop = Loop("127.0.0.1", 0, paced=True)
    with listening(loop, lockstep, 41) as ask:
        for number in range(41):
            ask(packet(number, AHEAD))
    assert loop.seconds >= 39 / RATE and loop.simulated == pytest.approx(41 / RATE)
    assert 0 <= loop.lateness.share(0.5) <= loop.lateness.share(0.99) <= loop.lateness.largest


def test_shares_of_lateness_are_those_of_the_sample():
    random = np.random.default_rng(3)
    sample, late = random.lognormal(-8, 1, 2000), Lateness()
    for seconds in sample:
        late.add(seconds)
    for part in (0.5, 0.9, 0.99):
        assert late.share(part) == pytest.approx(np.quantile(sample, part), rel=0.03)
    assert late.largest == sample.max() and np.isnan(Lateness().share(0.5))


@pytest.fixture
def service(fresh: Served) -> Service:
    return Service(fresh, partial(fresh.craft.start, position=(0, 0, 2.0), speed=0.0))


def asked(service: Service, **request) -> dict:
    return json.loads(service.answer(json.dumps(request).encode()) or b"")


def test_a_plain_request_is_carried_out_once(service):
    first = asked(service, id=1, commands={"thrusters": AHEAD}, steps=40)
    assert first["t"] == pytest.approx(0.1) and first["position"][0] > 0
    assert asked(service, id=1, steps=40) == first
    assert asked(service, id=2, steps=0)["t"] == first["t"]
    assert asked(service, steps=2)["t"] == pytest.approx(0.105)
    assert asked(service, reset=True, steps=0)["t"] == 0
    assert asked(service, reset=True, steps=1)["actuators"] == {"thrusters": [1500] * 8}
    assert asked(service, reset={}, steps=0)["position"] == [0, 0, 2]
    fast = asked(service, reset={"velocity": [0, 0.3, 0]}, steps=0)["velocity"]
    np.testing.assert_allclose(fast, [0.1, 0.1, 0], atol=1e-12)
    begun = asked(service, reset={"position": [0, 0, 9], "speed": 0.5}, steps=0)
    assert begun["position"] == [0, 0, 9]
    np.testing.assert_allclose(begun["velocity"], [0.6, -0.2, 0])
    assert set(begun) == {
        "id", "t", "position", "velocity", "quaternion", "body_velocity", "angular_velocity", "specific_force",
        "actuators",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("request_", "sentence"),
    [
        (b"no json", "A request is a JSON object"),
        (b"[" * 100_000, "A request is a JSON object"),
        (b"[1]", "A request is a JSON object"),
        (b"\xff\xfe", "A request is a JSON object"),
        (b'{"step": 1}', "but not step"),
        (b'{"id": true}', "`id` must be a whole number or a text"),
        (b'{"id": 1.0}', "`id` must be a whole number or a text"),
        (b'{"id": "' + b"x" * 60_000 + b'"}', "`id` must be a whole number or a text of at most 200"),
        (b'{"steps": -1}', "`steps` must be a whole number"),
        (b'{"steps": 1.5}', "`steps` must be a whole number"),
        (b'{"steps": true}', "`steps` must be a whole number"),
        (b'{"steps": 1000000000}', "`steps` must be a whole number from 0 to 100000"),
        (b'{"commands": [1]}', "`commands` must be an object"),
        (b'{"commands": {"rudder": 0.1}}', "rudder"),
        (b'{"commands": {"thrusters": 1500}}', "thrusters"),
        (b'{"commands": {"thrusters": "full"}}', "thrusters"),
        (b'{"commands": {"thrusters": [NaN, 0, 0, 0, 0, 0, 0, 0]}}', "without NaN"),
        (
            b'{"commands": {"thrusters": [1500, 1500, 1500, 1500, 1500, 1500, 1500, 1500]}, "steps": 0}',
            "at least one step",
        ),
        (b'{"reset": 1}', "`reset` must be true"),
        (b'{"reset": {"spead": 1}}', "but not spead"),
        (b'{"reset": {"speed": "fast"}}', "speed"),
        (b'{"reset": {"position": [0, 0]}}', "position"),
    ],
)
def test_a_request_that_cannot_be_carried_out_is_one_sentence_and_moves_nothing(service, fresh, request_, sentence):
    before = fresh.stepper.t
    answer = json.loads(service.answer(request_))
    assert sentence in answer["error"] and "\n" not in answer["error"] and set(answer) == {"id", "error"}
    assert fresh.stepper.t == before


def test_a_text_that_is_no_unicode_is_answered_as_it_came(service):
    assert json.loads(service.answer(b'{"id": "\\ud800", "steps": 0}'))["id"] == "\ud800"


@pytest.mark.long
def test_set_points_of_a_controller_must_be_given_at_each_start():
    vehicle = vehicles.load("remus_100")
    craft = Craft(vehicle, controller=vehicle.controller)
    served = Served(craft, craft.start(position=(0, 0, 3.0), speed=1.5, actuators={"propeller": 15.0}), 0.05)
    with pytest.raises(ArgumentError, match=r"The set points .*depth.* have no value yet"):
        served.advance({}, 1)
    served.advance({"depth": 3.0, "heading": 0.0, "speed": 1.5}, 100)
    served.advance({"depth": 4.0}, 100)
    assert 3.1 < served.reading().position[2] < 4.2
    assert set(served.reading().actuators) >= {"rudder", "stern_planes", "propeller"}
    served.reset()
    with pytest.raises(ArgumentError, match="have no value yet"):
        served.advance({"depth": 3.0}, 1)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["remus_100", "--ardupilot"], "one part of the kind `thrusters`"),
        ([NAME, "--ardupilot", "--frame", "quad"], "no frame `quad`"),
        ([NAME, "--ardupilot", "--controller"], "leave --controller out"),
        ([NAME, "--rate", "0"], "--rate, in steps a second, must be a number from 1"),
        ([NAME, "--depth", "nan"], "--depth, measured downwards, must be a finite number"),
        ([NAME, "--depth", "-1"], "must be a finite number from 0, but is -1"),
        ([NAME, "--idle", "-1"], "--idle must be positive"),
        ([NAME, "--answers", "0"], "--answers must be positive"),
        ([NAME, "--port", "99999"], "a number from 0 to 65535"),
        ([NAME, "--host", "no.such.host.invalid"], "cannot be listened to"),
        (["bluerov"], "No vehicle `bluerov`"),
    ],
)
def test_a_service_that_cannot_be_given_is_one_sentence(capsys, arguments, sentence):
    assert main(["serve", *arguments]) == 2
    told = capsys.readouterr().err
    assert sentence in told and len(told.strip().splitlines()) == 1


@pytest.mark.long
def test_the_command_ends_when_nothing_comes_and_prints_its_figures(capsys):
    assert main(["serve", NAME, "--ardupilot", "--port", "0", "--idle", "0.01", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["answers"] == 0
