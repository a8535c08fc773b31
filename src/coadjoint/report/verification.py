"""Verification that the files of a folder are unchanged since they were written."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from coadjoint.errors import FileError
from coadjoint.manifest import MANIFEST, Manifest
from coadjoint.report.folder import UNFINISHED


@dataclass
class Verification:
    """The result for a folder: the number of files compared, the problems, and unknown files."""

    complete: bool
    unfinished_sweep: bool = False
    files: int = 0
    problems: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Whether every file is unchanged."""
        return not self.problems


def verify(folder: Path) -> Verification:
    """Compare every file of a folder of results, or of a run that streamed there, with the manifest.

    An unfinished run in a folder of results is checked as well. Raises FileError where there is no manifest, or it is
    damaged.
    """
    try:
        manifest = Manifest.read(folder)
    except FileNotFoundError:
        state = "holds no manifest.json" if folder.is_dir() else "does not exist"
        raise FileError(
            f"The folder {folder} {state}: verify takes a folder that `coadjoint run` or co.simulate(store=…) wrote."
        ) from None
    complete = bool(manifest.facts.get("complete"))
    found = Verification(complete, not complete and "sweep" in manifest.facts)
    _compare(manifest, found)
    if manifest.facts["kind"] == "results" and not found.complete and (folder / UNFINISHED / MANIFEST).exists():
        _compare(Manifest.read(folder / UNFINISHED), found)
    return found


def _compare(manifest: Manifest, found: Verification) -> None:
    found.files += len(manifest.files)
    found.problems += manifest.problems()
    inner = manifest.folder / UNFINISHED
    for path in sorted(manifest.folder.rglob("*")):
        name = path.relative_to(manifest.folder).as_posix()
        known = name in manifest.files or path.name in (MANIFEST, "lock", ".lock") or path.is_relative_to(inner)
        cached = path.parent.name == "__pycache__"  # written by Python where it imports a factory of the folder
        if path.is_file() and not known and not cached:
            found.unknown.append(str(path))
