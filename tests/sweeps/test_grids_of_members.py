"""Members of a sweep run on the grid of their file, and files that a run does not write in Python."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from coadjoint.errors import FileError
from coadjoint.runs.runnable import Runnable
from coadjoint.sweeps import results, task


@pytest.mark.parametrize("members", [None, 3])
def test_members_run_the_grid_of_their_file_from_one_start_each(members, monkeypatch):
    section = SimpleNamespace(dt=0.25, duration=3.0, steps=None)
    file = SimpleNamespace(method="midpoint", run=section)
    made = SimpleNamespace(
        system=SimpleNamespace(parameters="p"), start=SimpleNamespace(t=np.float64(0.0)), inputs="inputs", until="until"
    )
    asked: list[Any] = []

    def problem(*what, **more):
        asked.append((what, more))
        return SimpleNamespace(set_up=lambda: "ready")

    monkeypatch.setattr(task, "_set_up", lambda sweep, file, quick: (made, None))
    monkeypatch.setattr(task, "count_members", lambda parameters: members)
    monkeypatch.setattr(task, "method", lambda name: f"the {name}")
    monkeypatch.setattr(task, "require_kinds", lambda *given: asked.append(given))
    monkeypatch.setattr(task, "grid", lambda dt, duration, steps: ("h", (dt, duration, steps)))
    monkeypatch.setattr(task, "SimulationProblem", problem)
    monkeypatch.setattr(task.jax.tree, "map", lambda function, tree: function(tree.t))
    sweep = SimpleNamespace(run=lambda rows, quick, members: file)
    assert task.ensemble(cast(Any, sweep), {}, np.arange(3), False, 5) == "ready"
    (_, start, chosen), (what, more) = asked
    assert (
        chosen == "the midpoint"
        and what[:2] == (made.system, start)
        and what[2:] == (chosen, "h", (0.25, 3.0, None), 5)
    )
    assert more == {"inputs": "inputs", "until": "until"}
    assert start is made.start if members else start.tolist() == [0.0, 0.0, 0.0]


def test_a_file_of_toml_is_not_written_in_python_and_its_folder_is_its_name():
    made: Any = SimpleNamespace(output=SimpleNamespace(folder=""), path=SimpleNamespace(stem="dive"))
    kind: Any = Runnable
    assert kind.written_in_python.fget(made) is False and kind.code.fget(made) == []
    assert str(kind.folder.fget(made)) == "dive"
    made.output.folder = "out"
    assert str(kind.folder.fget(made)) == "out"


def test_files_of_results_are_those_of_the_manifest(tmp_path):
    required: list[str] = []
    (tmp_path / "there").touch()
    manifest = SimpleNamespace(files={"members/a": None}, require_size=required.append)
    made: Any = SimpleNamespace(manifest=manifest, place="members", root=tmp_path, complete=True)
    is_there = results.Verified._is_there
    assert is_there(made, "a") and required == ["members/a"] and not is_there(made, "b")
    for key in ("there", "x/c.0"):
        with pytest.raises(FileError, match="is not among those of the manifest"):
            is_there(made, key)
    made.complete = False
    assert not is_there(made, "x/c.0")
