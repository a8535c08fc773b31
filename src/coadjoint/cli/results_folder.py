"""The contents of a folder of results."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from coadjoint.errors import FileError, rephrased
from coadjoint.manifest import Manifest
from coadjoint.report.folder import RUN_FILE, SUMMARY, UNFINISHED, held_manifest
from coadjoint.simulation.certificate_forms import Certificate
from coadjoint.texts import LARGEST_SUMMARY, Table, file_text, read_table, text_of

if TYPE_CHECKING:
    from coadjoint.simulation.saved import SavedRun


def recordings(source: Path) -> dict[str, SavedRun]:
    """The runs of a folder, or of one file, by the names of their files; raises FileError where there are none."""
    from coadjoint.simulation.saved import load

    _require(source)
    _require_no_sweep(source)
    files = sorted(source.glob("*.nc")) if source.is_dir() and not streams(source) else [source]
    if not files:
        _require_a_good_step(source)
        raise FileError(f"The folder {source} {_state(source)}: there are no trajectories (*.nc).")
    return {file.stem: load(file) for file in files}


def streams(source: Path) -> bool:
    """Whether a folder is one to which a run streams, by co.simulate(store=…)."""
    try:
        return Manifest.read(source).facts["kind"] == "records"
    except (OSError, FileError):
        return False


def figures_asked(source: Path) -> list[str] | None:
    """The figures that [output] of the run of a folder lists, None where it lists none."""
    file = source / RUN_FILE
    if not file.is_file():
        return None
    output = read_table(file_text(file), file).get("output", {})
    found = output.get("figures") if isinstance(output, dict) else None
    return found if isinstance(found, list) and found else None


def summary(source: Path) -> Table:
    """The numbers of a folder's summary.json, or of a file of a run; raises FileError."""
    _require(source)
    if not source.is_dir() or streams(source):
        from coadjoint.report.summary import to_json

        (run,) = recordings(source).values()
        return json.loads(to_json(dict(run.dataset.attrs)))
    file = source / SUMMARY
    if not os.path.exists(file):
        raise FileError(f"The folder {source} {_state(source)}: there is no {SUMMARY}.")
    with rephrased(f"The file {file} cannot be read", OSError, RecursionError, ValueError):
        found = json.loads(text_of(file, LARGEST_SUMMARY))
    if not isinstance(found, dict):
        raise FileError(f"The file {file} was not written by coadjoint.")
    return found


def certificates(source: Path, long: bool = False) -> list[str]:
    """The certificates of the runs of a folder or file, as text, in their short or in their long form."""
    _require(source)
    if source.is_dir() and not any(source.glob("*.nc")):
        summary(source)  # raises for missing files, unless a run failed at its first step and left only the summary
    if source.is_dir() and (source / SUMMARY).exists():
        found = summary(source)
        if held := Certificate.held(found):
            return [held.long() if long else str(held), *([str(found["failure"])] if found.get("failure") else [])]
    held = {name: run.certificate for name, run in recordings(source).items()}
    return [f"{name}\n{one.long() if long else one}" for name, one in held.items()]


def _require_no_sweep(source: Path) -> None:
    """Raise FileError for the folder of a sweep and its files, with the commands that show a sweep."""
    folder = source if source.is_dir() else source.parent
    try:
        held = held_manifest(folder)
    except FileError:  # of another kind, or damaged: its reader raises the error
        return
    if held is None or "sweep" not in held.facts or (source != folder and source.name not in held.files):
        return
    if not held.facts.get("complete"):
        raise FileError(
            f"The folder {folder} holds a sweep that has not finished: the same `coadjoint sweep` command continues it."
        )
    held = summary(folder)
    named = held.get("figures")
    pictures = [str(folder / name) for name in named if isinstance(name, str)] if isinstance(named, list) else []
    drawn = f"its results are drawn in {' and '.join(pictures)}, and " if pictures else ""
    raise FileError(
        f"The folder {folder} holds a sweep of {held.get('members')} members, not a single run: {drawn}"
        f"co.sweeps.load_sweep({str(folder)!r}) opens it in Python; `coadjoint info {folder}` shows its numbers."
    )


def _require_a_good_step(source: Path) -> None:
    """Raise FileError for a run that failed at its first step, which left a summary and no trajectory."""
    if not (source.is_dir() and (source / SUMMARY).exists()):
        return
    if failure := summary(source).get("failure"):
        raise FileError(
            f"The run in {source} has no good step, so that there is no trajectory: {str(failure).rstrip('.')}."
        )


def _state(source: Path) -> str:
    """The state of a folder without results."""
    if (source / UNFINISHED).exists():
        return f"holds a run that has not finished: `coadjoint resume {source}` continues it"
    return "holds a run that did not finish" if (source / RUN_FILE).exists() else "holds no results of coadjoint"


def _require(source: Path) -> None:
    if not os.path.exists(source):
        raise FileError(f"There is no folder or file {source}.")
