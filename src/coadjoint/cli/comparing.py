"""`coadjoint compare DIR DIR`: a comparison of two folders of results."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from coadjoint.cli import terminal
from coadjoint.cli.metavars import called
from coadjoint.errors import ArgumentError
from coadjoint.texts import Table

if TYPE_CHECKING:
    from coadjoint.report.comparison import Comparison


@dataclass(frozen=True)
class Compare:
    """Compare two runs: settings, conserved quantities, figures of missions and sea trials, the distance between them;
    figures of both with --out."""

    BEGINS: ClassVar[str] = "Reading {first} and {second}."

    first: Annotated[tyro.conf.Positional[Path], called("DIR|FILE")]
    """A folder that `run` wrote, or a file of a run."""
    second: Annotated[tyro.conf.Positional[Path], called("DIR|FILE")]
    """Another one."""
    out: Annotated[Path | None, called("DIR")] = None
    """A folder for comparison.json and figures of both runs."""
    json: bool = False
    """Print the comparison as JSON, and nothing else."""

    def __call__(self) -> int:
        from coadjoint.cli.results_folder import recordings
        from coadjoint.disk import write_text
        from coadjoint.plotting.plots import save_figures
        from coadjoint.report.comparison import compare, merits
        from coadjoint.report.folder import make
        from coadjoint.report.summary import to_json

        datasets = [_one(recordings(source), source).dataset for source in (self.first, self.second)]
        if self.out is not None:
            make(self.out)
        names = _names(self.first, self.second)
        found = compare(datasets[0], datasets[1], names)
        found = replace(found, merits=merits(_summary(self.first), _summary(self.second)))
        if self.json:
            terminal.text(to_json(found.summary()))
        else:
            show(found)
        if self.out is not None:
            write_text(self.out / "comparison.json", to_json(found.summary()))
            written = save_figures(datasets, self.out, labels=list(names))
            if not self.json:
                terminal.line(f"Written: {', '.join([f'{self.out}/comparison.json', *written])}.")
        return 0


def _one(found: Table, source: Path) -> Any:
    if len(found) > 1:
        raise ArgumentError(f"The folder {source} holds {len(found)} runs: name one of its files, {', '.join(found)}.")
    return next(iter(found.values()))


def _summary(source: Path) -> Table:
    """The numbers that a run left in its folder; of a file alone none."""
    from coadjoint.cli import results_folder
    from coadjoint.report.folder import SUMMARY

    return results_folder.summary(source) if (source / SUMMARY).is_file() else {}


def _names(first: Path, second: Path) -> tuple[str, str]:
    """Labels that distinguish the two: the names of the folders or files, or their full paths."""
    names = first.stem or str(first), second.stem or str(second)
    return names if names[0] != names[1] else (str(first), str(second))


def show(found: Comparison) -> None:
    """The comparison as tables."""
    terminal.table(("", *found.names), [(key, *map(_text, pair)) for key, pair in found.setting.items()])
    terminal.line("")
    rows = [(key.replace("_", " "), *map(_text, pair)) for key, pair in found.conserved.items()]
    terminal.table(("kept", *found.names), rows)
    terminal.line("")
    if found.merits:
        terminal.table(("mission", *found.names), [(key, *map(_text, pair)) for key, pair in found.merits.items()])
        terminal.line("")
    rows = [
        (name, f"{found.final[name]:.3e}", f"{found.largest[name]:.3e}", found.units[name])
        for name in sorted(found.largest, key=_order)
        if not name.startswith(_DETAILS)
    ]
    terminal.table((f"apart, {found.common:,} times", f"at {found.last:g} s", "at most", "unit"), rows)


def _text(value: object) -> str:
    if value is None:
        return "–"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


_DETAILS = ("inputs_", "internal_controller", "a_", "work_")
"""Variables that only the JSON contains."""
_FIRST = ("q", "euler_angles", "xi", "nu", "mu", "pi")


def _order(name: str) -> tuple[int, str]:
    return (_FIRST.index(name) if name in _FIRST else len(_FIRST), name)
