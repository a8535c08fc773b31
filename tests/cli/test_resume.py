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
    folder, until = tmp_path / "cut", time.monotonic() + 300
    while not (folder / "unfinished").exists() and process.poll() is None and time.monotonic() < until:
        time.sleep(0.002)
    time.sleep(0.2)
    process.kill()
    process.wait()
    file.unlink()
    (tmp_path / "top.py").unlink()
    assert not (folder / "summary.json").exists()
    return folder


@pytest.mark.long
def test_a_killed_run_goes_on_to_the_same_trajectory(killed, capsys):
    for command in ("info", "plot"):
        assert main([command, "cut"]) == 2
        assert "a run that has not finished: `coadjoint resume cut` continues it" in capsys.readouterr().err
    assert main(["resume", "cut"]) == 0
    assert "Kelvin–Noether" in capsys.readouterr().out
    whole, resumed = (co.load(f"{name}/trajectory.nc").dataset for name in ("whole", "cut"))
    for name, values in whole.variables.items():
        np.testing.assert_array_equal(resumed[name], values, err_msg=str(name))
    assert {file.name for file in killed.iterdir()} == {file.name for file in (killed.parent / "whole").iterdir()}
    assert main(["verify", "cut"]) == 0
    assert main(["info", "cut"]) == 0
    capsys.readouterr()
    assert main(["resume", "cut"]) == 0
    assert "holds this run, finished and undamaged: nothing was run" in capsys.readouterr().out


@pytest.mark.long
def test_the_same_command_goes_on_with_a_run_that_was_killed(killed, capsys):
    file = write(killed.parent, TOP)
    assert main(["run", str(file), *GRID, "--set", "run.dt=0.5", "--out", "cut"]) == 2
    assert "holds another run already: run.dt is 0.001 there and 0.5 here" in capsys.readouterr().err
    other = killed.parent / "top.py"
    other.write_text((text := other.read_text()) + "\n")
    assert main(["run", str(file), *GRID, "--out", "cut"]) == 2
    assert "the file top.py has other contents there" in capsys.readouterr().err
    other.write_text(text)
    assert main(["verify", "cut"]) == 0
    assert main(["run", str(file), *GRID, "--out", "cut"]) == 0
    assert not (killed / "unfinished").exists()
    capsys.readouterr()
    assert main(["run", str(file), *GRID, "--out", "cut"]) == 0
    assert "nothing was run" in capsys.readouterr().out


@pytest.mark.long
def test_a_factory_that_was_changed_meanwhile_is_refused(killed, capsys):
    source = killed / "inputs" / "1" / "top.py"
    source.write_text(source.read_text().replace("0.5", "0.50001"))
    assert main(["resume", "cut"]) == 2
    assert (
        "top.py of the run is damaged: it has 1345 bytes instead of 1329; put back a copy of it"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("folder", "told"), [("none", "There is no folder none"), ("empty", "The folder empty holds no run")]
)
def test_a_folder_without_a_run_is_told(tmp_path, monkeypatch, capsys, folder, told):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    assert main(["resume", folder]) == 2
    assert told in capsys.readouterr().err
