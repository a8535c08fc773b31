"""What a folder of a run keeps of its start and method, and what is left of a folder that could not be made."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, FileError
from coadjoint.simulation import folder
from coadjoint.simulation.configuration import method_form, method_from, start_form, start_from
from coadjoint.simulation.lock import LOCK
from coadjoint.spaces.named import Named

SYSTEM = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi)


def test_a_start_is_read_back_with_its_trees_of_every_kind():
    internal = {"a": (1.0, [np.arange(3.0), 2]), "b": co.Parameters(c=np.eye(2)), "d": Named(e=0.5), "f": None}
    start = SYSTEM.state(xi=[1.0, 2.0, 3.0]).replace(internal=internal, inputs=Named(thrust=np.ones(2)))
    form, numbers = start_form(start)
    found = start_from(form, numbers, SYSTEM)
    assert jax.tree.structure(found) == jax.tree.structure(start)
    assert all(map(np.array_equal, jax.tree.leaves(found), jax.tree.leaves(start)))
    assert isinstance(found.internal["b"], co.Parameters) and isinstance(found.internal["a"], tuple)
    assert found.places == start.places and found.from_velocities == start.from_velocities


def test_an_element_of_named_arrays_is_read_back_and_one_of_another_group_is_refused():
    system = co.System(co.SUn(2), lambda xi: 0.5 * xi @ xi)
    start = system.state()
    form, numbers = start_form(start)
    found = start_from(form, numbers, system)
    assert jax.tree.structure(found.g) == jax.tree.structure(start.g)
    assert all(map(np.array_equal, jax.tree.leaves(found.g), jax.tree.leaves(start.g)))
    with pytest.raises(ArgumentError, match=r"The start of this run is no element of SO3\(\): give the system it had"):
        start_from(form, numbers, SYSTEM)


def test_a_start_with_parts_of_other_kinds_is_asked_for_again():
    form, numbers = start_form(SYSTEM.state().replace(internal={"a": object()}))
    assert (form, numbers) == (None, {})
    with pytest.raises(ArgumentError, match="has parts that its folder does not keep: give `start` again"):
        start_from(form, numbers, SYSTEM)


def test_a_method_is_read_back_and_what_is_no_method_is_not():
    method = co.Suzuki4(co.Midpoint(co.Cayley()), negative_substeps="allow")
    form = method_form(method)
    assert method_from(form) == method
    with pytest.raises((ValueError, AttributeError, TypeError)):
        method_from({**form, "more": 1.0})
    with pytest.raises((ValueError, AttributeError, TypeError)):
        method_from({"class": "Path"})


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), ArgumentError("No.")])
def test_of_a_folder_that_cannot_be_made_nothing_is_left(tmp_path, monkeypatch, error):
    def failing(*_: Any) -> None:
        raise error

    made = SimpleNamespace(system=None, plan=SimpleNamespace(members=None, program=None), start=None)
    monkeypatch.setattr(folder.Store, "__init__", lambda self, *_: None)
    monkeypatch.setattr(folder.Store, "put", failing)
    expected = FileError if isinstance(error, OSError) else type(error)
    with pytest.raises(expected, match=r"cannot be made: No space left on device" if expected is FileError else None):
        folder.create(tmp_path / "run", made, {}, ({}, {}))  # pyright: ignore[reportArgumentType]
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_process_left_beside_a_run_is_removed_but_not_what_another_holds(tmp_path):
    hidden = folder.disk.partial(tmp_path / "run")
    hidden.mkdir()
    (hidden / "part").write_text("x")
    folder.sweep_beside(tmp_path / "run")
    assert not hidden.exists()
    folder.sweep_beside(tmp_path / "run")
    hidden.mkdir()
    (hidden / "part").write_text("x")
    held = folder.Lock(hidden)
    folder.sweep_beside(tmp_path / "run")
    assert (hidden / "part").exists()
    held.release()


def test_a_finished_folder_keeps_the_checkpoint_of_its_manifest_alone(tmp_path, monkeypatch):
    last, other = (Path(folder.CHECKPOINTS.replace("*", name)) for name in ("12", "8"))
    for name in (last, other, Path("records")):
        (tmp_path / name).write_text("x")
    monkeypatch.setattr(folder.Manifest, "read", lambda _: SimpleNamespace(files={last.name: None}))
    folder.tidy(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} - {LOCK} == {last.name, "records"}
