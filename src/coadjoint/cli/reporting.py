"""`coadjoint report DIR`: one page with the contents of a folder of results."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import tyro

from coadjoint.cli import terminal
from coadjoint.cli.metavars import called
from coadjoint.texts import Table

if TYPE_CHECKING:
    from coadjoint.report.page import Contents


@dataclass(frozen=True)
class Report:
    """Write a run as one HTML page: certificate, figures, numbers with their sources, and how to repeat it."""

    BEGINS: ClassVar[str] = "Reading {folder}."

    folder: Annotated[tyro.conf.Positional[Path], called("DIR")]
    """A folder that `run` or `reproduce` wrote."""
    figures: Annotated[tuple[str, ...], called("FIGURE …")] = ()
    """The figures in it, by default those that the run file lists, else the most informative ones."""
    out: Annotated[Path | None, called("FILE")] = None
    """The page to write, by default `report.html` in the folder."""
    scene: bool = False
    """Include the scene in space, 0.6 MB more."""
    json: bool = False
    """Print the file's name as JSON, and nothing else."""

    def __call__(self) -> int:
        from coadjoint.disk import write_text
        from coadjoint.errors import ArgumentError
        from coadjoint.report.folder import make
        from coadjoint.report.page import page

        if not self.folder.is_dir():
            raise ArgumentError(f"A report needs a folder that `coadjoint run` wrote, but {self.folder} is none.")
        target = self.out or self.folder / "report.html"
        text = page(contents(self.folder, self.figures, self.scene))
        make(target.parent)
        write_text(target, text)
        terminal.json(str(target), indent=None) if self.json else terminal.line(f"Written: {target}.")
        return 0


def contents(folder: Path, wanted: tuple[str, ...], with_scene: bool) -> Contents:
    """The contents of the report of a folder; raises FileError and ArgumentError."""
    from coadjoint.cli import results_folder
    from coadjoint.report.folder import RUN_FILE, SUMMARY
    from coadjoint.report.numbers import numbers
    from coadjoint.report.page import Contents
    from coadjoint.texts import text_of

    runs = results_folder.recordings(folder)
    summary = results_folder.summary(folder) if (folder / SUMMARY).exists() else {}
    settings = text_of(folder / RUN_FILE) if (folder / RUN_FILE).exists() else ""
    files, state = _files(folder)
    return Contents(
        title=_title(folder, runs, summary),
        command=_command(folder, summary),
        certificates={name: run.certificate for name, run in runs.items()},
        summary=summary,
        figures=_drawn(runs, wanted or _listed(folder)),
        numbers=numbers(folder) if settings else {},
        settings=settings,
        files=files,
        state=state,
        player=_player(runs) if with_scene else "",
    )


def _title(folder: Path, runs: Table, summary: dict[str, object]) -> str:
    names = dict.fromkeys(str(run.dataset.attrs.get("system", "")) for run in runs.values())
    return f"{', '.join(filter(None, names)) or 'A run'}: {folder.resolve().name}"


def _command(folder: Path, summary: Table) -> str:
    number = summary.get("versions", {}).get("coadjoint", "")
    repeated = "coadjoint run run.toml --out again" if (folder / "run.toml").exists() else "coadjoint reproduce"
    return "\n".join(
        [
            f"pip install coadjoint{f'=={number}' if number else ''}",
            f"{repeated}  # with the run.toml below, and the files of inputs/ where it names some",
            f"coadjoint compare {folder.resolve().name} again",
            f"coadjoint verify {folder.resolve().name}  # checks that the files are unchanged",
        ]
    )


def _listed(folder: Path) -> tuple[str, ...]:
    """The figures that the run file lists, without films, which a page of pictures cannot show."""
    from coadjoint.cli import results_folder
    from coadjoint.plotting.plots import figure_names

    return tuple(name for name in results_folder.figures_asked(folder) or () if name in figure_names(films=False))


def _drawn(runs: Table, wanted: tuple[str, ...]) -> list[tuple[str, str, str]]:
    from coadjoint.plotting.report_figures import svgs

    labels = list(runs) if len(runs) > 1 else None
    return svgs([run.dataset for run in runs.values()], wanted, labels)


def _files(folder: Path) -> tuple[list[tuple[str, int, str]], str]:
    """The files of the manifest, and whether they are unchanged."""
    from coadjoint.manifest import Manifest
    from coadjoint.report.verification import verify

    try:
        held = Manifest.read(folder)
    except FileNotFoundError:
        return [], ""
    found = verify(folder)
    state = (
        "; ".join(found.problems)
        if found.problems
        else f"All {found.files} files are unchanged since they were written."
    )
    return [(name, size, check) for name, (size, check) in held.files.items()], state


def _player(runs: Table) -> str:
    from coadjoint.plotting.entries import entries
    from coadjoint.plotting.player import Player
    from coadjoint.plotting.scene_of_runs import scene

    labels = list(runs) if len(runs) > 1 else None
    return Player(scene(entries(list(runs.values()), labels)))._repr_html_()
