"""Whatever datagrams come, the service goes on, answers the next good one, and answers errors sparingly."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from functools import partial
from itertools import count
from typing import Any

import pytest
from datagrams import mutated

import coadjoint as co
from autopilot import listening, packet
from coadjoint.errors import ArgumentError, CoadjointError
from coadjoint_vehicles.serving.ardupilot import MOST_RATES, Rates
from coadjoint_vehicles.serving.loop import Loop
from coadjoint_vehicles.serving.plain import MOST_ERRORS, Service
from coadjoint_vehicles.serving.served import Served

DEPTH = (0.0, 0.0, 2.0)
PULSES = [1500] * 8


def service(served: Served, clock: Any = None) -> Service:
    start = partial(served.craft.start, position=DEPTH, speed=0.0)
    return Service(served, start, count().__next__ if clock is None else clock)


@pytest.mark.parametrize("number", [60, pytest.param(2000, marks=pytest.mark.long)])
def test_changed_datagrams_raise_nothing_but_sentences_and_leave_a_service_that_answers(fresh, lockstep, number):
    plain, answered = service(fresh), 0
    for data in mutated(1, number):
        answer = plain.answer(data)
        if answer is not None:
            found = json.loads(answer)
            answered += 1
            assert "error" not in found or ("\n" not in found["error"] and len(found["error"]) < 1000)
        try:
            lockstep.answer(data)
        except CoadjointError as error:
            assert "\n" not in str(error)
    assert answered > 0.95 * number and plain.counts["errors"] > number / 2
    assert lockstep.counts["frames"] > 0.1 * number
    after = json.loads(plain.answer(b'{"reset": true, "steps": 0}') or b"")
    assert after["position"] == list(DEPTH) and after["t"] == 0
    assert plain.answer(b'{"steps": 1}') and lockstep.answer(packet(10**6, PULSES))


def thrown(data: bytes, address: tuple[str, int]) -> None:
    """Send a datagram without waiting for an answer."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.sendto(data, address)


class Fragile:
    """Fails at what it is sent, as no service should."""

    t = 0.0

    def answer(self, data: bytes) -> bytes:
        if data == b"good":
            return data
        raise {b"memory": MemoryError, b"type": TypeError, b"step": co.errors.StepError}[data]("no\x1b[2J")


def test_no_error_ends_the_loop(caplog):
    loop = Loop("127.0.0.1", 0)
    address = loop.address
    with listening(loop, Fragile(), 1) as ask:
        for data in (b"memory", b"type", b"step", b"other"):
            thrown(data, address)
        assert ask(b"good") == b"good"
    assert loop.refused == 4 and loop.answers == 1
    assert len([record for record in caplog.records if record.name.startswith("coadjoint")]) == 1


def test_errors_are_answered_at_most_ten_times_a_second_and_good_requests_always(fresh):
    now = 100.0
    plain = service(fresh, lambda: now)
    answers = []
    for _ in range(1000):  # of ten seconds, one every 10 ms
        now += 0.01
        answers.append((now, plain.answer(b"no json")))
        assert plain.answer(b'{"steps": 0}') is not None
    times = [at for at, answer in answers if answer is not None]
    assert len(times) == 10 * MOST_ERRORS and plain.counts["unanswered"] == 1000 - len(times)
    assert all(sum(start <= at < start + 0.999 for at in times) <= MOST_ERRORS for start in times)


def test_a_request_with_an_error_that_comes_again_is_answered_as_sparingly(fresh):
    plain = service(fresh, lambda: 5.0)
    found = [plain.answer(b'{"id": 3, "steps": -1}') for _ in range(50)]
    assert found[:MOST_ERRORS] == [found[0]] * MOST_ERRORS and found[MOST_ERRORS:] == [None] * (50 - MOST_ERRORS)
    assert plain.counts["errors"] == 1


@pytest.mark.parametrize("data", [b"no json", b'{"id": 1, "steps": -1}', b'{"steps": 0}'])
def test_two_services_that_answer_each_other_fall_silent(fresh, data):
    here, there, sent = service(fresh), service(fresh), 0
    answer: bytes | None = data
    while answer is not None and sent < 10:
        answer, here, there, sent = here.answer(answer), there, here, sent + 1
    assert answer is None and sent <= 3
    assert here.counts["ignored"] + there.counts["ignored"] == 1


