"""A progress bar for runs that take longer than a second, on a terminal only."""

from __future__ import annotations

import sys
from typing import Any

_QUIET_SECONDS = 1.0


class Progress:
    """Steps done, remaining time and speed; shown when the run has taken a second, and gone when it ends."""

    def __init__(self, steps: int, wanted: bool | None, title: str, unit: str = "steps"):
        self.steps, self.title, self.unit = steps, title, unit
        self.wanted = sys.stderr.isatty() if wanted is None else wanted
        self.done = 0
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
        if not self.wanted or seconds < _QUIET_SECONDS:
            return
        if self._bar is None:
            self._bar = self._make()
            self._task = self._bar.add_task(self.title, total=self.steps, speed="")
        self._bar.update(self._task, completed=self.done, speed=f"{self.done / seconds:,.3g} {self.unit}/s")

    @staticmethod
    def _make() -> Any:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        columns = ("{task.description}", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        bar = Bar(*columns, TextColumn("{task.fields[speed]}"), console=Console(stderr=True), transient=True)
        bar.start()
        return bar
