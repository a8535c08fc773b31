"""A datagram in, an answer out: the loop over UDP, with its pace and its figures."""

from __future__ import annotations

import socket
import time
from typing import Protocol

import numpy as np

from coadjoint.errors import ArgumentError, CoadjointError, error_line
from coadjoint.extending import logger

_log = logger(__name__)

LARGEST = 65_536
WAITING = 0.2
"""How long one wait for a datagram is, s, after which an interrupt is seen."""

_EDGES = np.logspace(-7, 2, 901)
"""Between bins of lateness, s: 900 of them, each 2.3 % wide."""


class Answering(Protocol):
    """An object that answers datagrams: with bytes, or with None for no answer; raises for an unusable one."""

    def answer(self, data: bytes) -> bytes | None: ...

    @property
    def t(self) -> float: ...


class Lateness:
    """How late answers were, s, against the pace of real time: a histogram, and the largest."""

    def __init__(self) -> None:
        self._bins = np.zeros(len(_EDGES) + 1, np.int64)
        self.largest = 0.0

    def add(self, seconds: float) -> None:
        """One answer that was so late."""
        self._bins[np.searchsorted(_EDGES, seconds)] += 1
        self.largest = max(self.largest, seconds)

    def share(self, part: float) -> float:
        """The lateness, s, that this part of all answers did not exceed, to 2.3 %; NaN of none."""
        done = np.cumsum(self._bins)
        if not done[-1]:
            return float("nan")
        return float(min(_EDGES[min(int(np.searchsorted(done, part * done[-1])), len(_EDGES) - 1)], self.largest))


class Loop:
    """Answers datagrams on a UDP port, each to where it came from.

    paced: answers no sooner than the craft's time has passed on the clock since the first answer; `lateness` measures
    how well. No datagram ends the loop: one whose answer raises an error is counted in `refused` and not answered.
    `answers` and `unsent` count, too; `simulated` is the time of the craft, over all its starts, s, and `seconds` that
    of the clock from the first answer to the last. Raises ArgumentError where the port cannot be had.
    """

    def __init__(self, host: str, port: int, paced: bool = False):
        self.paced = paced
        self.answers = self.refused = self.unsent = 0
        self.simulated = self.seconds = 0.0
        self.lateness = Lateness()
        self._first: float | None = None
        self._began: float | None = None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            reason = getattr(error, "strerror", None) or "a port is a number from 0 to 65535"
            raise ArgumentError(f"Port {port} of host {host} cannot be listened to: {reason}.") from None
        self._socket.settimeout(WAITING)

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that are listened to."""
        return self._socket.getsockname()

    def run(self, answering: Answering, answers: int | None = None, idle: float | None = None) -> None:
        """Answer until interrupted, until so many `answers`, or until no datagram has arrived for `idle` seconds."""
        heard = time.monotonic()
        try:
            while answers is None or self.answers < answers:
                try:
                    data, sender = self._socket.recvfrom(LARGEST)
                except TimeoutError:
                    if idle is not None and time.monotonic() - heard > idle:
                        return
                    continue
                except ConnectionError:  # of Windows, where an answer reached no port; it may be of any datagram before
                    continue
                heard = time.monotonic()
                self._answer(answering, data, sender)
        finally:
            self._socket.close()

    def _answer(self, answering: Answering, data: bytes, sender: tuple[str, int]) -> None:
        before = answering.t
        try:
            answer = answering.answer(data)
        except Exception as error:  # Whatever a datagram does, the next one is answered.
            self.refused += 1
            if self.refused == 1:
                _log.warning("%s", error if isinstance(error, CoadjointError) else f"{error_line(error)}.")
            answer = None
        t = answering.t
        self.simulated += t - before if t >= before else t
        if answer is None:
            return
        self._pace(before, t)
        try:
            self._socket.sendto(answer, sender)
        except OSError as error:
            self.unsent += 1
            if self.unsent == 1:
                _log.warning("An answer to %s:%d could not be sent: %s.", *sender[:2], error.strerror)
        self.answers += 1

    def _pace(self, before: float, t: float) -> None:
        """Wait until the craft's time; its clock restarts at the first answer and when the craft goes back."""
        now = time.monotonic()
        self._first = now if self._first is None else self._first
        self.seconds = now - self._first
        if not self.paced:
            return
        if self._began is None or t < before:
            self._began = now - t
        due = self._began + t
        while (left := due - time.monotonic()) > 0:
            time.sleep(left)
        self.lateness.add(time.monotonic() - due)