@pytest.mark.cases(6)
@pytest.mark.parametrize(
    "request_",
    [
        {"reset": {"actuators": 1}},
        {"reset": {"actuators": {"thrusters": [[1], 2]}}},
        {"reset": {"actuators": {"thrusters": {"a": 1}}}},
        {"reset": {"actuators": [1]}},
        {"reset": {"velocity": [1e308, 0, 0]}, "steps": 0},
        {"reset": True, "commands": {"rudder": 1}},
        {"reset": True, "commands": {"thrusters": [0] * 7}},
        {"reset": {"velocity": [1e200, 0, 0]}, "steps": 3},
    ],
)
def test_a_reset_that_cannot_be_carried_out_moves_nothing(fresh, request_):
    plain = service(fresh)
    plain.answer(json.dumps({"commands": {"thrusters": [1550] * 8}, "steps": 20}).encode())
    before = plain.answer(b'{"steps": 0}')
    assert "error" in json.loads(plain.answer(json.dumps(request_).encode()) or b"")
    assert plain.answer(b'{"steps": 0}') == before
    assert "error" not in json.loads(plain.answer(b'{"steps": 5}') or b"")


def test_a_frame_whose_step_fails_is_counted_and_the_next_one_is_answered(lockstep, fresh, monkeypatch):
    loop = Loop("127.0.0.1", 0)
    broken: Iterator[bool] = iter([False, True, True, False])
    advance = fresh.advance

    def failing(commands, steps):
        if next(broken):
            raise co.errors.StepError("The step did not converge.")
        advance(commands, steps)

    monkeypatch.setattr(fresh, "advance", failing)
    address = loop.address
    with listening(loop, lockstep, 2) as ask:
        ask(packet(0, PULSES))
        for _ in range(2):
            thrown(packet(1, PULSES), address)
        ask(packet(1, PULSES))
    assert lockstep.counts == {"frames": 2, "failed": 2} and loop.refused == 2 and loop.answers == 2


def test_a_vehicle_whose_step_failed_stays_at_the_last_good_node_and_can_be_stepped_again(lockstep, fresh, craft):
    good = lockstep.answer(packet(0, PULSES))
    fresh.stepper.restore(craft.start(position=DEPTH, angular_velocity=(1e5, 2e5, 0)))
    for number in (1, 2):
        with pytest.raises(co.errors.StepError):
            lockstep.answer(packet(number, PULSES))
        assert not fresh.stepper.failed
    assert lockstep.counts == {"frames": 1, "failed": 2} and lockstep.answer(packet(0, PULSES)) == good
    fresh.reset()
    assert b"timestamp" in lockstep.answer(packet(3, PULSES))
    assert lockstep.counts["lost"] == 2


def test_frame_rates_are_prepared_once_each_and_others_are_refused():
    made = []

    def make(rate: float) -> Any:
        made.append(rate)
        if rate < 10:
            raise ArgumentError("It is too slow.")
        return object()

    rates = Rates(make)
    first = rates(400)
    for _ in range(20):
        assert rates(400) is first and rates(100) is rates(100)
        with pytest.raises(ArgumentError, match="too slow"):
            rates(5)
    rates(200)
    for rate in (300, 50, 65535):
        with pytest.raises(ArgumentError, match=rf"frame rate {rate} Hz after {MOST_RATES} others: give --rate"):
            rates(rate)
    with pytest.raises(ArgumentError, match="0 Hz: give --rate"):
        rates(0)
    assert made == [400, 100, 5, 200] and rates(400) is first
    only = Rates(make, 50.0)
    assert only(300) is only(0) and made[4:] == [50]


def test_an_answer_that_reached_no_port_does_not_end_the_loop(monkeypatch):
    """Windows says so at the next datagram, by an error."""
    loop, came = Loop("127.0.0.1", 0), iter([ConnectionResetError(10054, "no port"), None])
    own = loop._socket

    class Windows:
        def recvfrom(self, most):
            if error := next(came):
                raise error
            return own.recvfrom(most)

        def __getattr__(self, name):
            return getattr(own, name)

    monkeypatch.setattr(loop, "_socket", Windows())
    with listening(loop, Echo(), 1) as ask:
        assert ask(b"good") == b"good"


class Echo:
    """Answers what comes."""

    t = 0.0

    def answer(self, data: bytes) -> bytes:
        return data
