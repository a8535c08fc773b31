"""Several processes that do the same at the same time, some of which are killed."""

from __future__ import annotations

import hashlib
import os
import random
import re
import signal
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import coadjoint as co
from coadjoint import disk

HELD = re.compile(
    r"is in use by (?:process (\d+)|another process): wait until it ends, then the same call again goes on"
)


class Outcome(NamedTuple):
    """How a process ended: what its call returned, the sentence that it raised, or neither if it was killed."""

    process: int
    found: str = ""
    refused: str = ""

    @property
    def killed(self) -> bool:
        """Whether it said nothing."""
        return not (self.found or self.refused)


def at_once(run: Callable[[], str], kills: Sequence[int | None], seed: int) -> list[Outcome]:
    """`run` in a process for each of `kills`: before which of its operations on the disk it is killed, None for none.

    Pauses of random length before operations let the processes meet at other places each time.
    """
    ready, go = os.pipe()
    children = [_begun(run, kill, f"{seed} {number}", (ready, go)) for number, kill in enumerate(kills)]
    os.close(ready)
    os.close(go)  # this is when they begin
    found = []
    for process, answer in children:
        with open(answer, encoding="utf-8") as file:
            word, _, rest = file.read().partition(" ")
        os.waitpid(process, 0)
        found.append(Outcome(process, **{word: rest} if word else {}))
    return found


def _begun(run: Callable[[], str], kill: int | None, seed: str, start: tuple[int, int]) -> tuple[int, int]:
    answer, tell = os.pipe()
    process = os.fork()
    if process:
        os.close(tell)
        return process, answer
    try:
        os.close(start[1])
        os.read(start[0], 1)
        disk.before = _hindered(kill, random.Random(seed))
        word = _answer(run)
        os.write(tell, word.encode())
    finally:
        os._exit(0)


def _answer(run: Callable[[], str]) -> str:
    try:
        return f"found {run()}"
    except co.errors.FileError as error:
        return f"refused {error}"
    except BaseException as error:
        return f"refused {type(error).__name__} {error}"


def _hindered(kill: int | None, generator: random.Random) -> Callable[[str, Path], None]:
    left, often = kill, generator.choice([0.02, 0.1, 0.5])

    def before(operation: str, path: Path) -> None:
        nonlocal left
        if left is not None:
            if left == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            left -= 1
        if generator.random() < often:
            time.sleep(generator.choice([0.0, 0.001, 0.01]))

    return before


def require_sound(outcomes: list[Outcome], expected: str) -> None:
    """Each process was killed, returned what was expected, or named the one that has the folder; one got on."""
    processes = {outcome.process for outcome in outcomes}
    for outcome in outcomes:
        assert outcome.found in ("", expected), outcome
        if outcome.refused:
            who = HELD.search(outcome.refused)
            assert who, outcome
            assert who[1] is None or int(who[1]) in processes, outcome
    assert any(outcome.killed or outcome.found for outcome in outcomes), outcomes


def summed(dataset: Any) -> str:
    """All variables of a dataset as one number."""
    found = hashlib.sha256()
    for name, values in sorted(dataset.variables.items()):
        found.update(str(name).encode() + values.values.tobytes())
    return found.hexdigest()
