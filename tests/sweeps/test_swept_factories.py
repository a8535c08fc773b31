"""Sweeps of systems that a file of Python makes: one model, whatever it depends on."""

from __future__ import annotations

import hashlib
import importlib
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import coadjoint as co
from coadjoint.sweeps import store
from coadjoint.sweeps import task as tasks
from coadjoint.sweeps.file import Sweep, read_sweep
from coadjoint.sweeps.sweep import execute
from coadjoint.sweeps.task import Task, compute

FACTORY = """
from pathlib import Path
import coadjoint as co
import spring_of_sweep_test as spring
C = float(Path(__file__).with_name("c.txt").read_text())

def make(c=1.0, k=2.0):
    stiff = spring.K * k if c > 1.0 else k
    s = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ xi + 0.5 * p.c * xi[0] ** 2 + p.k * xi[1] ** 2,
                  parameters={"c": C * c, "k": stiff})
    return s, s.state(xi=[0.3, 0.2 * c, 1.0])
"""
SWEEP = """
[sweep]
run = "r.toml"
sampling = "list"
task = 2
[vary.parameters]
c = { values = [0.9, 1.0, 1.1, 1.2] }
k = { values = [2.0, 2.5, 3.0, 3.5] }
[results]
variables = ["mu"]
figures = false
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory) -> Path:
    """A sweep that was killed before its end, in `out`, with its files."""
    folder = tmp_path_factory.mktemp("swept_factory")
    (folder / "spring_of_sweep_test.py").write_text("K = 2.0\n")
    (folder / "c.txt").write_text("2.0")
    (folder / "f.py").write_text(FACTORY)
    (folder / "r.toml").write_text('[system]\nfactory = "f.py:make"\n[run]\ndt = 0.01\nsteps = 5\n')
    (folder / "s.toml").write_text(SWEEP)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sys, "dont_write_bytecode", True)
        patched.setattr(store, "enter_chunks", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            execute(read_sweep(folder / "s.toml"), folder / "out", workers=1, progress=False)
    sys.modules.pop("spring_of_sweep_test", None)
    return folder


@pytest.fixture
def sweep(home, tmp_path, monkeypatch) -> Sweep:
    shutil.copytree(home, tmp_path, dirs_exist_ok=True)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.delitem(sys.modules, "spring_of_sweep_test", raising=False)
    return read_sweep(tmp_path / "s.toml")


def edited(folder: Path, text: str) -> None:
    """Change the module, as for a new process."""
    (folder / "spring_of_sweep_test.py").write_text(text)
    sys.modules.pop("spring_of_sweep_test", None)
    importlib.invalidate_caches()


@pytest.fixture
def begun(tmp_path) -> Path:
    return tmp_path / "out"


@pytest.mark.long
def test_a_sweep_does_not_go_on_with_another_model(sweep, begun, tmp_path):
    kept = {path.name for path in (begun / "inputs" / "1").iterdir()}
    assert kept == {"f.py", "spring_of_sweep_test.py", "c.txt"}
    edited(tmp_path, "K = 4.0\n")
    with pytest.raises(co.errors.FileError, match=r"spring_of_sweep_test\.py has other contents there"):
        execute(sweep, begun, workers=1, progress=False)


@pytest.mark.long
def test_a_sweep_of_a_factory_goes_on_with_the_model_that_it_began_with(sweep, begun):
    made = execute(sweep, begun, workers=1, progress=False)
    assert made.summary["computed_tasks"] == 0 and made.failures == {}


@pytest.mark.long
def test_a_sweep_does_not_go_on_where_the_trace_is_another(sweep, begun, monkeypatch):
    monkeypatch.setattr("coadjoint.sweeps.task.runs.identity", lambda file: {"equations": "others"})
    with pytest.raises(co.errors.FileError, match="its equations differ"):
        execute(sweep, begun, workers=1, progress=False)


@pytest.mark.parametrize("differs", [{"equations": "others"}, {"jax": "0.1"}])
def test_a_worker_whose_model_or_library_differs_refuses_its_task(monkeypatch, differs):
    known = {"equations": "these", "jax": "0.9"}
    monkeypatch.setattr(tasks, "swept", lambda _: (None, known))
    given: Any = SimpleNamespace(identity={**known, **differs})
    with pytest.raises(co.errors.ArgumentError, match="The model of a worker differs"):
        compute(given)


@pytest.mark.long
def test_a_worker_with_another_model_refuses_its_task(sweep, begun):
    text = hashlib.sha256((begun / "run.toml").read_bytes()).hexdigest()
    rows = sweep.rows(slice(0, 2))
    task = Task(str(begun), text, 0, 0, rows, 2, 1, ("mu",), True, {"equations": "others"}, 2, sweep.sample)
    with pytest.raises(co.errors.ArgumentError, match="The model of a worker differs"):
        compute(task)
