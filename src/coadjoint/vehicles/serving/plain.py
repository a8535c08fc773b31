"""The same loop for any program: a JSON object in a datagram, and one in answer."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from coadjoint.errors import ArgumentError, StepError, shown
from coadjoint.groups.attitude import to_quaternion
from coadjoint.mechanics.state import State
from coadjoint.vehicles.serving.served import Reading, Served

PORT = 9010
MOST_STEPS, LONGEST_ID = 100_000, 200
KEYS = ("id", "commands", "steps", "reset")


def fields(reading: Reading) -> dict[str, Any]:
    """What is known at a node, by name; quaternion (w, x, y, z), from body to space."""
    found = {**reading._asdict(), "quaternion": to_quaternion(reading.rotation)}
    del found["rotation"]
    found["actuators"] = {name: _plain(value) for name, value in reading.actuators.items()}
    return {name: _plain(value) for name, value in found.items()}


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


class Service:
    """Answers requests {"id": 7, "commands": {"propeller": 15.0}, "steps": 2} with what is known after the steps.

    All keys may be left out: without `commands` they stay, without `steps` there is one step, with 0 there is none.
    `reset`: true goes back to the start, and an object to another one, with keys of `start`; commands go back to where
    they began. A request with the `id` of the last one, a whole number or a text, is answered as that was, and not
    carried out again, so that what was lost can be sent again. `counts` tells of requests and of those with errors.
    An answer has `id`, and `error`, a sentence, where a request cannot be carried out: then nothing has moved. Where a
    step fails the craft stays at the last good node until `reset`.
    """

    def __init__(self, served: Served, start: Callable[..., State]):
        self.served, self.start = served, start
        self.counts: Counter[str] = Counter()
        self._last: Any = None
        self._answer = b""

    def answer(self, data: bytes) -> bytes:
        """The answer to a request, a line."""
        number = None
        try:
            request = _request(data)
            number = _number(request)
            if number is not None and number == self._last:
                return self._answer
            self._carry_out(request)
            found: dict[str, Any] = fields(self.served.reading())
        except (ArgumentError, StepError) as error:
            found = {"error": str(error)}
            self.counts["errors"] += 1
        self.counts["requests"] += 1
        answer = json.dumps({"id": number, **found}, allow_nan=False) + "\n"
        self._last, self._answer = number, answer.encode()
        return self._answer

    def _carry_out(self, request: Mapping[str, Any]) -> None:
        steps, commands, reset = request.get("steps", 1), request.get("commands", {}), request.get("reset", False)
        if not isinstance(steps, int) or isinstance(steps, bool) or not 0 <= steps <= MOST_STEPS:
            raise ArgumentError(f"`steps` must be a whole number from 0 to {MOST_STEPS}, but is {shown(steps)}.")
        if not isinstance(commands, dict):
            raise ArgumentError(f"`commands` must be an object of names and numbers, but is {shown(commands)}.")
        if not isinstance(reset, (bool, dict)):
            raise ArgumentError(f'`reset` must be true, or an object such as {{"speed": 1.5}}, but is {shown(reset)}.')
        if isinstance(reset, dict):
            self.served.reset(_started(self.start, reset))
        elif reset:
            self.served.reset()
        if steps:
            self.served.advance(commands, steps)
        elif commands:
            raise ArgumentError("`commands` need at least one step over which they are held.")

    @property
    def t(self) -> float:
        """The time of the craft, s."""
        return float(self.served.stepper.t)


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number of JSON.")


def _request(data: bytes) -> dict[str, Any]:
    try:
        found = json.loads(data, parse_constant=_no_number)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise ArgumentError(f'A request is a JSON object such as {{"steps": 2}}, without NaN, but {data[:40]!r} came.')
    unknown = [key for key in found if key not in KEYS]
    if unknown:
        raise ArgumentError(f"A request has the keys {', '.join(KEYS)}, but not {', '.join(unknown)}.")
    return found


def _number(request: Mapping[str, Any]) -> int | str | None:
    found = request.get("id")
    whole = isinstance(found, int) and not isinstance(found, bool) and abs(found) < 2**63
    if found is None or whole or (isinstance(found, str) and len(found) <= LONGEST_ID):
        return found
    raise ArgumentError(
        f"`id` must be a whole number or a text of at most {LONGEST_ID} letters, but is {shown(found)}."
    )


def _started(start: Callable[..., State], given: Mapping[str, Any]) -> State:
    known = ("position", "speed", "velocity", "euler_zyx", "angular_velocity", "actuators")
    unknown = [key for key in given if key not in known]
    if unknown:
        raise ArgumentError(f"`reset` has the keys {', '.join(known)}, but not {', '.join(unknown)}.")
    return start(**{"speed": None, **given}) if "velocity" in given else start(**given)
