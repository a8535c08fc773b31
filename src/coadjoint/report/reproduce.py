"""The reproduction of the paper's section 5 as a folder: figures, trajectories, numbers and a report."""

from __future__ import annotations

from pathlib import Path

from coadjoint.disk import write_text
from coadjoint.log import phase
from coadjoint.models.paper_tables import PAPER_DURATION, PAPER_STEP
from coadjoint.plotting.style import save
from coadjoint.report.folder import SUMMARY, claimed
from coadjoint.report.reproduction import FIGURES, LABELS, Reproduction, compute
from coadjoint.report.summary import to_json
from coadjoint.report.text import report


def reproduce(
    out: str | Path = "reproduction",
    *,
    dt: float = PAPER_STEP,
    duration: float = PAPER_DURATION,
    overwrite: bool = False,
    progress: bool | None = None,
) -> Reproduction | None:
    """Compute the reproduction and write it to the folder `out`: figures, trajectories, summary.json and report.md.

    dt, duration: s, by default the paper's. Returns None where `out` holds this reproduction already, unless
    `overwrite`. Raises FileError where it holds another run or cannot be written.
    """
    configuration = f"[reproduce]\ndt = {dt!r}\nduration = {duration!r}\n"
    with claimed(Path(out), configuration, overwrite) as claim:
        if claim.complete:
            claim.tidy()
            return None
        found = compute(dt, duration, progress)
        claim.results(lambda stage: _write(found, stage))
    return found


def _write(found: Reproduction, folder: Path) -> None:
    for name in ("cayley", "exponential", "midpoint"):
        found.runs[name].save(folder / f"{name}.nc")
    draw(found, folder)
    write_text(folder / "report.md", report(found))
    write_text(folder / SUMMARY, to_json(found.summary()))


def draw(found: Reproduction, folder: Path) -> None:
    """The paper's figures 1–3, and one that explains the growth of the energy."""
    phase("Drawing %s.", ", ".join(FIGURES.values()))
    first, second = (found.runs[name] for name in LABELS)
    labels = list(LABELS.values())
    plots = first.plot
    plots.energy(second, labels=labels, path=folder / FIGURES["energy"])
    plots.kelvin_noether(second, labels=labels, path=folder / FIGURES["kelvin_noether"])
    figure = plots.trajectory(second, labels=labels)
    space, *_, last = figure.axes
    space.set(zlabel="$z$, down (m)")
    last.set_ylabel("$z$, down (m)")
    save(figure, folder / FIGURES["trajectory"])
    half, midpoint = found.runs["cayley_half_step"], found.runs["midpoint"]
    plots.energy(
        half,
        midpoint,
        labels=[f"left, h = {first.dt:g} s", f"left, h = {half.dt:g} s", f"midpoint, h = {midpoint.dt:g} s"],
        path=folder / FIGURES["explained"],
    )
