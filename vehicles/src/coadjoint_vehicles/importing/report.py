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

    def summary(self) -> Table:
        """All of it for JSON."""
        return {
            "format": self.format,
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
        lines = [f"{self.format}, read from {', '.join(self.files)}", "", "Taken over:"]
        lines += [f"  {row.key} = {_shown(row.value)} {row.unit}  ({row.place})".rstrip() for row in self.taken]
        for title, sentences in (
            ("Taken over, though no body has it:", self.impossible),
            ("Moves otherwise than there:", self.differs),
            ("Not taken over:", [f"{row.place}: {row.what}: {row.why}{_often(n)}" for row, n in self._alike()]),
            ("Not said by the format:", self.unsaid),
        ):
            if sentences:
                lines += ["", title, *(f"  {sentence}" for sentence in sentences)]
        return printable("\n".join(lines))


def _often(times: int) -> str:
    return f" ({times} times)" if times > 1 else ""


def _shown(value: object) -> str:
    found = np.asarray(value, dtype=float)
    text = f"{float(found):.6g}" if found.ndim == 0 else np.array2string(found, precision=5, max_line_width=10_000)
    flat = " ".join(text.split())
    return flat if len(flat) <= 90 else flat[:87] + "…"
