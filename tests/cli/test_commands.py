"""What the commands print, write, and return."""

from __future__ import annotations

import json
import os
import platform
import signal
import subprocess
import sys
import time

import jax
import llvmlite
import numpy as np
import pytest

import coadjoint
from coadjoint.cli import commands
from coadjoint.cli.main import main
from coadjoint.plotting.plots import OWN
from coadjoint.simulation.saved import load
from files import TOP, TOP_OF_CATALOGUE, write

MAIN = [sys.executable, "-c", "import sys; from coadjoint.cli.main import main; sys.exit(main(sys.argv[1:]))"]


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def told(capsys) -> tuple[str, str]:
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err
    return captured.out, captured.err


@pytest.mark.long
def test_a_run_writes_its_folder_and_prints_its_certificate(tmp_path, capsys):
    file = write(tmp_path, TOP)
    assert main(["run", str(file)]) == 0
    out, err = told(capsys)
    assert "top on SO3()" in out
    assert "Kelvin–Noether" in out
    assert err == ""
    folder = tmp_path / "top"
    drawn = {f"{name}.png" for name in OWN if name not in ("trajectory", "budget", "inputs")}
    assert {path.name for path in folder.iterdir()} == {
        "run.toml", "inputs", "manifest.json", "trajectory.nc", "summary.json", *drawn
    }  # fmt: skip
    assert (folder / "run.toml").read_text() == TOP
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["steps"], summary["complete"], summary["failure"]) == (20, True, None)
    saved = load(folder / "trajectory.nc").dataset
    assert np.array_equal(saved.xi.values[-1], summary["xi_final"])
    assert summary["time_final"] == pytest.approx(0.02)


@pytest.mark.long
def test_changes_are_kept_with_the_run(tmp_path, capsys):
    file = write(tmp_path, TOP)
    assert main(["run", str(file), "--set", "run.steps=5", "--set", "method.name=LeftRight", "--out", "other"]) == 0
    assert "LeftRight(Cayley()), order 2" in told(capsys)[0]
    assert main(["run", str(tmp_path / "other" / "run.toml"), "--check", "--out", "again"]) == 0
    assert "steps = 5" in (tmp_path / "other" / "run.toml").read_text()


def test_json_is_all_that_is_printed(tmp_path, capsys):
    file = write(tmp_path, TOP_OF_CATALOGUE)
    assert main(["run", str(file), "--json"]) == 0
    assert json.loads(told(capsys)[0])["steps"] == 20
    for arguments in (["info", "top"], ["plot", "top"], ["models"], ["models", "heavy_top"]):
        assert main([*arguments, "--json"]) == 0
        assert json.loads(told(capsys)[0])


def test_a_folder_with_a_run_is_refused_with_status_2(tmp_path, capsys):
    file = write(tmp_path, TOP_OF_CATALOGUE)
    main(["run", str(file)])
    before = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "top").iterdir()}
    told(capsys)
    for arguments, words in ((["--set", "run.steps=3", "--overwrite"], "run.steps is 20 there and 3 here"),):
        assert main(["run", str(file), *arguments]) == 2
        out, err = told(capsys)
        assert out == ""
        assert words in err
        assert err.count("\n") == 1
    assert main(["reproduce", "--out", "top", "--overwrite"]) == 2
    assert {path.name: path.stat().st_mtime_ns for path in (tmp_path / "top").iterdir()} == before
    assert main(["run", str(file), "--overwrite"]) == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "nothing.toml"], "There is no run file nothing.toml."),
        (["run", "top.toml", "--set", "run.dt=-0.01"], "dt must be positive, but is -0.01."),
        (["run", "top.toml", "--out", "top.py"], "is a file, not a folder"),
        (["run", "top.toml", "--out", "top.py/below"], "cannot be written to"),
        (["info", "nowhere"], "There is no folder or file nowhere."),
        (["info", "."], "holds no results of coadjoint"),
        (["info", "top.py"], "is not a netCDF file"),
        (["plot", ".", "energy", "."], "`plot` draws one folder, but . is another: `coadjoint compare . . --out DIR`"),
        (["plot", "."], "holds no results of coadjoint: there are no trajectories"),
        (["audit", "--out", "top.py"], "The folder top.py cannot be made"),
        (["models", "heavy_toop"], "did you mean `heavy_top`?"),
    ],
)
def test_what_cannot_be_done_is_one_sentence_and_status_2(tmp_path, capsys, arguments, words):
    write(tmp_path, TOP)
    assert main(arguments) == 2
    out, err = told(capsys)
    assert out == ""
    assert words in err
    assert err.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} <= {"top.toml", "top.py", "__pycache__"}


