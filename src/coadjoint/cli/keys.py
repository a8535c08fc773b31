"""The command `coadjoint keys`: what may stand in each section of each kind of file, from the sections' own fields."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import tyro

from coadjoint.cli import terminal
from coadjoint.cli.metavars import called
from coadjoint.extensions import Registry, import_string

if TYPE_CHECKING:
    from coadjoint.sections import KeyRow

FILES: Registry[str] = Registry(
    "KEYS", {"run files": "coadjoint.runs.run_file:declared", "sweep files": "coadjoint.sweeps.file:declared"}
)
"""Kinds of files: "module:function", () → the dataclass of each section by its name in files."""

HEADS = ("key", "unit", "default", "meaning")


@dataclass(frozen=True)
class Keys:
    """List the keys of files with unit, default and meaning: `coadjoint keys`, `coadjoint keys run`."""

    BEGINS: ClassVar[str] = "Reading the sections of all files."

    section: Annotated[tyro.conf.Positional[str], called("[SECTION]")] = ""
    """A section, such as `run` or `output`; without it all sections of all kinds of files."""
    markdown: bool = False
    """Print the page docs/keys.md, and nothing else."""
    json: bool = False
    """Print JSON, and nothing else."""

    def __call__(self) -> int:
        from coadjoint.checks import known

        found = declared_keys()
        if self.section:
            named = self.section.strip("[]")
            known(named, {name for sections in found.values() for name in sections}, "section", "A file")
            found = {file: {named: of[named]} for file, of in found.items() if named in of}
        if self.json:
            terminal.json(
                {file: {name: [row._asdict() for row in of[name]] for name in of} for file, of in found.items()}
            )
        elif self.markdown:
            terminal.text(page(found))
        else:
            for file, sections in found.items():
                for name, listed in sections.items():
                    terminal.line(f"\n[{name}] of {file}")
                    terminal.table(HEADS, listed)
        return 0


def declared_keys() -> dict[str, dict[str, list[KeyRow]]]:
    """The keys of each section of each kind of file."""
    from coadjoint.sections import rows

    return {file: {name: rows(kind) for name, kind in import_string(place)().items()} for file, place in FILES.items()}


def page(found: dict[str, dict[str, list[KeyRow]]]) -> str:
    """The page of the documentation on these keys, in Markdown."""
    lines = [
        "# Keys of files",
        "",
        "After this page you know every key that a section declares, with its SI unit, its default and its meaning.",
        "`coadjoint keys` prints them, and `coadjoint keys --markdown` writes this page. A key may end in another unit",
        "of the same dimension, as `duration_min`, and is in SI units without one. Further pages explain",
        "[run files](commands.md#run-files), [sweeps](sweeps.md), [missions](missions.md) and [vehicles](vehicles.md).",
        "",
        "```sh",
        "coadjoint keys run",
        "```",
    ]
    written: dict[tuple[KeyRow, ...], str] = {}
    for file, sections in found.items():
        lines += ["", f"## {file[:1].upper()}{file[1:]}"]
        shared = _shared(sections)
        for name, listed in sections.items():
            section, _, kind = name.partition(", ")
            common = shared.get(section, []) if kind else []
            if common and name == next(one for one in sections if one.startswith(f"{section}, ")):
                lines += ["", f"### `[{section}]` of {file}: all kinds", "", *_points(common)]
            own = [row for row in listed if row not in common]
            same = written.setdefault(tuple(own), title := f"`[{name}]` of {file}")
            points = _points(own) if same is title else [f"As {same}."]
            lines += ["", f"### {title}", "", *(points if own else ["No others."])]
    return "\n".join(lines) + "\n"


def _shared(sections: dict[str, list[KeyRow]]) -> dict[str, list[KeyRow]]:
    """The rows that all kinds of a section share, as "sensors, imu" and "sensors, gps" share `rate`."""
    kinds: dict[str, list[list[KeyRow]]] = {}
    for name, listed in sections.items():
        section, _, kind = name.partition(", ")
        if kind:
            kinds.setdefault(section, []).append(listed)
    return {
        section: [row for row in listed[0] if all(row in other for other in listed)]
        for section, listed in kinds.items()
        if len(listed) > 1
    }


def _points(listed: Iterable[KeyRow]) -> list[str]:
    """A line for each key, as in "- `dt`, s, needed: the length of a step"."""
    return [f"- {', '.join(filter(None, (f'`{row.key}`', row.unit, row.default)))}: {row.meaning}" for row in listed]
