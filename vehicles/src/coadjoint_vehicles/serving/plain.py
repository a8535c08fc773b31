"""The same loop for any program: a JSON object in a datagram, and one in answer."""

from __future__ import annotations

import json
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, StepError, shown
from coadjoint.groups.attitude import to_quaternion
from coadjoint.mechanics import State
from coadjoint_vehicles.serving.served import Reading, Served

PORT = 9010
MOST_STEPS, LONGEST_ID = 100_000, 200
KEYS = ("id", "commands", "steps", "reset")
MOST_ERRORS = 10
"""How many errors are answered within a second."""


def fields(reading: Reading) -> dict[str, PyTree]:
    """The reading at a node, by name; quaternion (w, x, y, z), from body to space."""
    found = {**reading._asdict(), "quaternion": to_quaternion(reading.rotation)}
    del found["rotation"]
    found["actuators"] = {name: _plain(value) for name, value in reading.actuators.items()}
    return {name: _plain(value) for name, value in found.items()}


def _plain(value: object) -> PyTree:
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


class Service:
    """Answers requests {"id": 7, "commands": {"propeller": 15.0}, "steps": 2} with the reading after the steps.

    All keys may be left out: without `commands` they stay, without `steps` there is one step, with 0 there is none.
    `reset`: true goes back to the start, and an object to another one, with keys of `start`; commands go back to where
    they began. A request with the `id` of the last one, an integer or a text, gets the same answer and is not carried
    out again, so that it can be sent again after a loss. An answer has `id`, and `error`, a sentence, where a request
    cannot be carried out: then nothing has moved. Where a step fails without a reset, the craft stays at the last good
    node until `reset`. At most `MOST_ERRORS` errors are answered within a second, and a message with the key `error` is
    not answered, so that two services never answer each other's errors. `counts` has the requests, those with errors,
    the errors that were not answered, and the errors of others. clock: seconds.
    """

    def __init__(self, served: Served, start: Callable[..., State], clock: Callable[[], float] = time.monotonic):
        self.served, self.start = served, start
        self.counts: Counter[str] = Counter()
        self._last: object = None
        self._answer, self._wrong = b"", False
        self._clock = clock
        self._errors: deque[float] = deque(maxlen=MOST_ERRORS)

    def answer(self, data: bytes) -> bytes | None:
        """The answer to a request, a line; None for no answer."""
        number = None
        try:
            request = _parsed(data)
            if "error" in request:
                self.counts["ignored"] += 1
                return None
            number = _number(request)
            if number is not None and number == self._last:
                return self._sparingly()
            _require_known(request, KEYS, "A request")
            self._carry_out(request)
            found: dict[str, PyTree] = fields(self.served.reading())
        except (ArgumentError, StepError) as error:
            found = {"error": str(error)}
            self.counts["errors"] += 1
        self.counts["requests"] += 1
        answer = json.dumps({"id": number, **found}, allow_nan=False) + "\n"
        self._last, self._answer, self._wrong = number, answer.encode(), "error" in found
        return self._sparingly()

    def _sparingly(self) -> bytes | None:
        """The last answer; None for an error after too many others within a second."""
        if self._wrong:
            now, full = self._clock(), len(self._errors) == MOST_ERRORS
            if full and now - self._errors[0] < 1.0:
                self.counts["unanswered"] += 1
                return None
            self._errors.append(now)
        return self._answer

    def _carry_out(self, request: Mapping[str, PyTree]) -> None:
        steps, commands, reset = request.get("steps", 1), request.get("commands", {}), request.get("reset", False)
        checks.whole(steps, "`steps`", 0, MOST_STEPS)
        checks.instance(commands, "`commands`", dict, "an object of names and numbers")
        checks.instance(reset, "`reset`", (bool, dict), 'true, or an object such as {"speed": 1.5}')
        if commands and not steps:
            raise ArgumentError("`commands` need at least one step over which they are held.")
        with nullcontext() if reset is False else self.served.intact():
            if isinstance(reset, dict):
                self.served.reset(_started(self.start, reset))
            elif reset:
                self.served.reset()
            if steps:
                self.served.advance(commands, steps)

    @property
    def t(self) -> float:
        """The time of the craft, s."""
        return float(self.served.stepper.t)


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is not a number of JSON.")


def _parsed(data: bytes) -> dict[str, object]:
    try:
        found = json.loads(data, parse_constant=_no_number)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise ArgumentError(f'A request is a JSON object such as {{"steps": 2}}, without NaN, but {data[:40]!r} came.')
    return found


def _require_known(given: Mapping[str, object], known: Sequence[str], what: str) -> None:
    unknown = [key for key in given if key not in known]
    if unknown:
        raise ArgumentError(f"{what} has the keys {', '.join(known)}, but not {shown(', '.join(unknown))[1:-1]}.")


def _number(request: Mapping[str, PyTree]) -> int | str | None:
    found = request.get("id")
    whole = isinstance(found, int) and not isinstance(found, bool) and abs(found) < 2**63
    if found is None or whole or (isinstance(found, str) and len(found) <= LONGEST_ID):
        return found
    raise ArgumentError(
        f"`id` must be a whole number or a text of at most {LONGEST_ID} letters, but is {shown(found)}."
    )


def _started(start: Callable[..., State], given: Mapping[str, object]) -> State:
    known = ("position", "speed", "velocity", "euler_zyx", "angular_velocity", "actuators")
    _require_known(given, known, "`reset`")
    return start(**{"speed": None, **given}) if "velocity" in given else start(**given)