@pytest.mark.long
def test_a_step_that_fails_keeps_what_was_computed(tmp_path, capsys):
    changes = ["system.factory=top.py:square_root", "initial=", "initial.q=[0,0,1]", "initial.qdot=[0,0,-2]"]
    changes += ["run.dt=0.01", "run.steps=100"]
    file = write(tmp_path, TOP)
    assert main(["run", str(file), *(word for change in changes for word in ("--set", change))]) == 1
    out, err = told(capsys)
    summary = json.loads((tmp_path / "top" / "summary.json").read_text())
    saved = load(tmp_path / "top" / "trajectory.nc").dataset
    assert 0 < summary["steps"] < 100
    assert saved.sizes["time"] == summary["steps"]
    assert np.all(np.isfinite(saved.q))
    assert "not finite" in summary["failure"]
    assert f"{summary['steps']} records are kept in top/." in err
    assert "stopped before 100" in out
    assert main(["info", "top"]) == 0
    assert "not finite" in told(capsys)[0]


@pytest.mark.long
def test_figures_are_drawn_again_and_runs_compared(tmp_path, capsys):
    file = write(tmp_path, TOP_OF_CATALOGUE)
    main(["run", str(file)])
    main(["run", str(file), "--out", "finer", "--set", "run.dt=0.0005"])
    (tmp_path / "both").mkdir()
    for name in ("top", "finer"):
        (tmp_path / name / "trajectory.nc").rename(tmp_path / "both" / f"{name}.nc")
    told(capsys)
    assert main(["plot", "both", "energy", "attitude", "--format", "pdf", "--out", "figures"]) == 0
    assert told(capsys)[0].split() == ["figures/energy.pdf", "figures/attitude.pdf"]
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {"energy.pdf", "attitude.pdf"}
    assert main(["info", "both"]) == 0
    assert told(capsys)[0].count("system ") == 2
    assert main(["plot", "both/top.nc", "trajectory"]) == 2
    assert "no position to draw" in told(capsys)[1]
    assert main(["plot", "both", "--out", "both/top.nc"]) == 2
    assert "The folder both/top.nc cannot be made" in told(capsys)[1]


@pytest.mark.long
def test_every_model_of_the_catalogue_prints_a_run_file_that_runs(tmp_path, capsys):
    assert main(["models", "--json"]) == 0
    for name in json.loads(told(capsys)[0]):
        assert main(["models", name]) == 0
        (tmp_path / f"{name}.toml").write_text(told(capsys)[0])
        assert main(["run", f"{name}.toml", "--check"]) == 0
        told(capsys)
    assert main(["run", "heavy_top.toml", "--set", "run.duration=0.1", "--set", "output.figures=false"]) == 0
    found = {path.name for path in (tmp_path / "heavy_top").iterdir()}
    assert found == {"manifest.json", "run.toml", "summary.json", "trajectory.nc"}


def test_an_error_nobody_expected_is_one_sentence_too(tmp_path, capsys, monkeypatch):
    def broken(*_, **__):
        raise KeyError("nobody\nknows")

    monkeypatch.setattr("coadjoint.runs.running.simulate", broken)
    assert main(["run", str(write(tmp_path, TOP))]) == 1
    assert "KeyError" in told(capsys)[1]
    assert not (tmp_path / "top").exists()


