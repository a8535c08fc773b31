"""The progress of runs over a second: a bar on a terminal, a line in a notebook; log messages over ten seconds."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from typing import Any

from coadjoint.errors import printable
from coadjoint.log import logger

_log = logger(__name__)

_QUIET_SECONDS = 1.0

LOGGED_SECONDS = 10.0
"""Between log messages of a run."""


def notebook() -> Any:
    """IPython's `display` if this process serves a notebook; None otherwise."""
    found = sys.modules.get("IPython")
    shell = found.get_ipython() if found is not None else None
    return found.display.display if found is not None and hasattr(shell, "kernel") else None


class _Line:
    """A line in the cell of a notebook, in place of a bar."""

    def __init__(self, display: Any):
        self.held = display({"text/plain": ""}, raw=True, display_id=True)
        self.title, self.total = "", None

    def add_task(self, title: str, total: int | None, speed: str) -> int:
        self.title, self.total = title, total
        return 0

    def update(self, _: int, completed: int, speed: str) -> None:
        of = "" if self.total is None else f" of {self.total:,} ({completed / max(self.total, 1):.0%})"
        self.held.update({"text/plain": f"{self.title}: {completed:,}{of}, {speed}"}, raw=True)

    def stop(self) -> None:
        self.held.update({"text/plain": ""}, raw=True)


@contextmanager
def compiling(title: str, what: str, wanted: bool | None) -> Iterator[None]:
    """A line on the terminal while a step is compiled for longer than a second; nothing if `what` is empty."""
    if not what or not (sys.stderr.isatty() if wanted is None else wanted):
        yield
        return
    from rich.console import Console
    from rich.status import Status
    from rich.text import Text

    status = Status(Text(printable(f"{title}: compiling a step {what}")), console=Console(stderr=True))
    late = Timer(_QUIET_SECONDS, status.start)
    late.daemon = True
    late.start()
    try:
        yield
    finally:
        late.cancel()
        late.join()
        status.stop()


class Progress:
    """Steps done, remaining time and speed; shown when the run has taken a second, and gone when it ends.

    steps: the total number of steps; None if unknown.
    """

    def __init__(self, steps: int | None, wanted: bool | None, title: str, unit: str = "steps"):
        self.steps, self.title, self.unit = steps, printable(title), unit
        self.display = notebook()
        self.wanted = self.display is not None or sys.stderr.isatty() if wanted is None else wanted
        self.done = 0
        self._logged = 0.0
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def advance(self, steps: int, seconds: float) -> None:
        """`steps` more are done, after `seconds` of running in all."""
        self.done += steps
        if seconds >= self._logged + LOGGED_SECONDS:
            self._logged = seconds
            speed, of = self.done / seconds, "" if self.steps is None else f" of {self.steps}"
            _log.info("%s: %d%s %s, %.3g %s/s.", self.title, self.done, of, self.unit, speed, self.unit)
        if not self.wanted or seconds < _QUIET_SECONDS:
            return
        if self._bar is None:
            self._bar = self._make() if self.display is None else _Line(self.display)
            self._task = self._bar.add_task(self.title, total=self.steps, speed="")
        self._bar.update(self._task, completed=self.done, speed=f"{self.done / seconds:,.3g} {self.unit}/s")

    @staticmethod
    def _make() -> Any:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        title = TextColumn("{task.description}", markup=False)
        columns = (title, BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        bar = Bar(*columns, TextColumn("{task.fields[speed]}"), console=Console(stderr=True), transient=True)
        bar.start()
        return bar
