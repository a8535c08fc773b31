"""A folder of results is of one model: a change is found wherever it is made."""

from __future__ import annotations

import importlib
import json
import sys

import pytest

from coadjoint.cli.main import main
from coadjoint.manifest import MANIFEST, Manifest
from coadjoint.runs.identity import IDENTITY, difference, identity
from coadjoint.runs.run_file import read

FACTORY = """
import os
from pathlib import Path
import coadjoint as co
import spring_of_identity_test as spring

def make():
    c = float(Path(__file__).with_name("c.txt").read_text())
    d = float(os.environ.get("DRAG_OF_TEST", "1"))
    s = co.System(co.SO3(), lambda xi, p: 0.5 * p.k * xi @ xi + 0.5 * spring.K * xi[0] ** 2, parameters={"k": c})
    return s, s.state(xi=[0.3, 0.2, d])
"""
RUN = '[system]\nfactory = "f.py:make"\n[run]\ndt = 0.01\nsteps = 4\n[output]\nfigures = false\n'
TOP = '[system]\nmodel = "simo_wong_top"\n[run]\ndt = 0.001\nsteps = 4\n[output]\nfigures = false\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A run file with a factory that reads a module elsewhere, a file and the environment."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "spring_of_identity_test.py").write_text("K = 2.0\n")
    monkeypatch.syspath_prepend(elsewhere)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    tmp_path = tmp_path / "work"
    tmp_path.mkdir()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "f.py").write_text(FACTORY)
    (tmp_path / "c.txt").write_text("1.0")
    (tmp_path / "r.toml").write_text(RUN)
    (tmp_path / "top.toml").write_text(TOP)
    yield tmp_path
    sys.modules.pop("spring_of_identity_test", None)


def change_module(folder):
    (folder.parent / "elsewhere" / "spring_of_identity_test.py").write_text("K = 22.0\n")
    importlib.invalidate_caches()
    sys.modules.pop("spring_of_identity_test")


def change_data(folder):
    (folder / "c.txt").write_text("1.5")


@pytest.mark.long
def test_a_finished_run_of_a_factory_is_another_where_the_model_has_changed(folder, capsys):
    assert main(["run", "r.toml", "--out", "out"]) == 0
    assert main(["run", "r.toml", "--out", "out"]) == 0
    told = capsys.readouterr().out
    assert "nothing was run" in told and "not compared" not in told
    change_module(folder)
    assert main(["run", "r.toml", "--out", "out"]) == 2
    assert "its equations differ; choose another one with --out, or begin" in capsys.readouterr().err


def test_the_identity_of_a_factory_is_what_is_traced_of_it(folder, monkeypatch):
    file = read(folder / "r.toml")
    before = identity(file)
    assert difference(before, identity(file)) == ""
    monkeypatch.setenv("DRAG_OF_TEST", "1.25")
    assert difference(before, identity(file)) == "its start differs"
    monkeypatch.undo()
    change_data(folder)
    assert difference(before, identity(file)) == "its parameters differ"


@pytest.mark.long
def test_a_finished_run_of_a_model_is_another_with_other_files_of_the_library(folder, capsys, monkeypatch):
    assert main(["run", "top.toml"]) == 0
    monkeypatch.setattr("coadjoint.runs.identity.digest_of_files", lambda part="": "other")
    assert main(["run", "top.toml"]) == 2
    assert "by other files of coadjoint; choose" in capsys.readouterr().err
    assert main(["run", "top.toml", "--overwrite"]) == 0


def test_a_folder_without_an_identity_is_not_compared(folder, capsys):
    assert main(["run", "top.toml"]) == 0
    manifest = Manifest.read(folder / "top")
    del manifest.facts[IDENTITY]
    manifest.write()
    assert main(["run", "top.toml"]) == 0
    assert "was not compared" in capsys.readouterr().out
    assert IDENTITY not in json.loads((folder / "top" / MANIFEST).read_text())["facts"]


def test_what_differs_is_named():
    known = {"library": "1", "python": "3.11.7", "jax": "0.7"}
    assert difference(known, known) == ""
    assert difference(known, {**known, "jax": "0.8"}) == "it was computed by jax 0.7 and not 0.8"
    assert difference(known, {**known, "library": "2", "jax": "0.8"}) == (
        "it was computed by other files of coadjoint (with jax 0.7)"
    )
