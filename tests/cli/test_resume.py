"""`coadjoint resume` goes on with a run that was killed, from its folder alone."""

import subprocess
import sys
import time

import numpy as np
import pytest

import coadjoint as co
from coadjoint.cli.main import main
from files import TOP, write

MAIN = [sys.executable, "-c", "import sys; from coadjoint.cli.main import main; sys.exit(main(sys.argv[1:]))"]
GRID = ["--set", "run.steps=3000001", "--set", "run.save_every=1000"]


@pytest.fixture
def killed(tmp_path, monkeypatch):
    """A folder in which a run was killed; its run file and its factory are gone."""
    monkeypatch.chdir(tmp_path)
    file = write(tmp_path, TOP)
    assert main(["run", str(file), *GRID, "--out", "whole"]) == 0
    process = subprocess.Popen([*MAIN, "run", str(file), *GRID, "--out", "cut"], stderr=subprocess.DEVNULL)
    folder, until = tmp_path / "cut", time.monotonic() + 60
    while not (folder / "unfinished").exists() and process.poll() is None and time.monotonic() < until:
        time.sleep(0.002)
    time.sleep(0.2)
    process.kill()
    process.wait()
    file.unlink()
    (tmp_path / "top.py").unlink()
    assert not (folder / "summary.json").exists()
    return folder


def test_a_killed_run_goes_on_to_the_same_trajectory(killed, capsys):
    assert main(["resume", "cut"]) == 0
    assert "Kelvin–Noether" in capsys.readouterr().out
    whole, resumed = (co.load(f"{name}/trajectory.nc").dataset for name in ("whole", "cut"))
    for name, values in whole.variables.items():
        np.testing.assert_array_equal(resumed[name], values, err_msg=str(name))
    assert {file.name for file in killed.iterdir()} == {file.name for file in (killed.parent / "whole").iterdir()}
    assert main(["info", "cut"]) == 0
    capsys.readouterr()
    assert main(["resume", "cut"]) == 2
    assert "has ended: there is nothing to go on with" in capsys.readouterr().err


def test_an_unfinished_run_is_not_begun_again_unasked(killed, capsys):
    assert main(["run", str(killed / "run.toml"), "--out", "cut"]) == 2
    assert "go on with `coadjoint resume cut`" in capsys.readouterr().err
    assert (killed / "unfinished" / "manifest.json").exists()
    assert main(["run", str(killed / "run.toml"), "--out", "cut", "--overwrite"]) == 0
    assert not (killed / "unfinished").exists()


def test_a_factory_that_was_changed_meanwhile_is_refused(killed, capsys):
    source = killed / "top.py"
    source.write_text(source.read_text().replace("0.5", "0.50001"))
    assert main(["resume", "cut"]) == 2
    assert "holds another run: the system's or the method's equations differ" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("folder", "told"), [("none", "There is no folder none"), ("empty", "The folder empty holds no run")]
)
def test_a_folder_without_a_run_is_told(tmp_path, monkeypatch, capsys, folder, told):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    assert main(["resume", folder]) == 2
    assert told in capsys.readouterr().err
