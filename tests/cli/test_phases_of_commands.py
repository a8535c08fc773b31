"""A command shows what it does while it does it: its first line before anything is loaded, then a line a phase."""

from __future__ import annotations

import dataclasses
import logging
import subprocess
import sys

import pytest

import coadjoint as co
from coadjoint.cli import main as command_line
from coadjoint.cli import terminal
from coadjoint.cli.main import COMMANDS, Command, main
from coadjoint.extensions import import_string
from coadjoint.log import PHASES, phase
from files import TOP_OF_CATALOGUE, write

QUICK = {"Completion", "Models"}
"""Commands that load nothing."""


def all_commands():
    kinds = [kind.__origin__ for kind in Command.__args__]
    return [*kinds, *map(import_string, COMMANDS.values())]


def test_every_command_that_loads_something_has_a_first_line():
    for kind in all_commands():
        begins = getattr(kind, "BEGINS", "")
        assert bool(begins) == (kind.__name__ not in QUICK), kind
        names = {field.name: field.name for field in dataclasses.fields(kind)}
        assert not begins or begins.format(**names).endswith(".")


def test_the_first_line_is_there_before_the_command_begins(capsys, monkeypatch, tmp_path):
    seen = []
    monkeypatch.setattr(command_line.Verify, "__call__", lambda self: seen.append(capsys.readouterr().err) or 0)
    assert main(["verify", "there"], alone=True) == 0
    assert main(["verify", "there", "--json"], alone=True) == 0
    assert main(["verify", "there"]) == 0
    assert seen == ["Reading there.\n", "", ""]


def test_the_first_line_needs_nothing_that_is_slow_to_load():
    """Every command then begins with nothing more than `run`: its dataclass is loaded, its call not begun."""
    code = (
        "import sys; from coadjoint.cli import commands, main; from coadjoint.log import phase;"
        "commands.Run.__call__ = lambda self: print(*sys.modules) or 0;"
        "main.main(['run', 'a.toml'], alone=True)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "Reading a.toml.\n"
    assert not {"jax", "numpy", "xarray", "matplotlib", "dask"}.intersection(done.stdout.split())


def test_phases_are_lines_on_stderr_only_inside(capsys):
    phase("Reading %s.", "before")
    with terminal.phases():
        for _ in range(3):
            phase("Reading %s.", "a\x07b")
    with terminal.phases(False):
        phase("Reading %s.", "quietly")
    phase("Reading %s.", "after")
    assert capsys.readouterr().err == "Reading a\\u0007b.\n"
    assert PHASES.level == logging.NOTSET


def test_a_run_reports_tracing_compiling_and_running_once_each(caplog, monkeypatch, tmp_path):
    monkeypatch.setenv("COADJOINT_CACHE", str(tmp_path))
    system = co.System(co.SO2(), lambda xi: 0.625 * xi @ xi, name="flywheel")
    start = system.state(xi=[1.0])
    with caplog.at_level(logging.DEBUG, PHASES.name):
        for _ in range(2):
            run = co.simulate(system, start, dt=0.1, steps=5, progress=False, accuracy=False)
    said = [record.getMessage() for record in caplog.records if record.name == PHASES.name]
    running = f"Running {run.title}, 5 steps."
    assert said == ["Tracing the functions of flywheel.", "Compiling a step.", running, running]


@pytest.mark.long
def test_a_command_shows_its_phases_in_their_order(tmp_path):
    file = write(tmp_path, TOP_OF_CATALOGUE)
    command = [sys.executable, "-m", "coadjoint", "run", str(file), "--out", "top"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=True)
    words = [line.split()[0] for line in done.stderr.splitlines()]
    assert words == ["Reading", "Tracing", "Compiling", "Running", "Drawing"]
    again = subprocess.run(
        [*command, "--json", "--overwrite"], capture_output=True, text=True, cwd=tmp_path, check=True
    )
    assert again.stderr == ""


def test_dask_is_left_out_only_where_no_file_of_python_and_no_package_of_others_may_use_it(tmp_path, monkeypatch):
    plain, own = write(tmp_path, TOP_OF_CATALOGUE), write(tmp_path, 'factory = "a.py:make"', "own.toml")
    run, resume, sweep = (command_line.commands.Run, command_line.commands.Resume, command_line.Sweep)
    may = command_line._may_use_dask
    assert [may(run(plain)), may(run(own)), may(run(tmp_path / "no.toml")), may(sweep(plain))] == [0, 1, 1, 1]
    write(tmp_path, TOP_OF_CATALOGUE, "run.toml")
    assert not may(resume(tmp_path)) and may(resume(tmp_path / "none"))
    assert not may(run(write(tmp_path, f'{TOP_OF_CATALOGUE}  # or factory = "a.py:make"', "comment.toml")))
    assert may(run(write(tmp_path, 'name = "a#b"\nother = [{factory = "a.py:make"}]', "nested.toml")))
    assert may(run(write(tmp_path, "no TOML", "damaged.toml")))
    monkeypatch.setattr(command_line, "extensions", lambda: ["somebody.extension"])
    assert may(run(plain))
