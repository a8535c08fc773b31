"""The identity of a folder of results: the model of its run, wherever a change to the model is made.

Models of the catalogue and vehicles are identified by the files of the library. A system made by a file of Python may
depend on other modules, on files that it opens and on the environment: it is made and traced each time, and identified
by the digest of the trace.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from coadjoint.errors import FileError
from coadjoint.kernels.trace.library import digest_of_files
from coadjoint.report.summary import versions

if TYPE_CHECKING:
    from coadjoint.runs.runnable import Runnable
    from coadjoint.runs.setup import Setup

IDENTITY = "identity"
"""The key of the identity in a manifest."""
NOT_COMPARED = "The model was not compared with the present one: the folder keeps no identity of it."

_PARTS = {
    "equations": "its equations differ",
    "parameters": "its parameters differ",
    "start": "its start differs",
    "monitors": "its observed quantities differ",
    "grid": "its step size, steps or method differ",
    "tracing": "its equations were traced by another version of coadjoint",
    "kernels": "its kernels are of other files of coadjoint",
    "library": "it was computed by other files of coadjoint",
}


def identity(file: Runnable, made: Setup | None = None) -> dict[str, str]:
    """The identity of the run of a file. made: its set-up, if there is one; needed if `file.written_in_python`.

    Without a file of Python nothing is set up, and JAX is not imported.
    """
    if not file.written_in_python:
        return {"library": digest_of_files(), **versions()}
    from coadjoint.runs.prepared import prepared
    from coadjoint.simulation.configuration import fingerprint

    run = prepared(file, file.set_up() if made is None else made)
    traced = fingerprint(run.plan, run.position.state, run.one)
    return {**traced, "kernels": digest_of_files("kernels"), **versions()}


def difference(before: Mapping[str, object], now: Mapping[str, str]) -> str:
    """The difference between two identities as text; empty if they are equal."""
    for name in _PARTS:
        if before.get(name) != now.get(name):
            packages = [f"{key} {before.get(key)}" for key in now if key not in _PARTS and before.get(key) != now[key]]
            return _PARTS[name] + (f" (with {', '.join(map(str, packages))})" if packages else "")
    packages = [f"{key} {before.get(key)} and not {now[key]}" for key in now if before.get(key) != now[key]]
    return f"it was computed by {', '.join(packages)}" if packages else ""


def require_same(folder: Path, facts: Mapping[str, object], now: Mapping[str, str]) -> bool:
    """Whether a folder with these facts keeps an identity; raises FileError if it differs from the present one."""
    before = facts.get(IDENTITY)
    if not isinstance(before, Mapping):
        return False
    if differing := difference(before, now):
        raise FileError(
            f"The folder {folder} holds another run already: {differing}; choose another one with --out, or begin it "
            "again with --overwrite."
        )
    return True
