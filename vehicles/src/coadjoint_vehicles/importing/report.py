"""The report of an import: imported values, differences from the simulator, and omitted parts of the file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from coadjoint.errors import printable
from coadjoint.texts import Table


class Taken(NamedTuple):
    """One number of the vehicle file: its key, its value there, and where it was read."""

    key: str
    value: Any
    unit: str
    place: str


class Left(NamedTuple):
    """One thing of the files that is not in the vehicle file, and why."""

    place: str
    what: str
    why: str


LOOKS = "how it looks, not how it moves"
"""Why visuals and their like are not taken over."""


@dataclass
class Report:
    """taken: the numbers, each with file and line. impossible: numbers among them that no body has. left: parts of the
    files that are not imported. differs: where the vehicle moves otherwise than in the simulator. unsaid: values that
    the library needs and the format does not state. files: the files read."""

    format: str = ""
    taken: list[Taken] = field(default_factory=list)
    impossible: list[str] = field(default_factory=list)
    left: list[Left] = field(default_factory=list)
    differs: list[str] = field(default_factory=list)
    unsaid: list[str] = field(default_factory=list)
    files: list[str] = field(default_factory=list)
    flies: str = ""
    """Its actuators, and the controllers that fit."""
    doubts: list[str] = field(default_factory=list)
    """Warnings about the vehicle."""
    current: tuple[float, ...] = ()
    """North, east, down, m/s, that the description gives; empty without one."""
    held: str = ""
    """A sentence on a model that does not move there; empty for one that does."""
    missing: str = ""
    """A sentence on included files and macros that are not there; empty without them."""
    starts: dict[str, float] = field(default_factory=dict)
    """The volumes of ballast at the start of the simulation, m³, beyond neutral, where they are not 0, by part."""

    def summary(self) -> Table:
        """All of it for JSON."""
        return {
            "format": self.format,
            "flies": self.flies,
            "doubts": self.doubts,
            "starts": self.starts,
            "current": list(self.current),
            "files": self.files,
            "taken": [{**row._asdict(), "value": np.asarray(row.value).tolist()} for row in self.taken],
            "impossible": self.impossible,
            "differs": self.differs,
            "left": [row._asdict() for row in self.left],
            "unsaid": self.unsaid,
        }

    def _alike(self) -> list[tuple[Left, int]]:
        """The omissions, once for each place and reason, with their counts."""
        counts: dict[tuple[str, str], tuple[Left, int]] = {}
        for row in self.left:
            first, times = counts.get((row.place, row.why), (row, 0))
            counts[row.place, row.why] = (first, times + 1)
        return list(counts.values())

    def __str__(self) -> str:
        """The line on flying and warnings first; what only says how the vehicle looks is counted."""
        looks = [row for row in self.left if row.why == LOOKS]
        lines = [f"{self.format}, read from {', '.join(self.files)}"]
        lines += [f"{self.flies}; not taken over: {self._counted(len(looks))}"] if self.flies else []
        lines += [f"Warning: {sentence}" for sentence in self.doubts]
        lines += ["", "Taken over:"]
        lines += [f"  {row.key} = {_shown(row.value)} {row.unit}  ({row.place})".rstrip() for row in self.taken]
        left = [f"{row.place}: {row.what}: {row.why}{_often(n)}" for row, n in self._alike() if row.why != LOOKS]
        for title, sentences in (
            ("Taken over, though no body has it:", self.impossible),
            ("Moves otherwise than there:", self.differs),
            ("Not taken over:", left),
            ("Not said by the format:", self.unsaid),
        ):
            if sentences:
                lines += ["", title, *(f"  {sentence}" for sentence in sentences)]
        return printable("\n".join(lines))

    def _counted(self, looks: int) -> str:
        """How many programs, sensors and others are left out, apart from looks."""
        kinds = {"plugin": 0, "sensor": 0, "other": 0}
        for row, _ in self._alike():
            if row.why != LOOKS:
                kinds[next((kind for kind in ("plugin", "sensor") if f"<{kind}>" in row.what), "other")] += 1
        said = [f"{count} {kind}{'s' if count > 1 else ''}" for kind, count in kinds.items() if count]
        return f"{', '.join(said) or 'nothing'}{f', and {looks} elements of looks' if looks else ''}"


def _often(times: int) -> str:
    return f" ({times} times)" if times > 1 else ""


def _shown(value: object) -> str:
    found = np.asarray(value, dtype=float)
    text = f"{float(found):.6g}" if found.ndim == 0 else np.array2string(found, precision=5, max_line_width=10_000)
    flat = " ".join(text.split())
    return flat if len(flat) <= 90 else flat[:87] + "…"
