"""What a factory imports from its folder is kept with the run; a factory from elsewhere is named before it is run."""

from __future__ import annotations

import shutil
import sys

import pytest

from coadjoint.cli.main import main
from coadjoint.manifest import Manifest
from coadjoint.report.verification import verify
from coadjoint.runs.run_file import read
from coadjoint.runs.running import execute

BODY = """
import sys
import numpy as np
import coadjoint as co
from law_of_a_spring import torque
print("the factory runs", file=sys.stderr)

def make():
    return co.System(co.SO3(), lambda xi: 0.5 * xi @ (np.array([1.0, 2.0, 3.0]) * xi), forces=torque)
"""
LAW = """
import coadjoint as co
from gains_of_a_spring.numbers import damping

def torque(motion):
    return co.Force(torque=-damping * motion.xi)
"""
RUN = """
[system]
factory = "{factory}:make"
[initial]
xi = [0.1, 0.2, 0.3]
[run]
dt = 0.01
steps = 5
[output]
figures = false
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A factory that imports a controller, which imports its gains, in a folder; forgotten modules before and after."""
    home = tmp_path / "home"
    (home / "gains_of_a_spring").mkdir(parents=True)
    (home / "spring.py").write_text(BODY)
    (home / "law_of_a_spring.py").write_text(LAW)
    (home / "gains_of_a_spring" / "__init__.py").write_text("")
    (home / "gains_of_a_spring" / "numbers.py").write_text("damping = 0.25\n")
    (home / "not_imported.py").write_text("raise RuntimeError\n")
    monkeypatch.chdir(tmp_path)
    forget()
    yield home
    forget()


def forget():
    for name in [name for name in sys.modules if "_of_a_spring" in name]:
        del sys.modules[name]


@pytest.mark.long
def test_what_it_imports_is_copied_and_the_copies_run_alone(folder, tmp_path):
    (folder / "spring.toml").write_text(RUN.format(factory="spring.py"))
    execute(read(folder / "spring.toml"), tmp_path / "out", progress=False)
    kept = {name for name in Manifest.read(tmp_path / "out").files if name.startswith("inputs/")}
    modules = {"spring.py", "law_of_a_spring.py", "gains_of_a_spring/__init__.py", "gains_of_a_spring/numbers.py"}
    assert kept == {f"inputs/1/{name}" for name in modules}
    shutil.rmtree(folder)
    forget()
    made = read(tmp_path / "out" / "run.toml").set_up()
    assert made.system.forces is not None
    cached = tmp_path / "out" / "inputs" / "1" / "__pycache__"
    cached.mkdir(exist_ok=True)
    (cached / "spring.cpython-311.pyc").write_bytes(b"")
    assert verify(tmp_path / "out").unknown == []
    assert sys.modules["law_of_a_spring"].__file__ == str(tmp_path / "out" / "inputs" / "1" / "law_of_a_spring.py")


@pytest.mark.long
def test_a_changed_module_is_another_run(folder, tmp_path, capsys):
    (folder / "spring.toml").write_text(RUN.format(factory="spring.py"))
    assert main(["run", "home/spring.toml", "--out", "out"]) == 0
    (folder / "gains_of_a_spring" / "numbers.py").write_text("damping = 0.5\n")
    assert main(["run", "home/spring.toml", "--out", "out"]) == 2
    assert "the file numbers.py has other contents there" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("place", "named"), [("elsewhere", True), ("home", False)])
def test_a_factory_outside_of_the_run_files_folder_is_named_before_it_is_run(folder, tmp_path, capsys, place, named):
    (tmp_path / place).mkdir(exist_ok=True)
    factory = "../home/spring.py" if named else "spring.py"
    (tmp_path / place / "spring.toml").write_text(RUN.format(factory=factory))
    assert main(["run", f"{place}/spring.toml", "--out", "out"]) == 0
    lines = capsys.readouterr().err.splitlines()
    sentence = f"The run file runs {folder / 'spring.py'}, which is outside of its folder."
    assert (sentence in lines) is named and "the factory runs" in lines
    if named:
        assert lines.index(sentence) < lines.index("the factory runs")


def test_a_factory_outside_of_the_run_files_folder_is_named_before_a_check_runs_it(folder, tmp_path, capsys):
    (tmp_path / "elsewhere").mkdir(exist_ok=True)
    (tmp_path / "elsewhere" / "spring.toml").write_text(RUN.format(factory="../home/spring.py"))
    assert main(["run", "elsewhere/spring.toml", "--check"]) == 0
    lines = capsys.readouterr().err.splitlines()
    sentence = f"The run file runs {folder / 'spring.py'}, which is outside of its folder."
    assert lines.index(sentence) < lines.index("the factory runs")