def test_help_loads_few_modules_and_no_jax():
    code = (
        "import sys, coadjoint.cli.main as m\n"
        "try: m.main(['--help'])\n"
        "except SystemExit as end: status = end.code\n"
        "heavy = {'jax', 'numpy', 'matplotlib', 'xarray', 'scipy'} & set(sys.modules)\n"
        "print(len(sys.modules))\n"
        "sys.exit(f'{status} {heavy}' if status or heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for command in ("reproduce", "run", "plot", "info", "models"):
        assert command in done.stdout
    assert int(done.stdout.split()[-1]) < 300, "modules, of the interpreter and all"


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize(
    ("number", "status", "word"),
    [(signal.SIGINT, 130, "Interrupted"), (signal.SIGTERM, 143, "Terminated")],
    ids=["Ctrl-C", "SIGTERM"],
)
def test_an_interrupted_run_ends_cleanly_and_keeps_what_it_has(tmp_path, number, status, word):
    file = write(tmp_path, TOP)
    process = subprocess.Popen(
        [*MAIN, "run", str(file), "--set", "run.steps=2000000000", "--set", "run.save_every=1000000"],
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    until = time.monotonic() + 300
    while not (tmp_path / "top" / "unfinished").exists() and time.monotonic() < until:
        time.sleep(0.05)
    time.sleep(1.0)
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert process.returncode == status
    assert err.startswith(f"{word}; `coadjoint resume top`")
    assert err.count("\n") == 1
    assert {entry.name for entry in (tmp_path / "top").iterdir()} == {
        "run.toml",
        "inputs",
        "manifest.json",
        "unfinished",
    }


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_sigterm_ends_a_command_in_a_sentence_and_its_handler_goes_with_it(capsys, monkeypatch):
    def stopped(self):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(5.0)

    monkeypatch.setattr(commands.Models, "__call__", stopped)
    assert main(["models"]) == 143
    assert capsys.readouterr().err == "Terminated.\n"
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_who_handles_sigterm_keeps_the_handler(capsys, monkeypatch):
    came: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: came.append(number))
    try:
        monkeypatch.setattr(commands.Models, "__call__", lambda self: os.kill(os.getpid(), signal.SIGTERM) or 0)
        assert main(["models"]) == 0
    finally:
        signal.signal(signal.SIGTERM, before)
    assert came == [signal.SIGTERM]


def test_a_reader_that_goes_away_is_no_error(tmp_path):
    main(["run", str(write(tmp_path, TOP_OF_CATALOGUE))])
    command = f"{' '.join([sys.executable, '-m', 'coadjoint.cli.main'])} info top | true"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, cwd=tmp_path)
    assert done.stderr == ""


PACKAGES = f"JAX {jax.__version__}, llvmlite {llvmlite.__version__}, NumPy {np.__version__}"
WITH = f"Python {platform.python_version()}, {PACKAGES}"


def test_the_version_names_the_package_and_what_it_runs_with(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"coadjoint {coadjoint.__version__} with {WITH}\n"


def test_an_error_that_nobody_foresaw_names_the_versions_and_asks_for_a_report(capsys, monkeypatch):
    def fail(self):
        raise KeyError("num_consts")

    monkeypatch.delenv("COADJOINT_TRACEBACK", raising=False)
    monkeypatch.setattr(commands.Models, "__call__", fail)
    assert main(["models"]) == commands.FAILED
    told = capsys.readouterr().err
    assert "KeyError: 'num_consts'" in told
    assert WITH in told
    assert all(word in told for word in ("Please report", "the command", "the file", "COADJOINT_TRACEBACK=1"))
    assert "Traceback" not in told
    monkeypatch.setenv("COADJOINT_TRACEBACK", "1")
    with pytest.raises(KeyError):
        main(["models"])
