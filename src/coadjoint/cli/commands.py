"""The commands: a dataclass each, whose fields are its arguments."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import tyro

from coadjoint.cli import terminal
from coadjoint.cli.metavars import called

if TYPE_CHECKING:
    from coadjoint.report.reproduction import Reproduction
    from coadjoint.runs.running import Written

OK, FAILED = 0, 1


@dataclass(frozen=True)
class Reproduce:
    """Run section 5 of Ono, Fiori and Peng (2025) again: figures 1-3, trajectories, a report."""

    BEGINS: ClassVar[str] = "Reproducing section 5 of Ono, Fiori and Peng (2025)."

    out: Annotated[Path, called("DIR")] = Path("reproduction")
    """Output folder; one that holds another run is an error."""
    json: bool = False
    """Print the summary as JSON, and nothing else."""
    overwrite: bool = False
    """Repeat a reproduction that the folder holds already."""

    def __call__(self) -> int:
        from coadjoint.report.folder import SUMMARY
        from coadjoint.report.reproduce import reproduce
        from coadjoint.report.summary import to_json
        from coadjoint.texts import LARGEST_SUMMARY, file_text

        found = reproduce(self.out, overwrite=self.overwrite, progress=False if self.json else None)
        if found is None and self.json:
            terminal.text(file_text(self.out / SUMMARY, "summary", LARGEST_SUMMARY))
        elif found is None:
            terminal.line(f"The folder {self.out} holds this reproduction, finished: nothing was run.")
        elif self.json:
            terminal.text(to_json(found.summary()))
        else:
            _show_reproduction(found, self.out)
        return OK


@dataclass(frozen=True)
class Run:
    """Run a TOML file, of a system or of a vehicle's mission: `coadjoint run dive.toml --out dive`."""

    BEGINS: ClassVar[str] = "Reading {file}."

    file: Annotated[tyro.conf.Positional[Path], called("FILE")]
    """The run file, with sections system, parameters, initial, method, run and output, or the mission file."""
    out: Annotated[Path | None, called("DIR")] = None
    """Output folder, instead of the run file's; one that holds this run is finished, or shown if it is complete."""
    set: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="SECTION.KEY=VALUE")] = ()
    """A change to the run file, as in `--set run.dt=0.02`; repeatable, and `--set run.steps=` leaves a key out."""
    log: Annotated[Literal["mcap"] | None, called("mcap")] = None
    """A log of a mission next to its results: mcap, messages of ROS 2, as `--set output.mcap=true`."""
    check: bool = False
    """Report the errors of `run` without a step; nothing is written."""
    long: bool = False
    """Print every line of the certificate, in place of five."""
    json: bool = False
    """Print the summary as JSON, and nothing else."""
    overwrite: bool = False
    """Repeat a run that the folder holds already."""

    def __call__(self) -> int:
        from coadjoint.runs.identity import NOT_COMPARED
        from coadjoint.runs.run_file import read
        from coadjoint.runs.running import check, execute

        file = read(self.file, (*self.set, *["output.mcap=true"] * (self.log == "mcap")))
        folder = self.out or file.folder
        for code in file.code:
            terminal.complain(f"The run file runs {code}, which is outside of its folder.")
        if self.check:
            warnings = check(file, folder, self.overwrite)
            if self.json:
                terminal.json({"valid": True, "warnings": warnings}, indent=None)
            else:
                terminal.line(f"{self.file} is a run file; its results would go to {folder}/.")
                for sentence in warnings:
                    terminal.line(f"Warning: {sentence}")
            return OK
        written = execute(file, folder, self.overwrite, False if self.json else None)
        _show_run(written, self.json, self.long)
        if written.before and not written.compared and not self.json:
            terminal.line(NOT_COMPARED)
        return FAILED if written.failure else OK


@dataclass(frozen=True)
class Resume:
    """Continue an interrupted run, in the folder that `run` made: `coadjoint resume dive`."""

    BEGINS: ClassVar[str] = "Reading {folder}."

    folder: Annotated[tyro.conf.Positional[Path], called("DIR")]
    """The output folder of the run."""
    long: bool = False
    """Print every line of the certificate, in place of five."""
    json: bool = False
    """Print the summary as JSON, and nothing else."""

    def __call__(self) -> int:
        from coadjoint.runs.running import resume

        written = resume(self.folder, False if self.json else None)
        _show_run(written, self.json, self.long)
        return FAILED if written.failure else OK


@dataclass(frozen=True)
class Plot:
    """Draw the figures of a folder of results, or of a netCDF file, again."""

    BEGINS: ClassVar[str] = "Reading {source}."

    source: Annotated[tyro.conf.Positional[Path], called("DIR|FILE")]
    """A folder that `run` or `reproduce` wrote, or a file of a run. Several runs in one folder come into the same
    figures; `coadjoint compare DIR DIR --out DIR` draws those of two folders together."""
    figures: Annotated[tyro.conf.Positional[tuple[str, ...]], called("[FIGURE …]")] = ()
    """The figures to draw, by default those that the run file lists, or all; `animation` shows the motion."""
    out: Annotated[Path | None, called("DIR")] = None
    """Where to write them, by default next to the runs."""
    format: Literal["png", "pdf", "svg", "gif", "mp4", "html"] = "png"
    """The format of the figures; gif, mp4, or html for a page with the bodies in space, of an animation."""
    json: bool = False
    """Print the files as JSON, and nothing else."""

    def __call__(self) -> int:
        from coadjoint.cli.results_folder import figures_asked, recordings
        from coadjoint.errors import ArgumentError
        from coadjoint.plotting.plots import save_figures
        from coadjoint.report.folder import make

        if others := [name for name in self.figures if Path(name).is_dir()]:
            raise ArgumentError(
                f"`plot` draws one folder, but {others[0]} is another: `coadjoint compare {self.source} {others[0]} "
                "--out DIR` draws the figures of two together."
            )
        found = recordings(self.source)
        folder = self.out or (self.source if self.source.is_dir() else self.source.parent)
        make(folder)
        labels = list(found) if len(found) > 1 else None
        wanted = self.figures or figures_asked(self.source)
        names = save_figures([run.dataset for run in found.values()], folder, wanted, self.format, labels)
        paths = [str(folder / name) for name in names]
        terminal.json(paths, indent=None) if self.json else terminal.line("\n".join(paths))
        return OK


