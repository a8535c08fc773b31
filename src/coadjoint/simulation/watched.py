"""What runs observe at every step: each variable with its meaning, its unit and its line on the card."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from coadjoint.extensions import import_string


@dataclass(frozen=True)
class Watched:
    """A variable that a monitor gives, or several whose names begin alike, as `work` stands for `work_drag`.

    meaning: what datasets say of it. unit: a unit, or with `like` that of another variable of the system. line: how the
    card shows it under its `title`: how much it changed, how well a budget closes, or its largest value, which is
    `largest`; empty where it has none. axis: the dimension of its components in datasets.
    """

    name: str
    meaning: str
    unit: str = ""
    like: str = ""
    line: Literal["", "change", "budget", "residual"] = ""
    title: str = ""
    largest: str = ""
    axis: str = "quantity"


@dataclass(frozen=True)
class Monitor:
    """A function (system, step, record, h, constants) → {name: value} of every step, and what it gives.

    when: (system, method, state) → whether runs of this system by this method observe it.
    """

    observe: Callable[..., Any]
    watched: tuple[Watched, ...]
    when: Callable[..., bool]

    def __call__(self, system: Any, step: Any, record: Any, h: Any, constants: Any) -> Any:
        return self.observe(system, step, record, h, constants)

    def __reduce__(self) -> Any:
        """By its name in the module of its function, which it stands for there; otherwise by what it holds."""
        module, name = self.observe.__module__, getattr(self.observe, "__name__", "")
        if getattr(sys.modules.get(module), name, None) is self:
            return import_string, (f"{module}:{name}",)
        return Monitor, (self.observe, self.watched, self.when)


def monitor(*watched: Watched, when: Callable[..., bool]) -> Callable[[Callable[..., Any]], Monitor]:
    """Make a function a monitor of these variables."""
    return lambda function: Monitor(function, watched, when)
