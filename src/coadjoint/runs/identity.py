"""What a folder of results is known by, beside its files: the model that was run, wherever a change to it is made.

Models of the catalogue and vehicles are those of the library's files. What a file of Python makes may depend on other
modules, on files that it opens and on the environment: it is made and traced each time, and the digest of the trace
counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coadjoint.errors import FileError
from coadjoint.kernels.trace.library import digest_of_files
from coadjoint.report.summary import versions

if TYPE_CHECKING:
    from coadjoint.runs.runnable import Runnable
    from coadjoint.runs.setup import Setup

IDENTITY = "identity"
"""Where a manifest keeps it."""
NOT_COMPARED = "Whether its model is the one of now was not compared: the folder keeps no identity of it."

_PARTS = {
    "equations": "its equations are others",
    "parameters": "its parameters are others",
    "start": "its start is another",
    "monitors": "what it observes is other",
    "grid": "its step size, steps or method are others",
    "tracing": "its equations were traced by another version of coadjoint",
    "kernels": "its kernels are of other files of coadjoint",
    "library": "it was computed by other files of coadjoint",
}


def identity(file: Runnable, made: Setup | None = None) -> dict[str, str]:
    """What the run of a file is known by. made: its set-up, if there is one; needed where `file.written_in_python`.

    Without a file of Python nothing is set up, and JAX is not imported.
    """
    if not file.written_in_python:
        return {"library": digest_of_files(), **versions()}
    from coadjoint.runs.prepared import prepared
    from coadjoint.simulation.configuration import fingerprint

    run = prepared(file, file.set_up() if made is None else made)
    traced = fingerprint(run.plan, run.position.state, run.one)
    return {**traced, "kernels": digest_of_files("kernels"), **versions()}


def difference(before: Mapping[str, Any], now: Mapping[str, str]) -> str:
    """What differs between two identities, in words; nothing where they are the same."""
    for name in _PARTS:
        if before.get(name) != now.get(name):
            packages = [f"{key} {before.get(key)}" for key in now if key not in _PARTS and before.get(key) != now[key]]
            return _PARTS[name] + (f" (with {', '.join(map(str, packages))})" if packages else "")
    packages = [f"{key} {before.get(key)} and not {now[key]}" for key in now if before.get(key) != now[key]]
    return f"it was computed by {', '.join(packages)}" if packages else ""


def require_same(folder: Path, facts: Mapping[str, Any], now: Mapping[str, str]) -> bool:
    """Whether a folder with these facts keeps an identity; raises FileError where it is another than that of now."""
    before = facts.get(IDENTITY)
    if not isinstance(before, Mapping):
        return False
    if differing := difference(before, now):
        raise FileError(
            f"The folder {folder} holds another run already: {differing}; choose another one with --out, or begin it "
            "again with --overwrite."
        )
    return True