@dataclass(frozen=True)
class Info:
    """Show the contents of a folder of results, or of a netCDF file of a run."""

    BEGINS: ClassVar[str] = "Reading {source}."

    source: Annotated[tyro.conf.Positional[Path], called("DIR|FILE")]
    """A folder that `run` or `reproduce` wrote, or a file of a run."""
    long: bool = False
    """Print every line of the certificate, in place of five."""
    json: bool = False
    """Print the summary as JSON, and nothing else."""

    def __call__(self) -> int:
        from coadjoint.cli.results_folder import certificates, summary

        if self.json:
            terminal.json(summary(self.source))
        else:
            terminal.line("\n\n".join(certificates(self.source, self.long)))
        return OK


@dataclass(frozen=True)
class Models:
    """List the catalogue, or print a run file for one model, with its defaults, to start from."""

    name: Annotated[tyro.conf.Positional[str], called("[MODEL]")] = ""
    """A model; without it all of them."""
    json: bool = False
    """Print JSON, and nothing else."""

    def __call__(self) -> int:
        from coadjoint.cli import catalogue

        if not self.name:
            shown = catalogue.descriptions()
            if self.json:
                terminal.json(shown)
            else:
                terminal.table(("model", "what it is"), list(shown.items()))
        elif self.json:
            terminal.json(catalogue.defaults(self.name))
        else:
            terminal.text(catalogue.example(self.name))
        return OK


@dataclass(frozen=True)
class Audit:
    """Measure the claims of every method: order, symmetry, symplecticity, momentum, energy; status 0 if all is
    shown."""

    BEGINS: ClassVar[str] = "Loading the methods and the systems."

    out: Annotated[Path | None, called("DIR")] = None
    """A folder for audit.md, audit.json and figures."""
    json: bool = False
    """Print the findings as JSON, and nothing else."""
    quick: bool = False
    """Four systems, the Cayley map and shorter runs: one or two minutes."""
    method: Annotated[tuple[str, ...], called("METHOD …")] = ()
    """Methods to audit, by name, as in `--method Midpoint Suzuki4`; by default all."""
    system: Annotated[tuple[str, ...], called("SYSTEM …")] = ()
    """Systems to audit them on, as in `--system "heavy top"`; by default all."""

    def __call__(self) -> int:
        from coadjoint.audit.page import write
        from coadjoint.audit.tables import summary
        from coadjoint.cli.auditing import execute, show
        from coadjoint.report.folder import make
        from coadjoint.report.summary import to_json

        if self.out is not None:
            make(self.out)
        found = execute(self.method, self.system, self.quick, False if self.json else None)
        if not self.json:
            show(found, self.out, self._written())
        else:
            terminal.text(to_json(summary(found)))
            if self.out is not None:
                write(found, self.out, self._written())
        return OK if found.passed else FAILED

    def _written(self) -> str:
        """The command line of this audit."""
        parts = ["coadjoint audit", "--quick" if self.quick else ""]
        for flag, names in (("--method", self.method), ("--system", self.system)):
            parts += [flag, *(f'"{name}"' if " " in name else name for name in names)] if names else []
        return " ".join(filter(None, [*parts, f"--out {self.out}" if self.out else ""]))


def _show_run(written: Written, as_json: bool, long: bool) -> None:
    from coadjoint.report.summary import to_json
    from coadjoint.simulation.certificate_forms import Certificate, rows

    if as_json:
        terminal.text(to_json(written.summary))
    else:
        notes = [("note", sentence) for sentence in written.summary.get("notes", [])]
        held = Certificate.held(written.summary)
        lines = [] if held is None else rows(held.long() if long else held.short)
        terminal.fields([*lines, *notes, ("folder", f"{written.folder}/")])
        if written.before:
            terminal.line(f"The folder {written.folder} holds this run, finished and undamaged: nothing was run.")
    if written.failure:
        terminal.complain(
            f"{written.failure} {written.summary.get('saved', 0):,} records are kept in {written.folder}/."
        )


def _show_reproduction(found: Reproduction, folder: Path) -> None:
    from coadjoint.report.reproduction import FIGURES, numbers

    rows = []
    for name, run in found.runs.items():
        c = numbers(run)
        rows.append(
            (
                name.replace("_", " "),
                f"{c['dt']:g}",
                f"{c['energy_error_max']:.3e}",
                f"{c['kelvin_noether_error_max']:.1e}",
                f"{c['balance_residual_max']:.0e}",
                f"{c['seconds']:.2g}",
            )
        )
    terminal.table(("run", "h (s)", "energy error", "Kelvin–Noether error", "balance", "seconds"), rows)
    terminal.line(f"Report: {folder / 'report.md'}; figures: {', '.join(FIGURES.values())}.")
