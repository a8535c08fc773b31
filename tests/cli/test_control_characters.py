"""Names, files and folders of others do not command the terminal: control characters are printed as escapes."""

from __future__ import annotations

import json
import logging
import os
import re
import sys
import tomllib
import warnings
from pathlib import Path

import pytest

import coadjoint as co
from coadjoint.cli import terminal
from coadjoint.cli.main import main
from coadjoint.errors import CoadjointError, Interrupted, printable, warn
from coadjoint.log import logger
from coadjoint.simulation.progress import Progress, compiling
from coadjoint_vehicles.files.registry import vehicle_text
from imports import files

HOSTILE = "\x1b]0;owned\x07\x9b2J\x08\r\x7f\u202e\u2066\u2028"
"""Sets the title of a window, clears the screen, goes back, turns the direction of text."""
ESCAPED = r"\u001b]0;owned\u0007\u009b2J\u0008\u000d\u007f\u202e\u2066\u2028"
PRINTING = {"cli/terminal.py", "cli/start.py", "simulation/progress.py"}
BAD = set(HOSTILE) - set("]0;owned2J")


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture(params=[False, True], ids=["piped", "terminal"])
def stream(request, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "200")
    for name in ("stdout", "stderr"):
        monkeypatch.setattr(getattr(sys, name), "isatty", lambda: request.param)


def printed(capsys, *arguments: str) -> str:
    """What a command prints, on both streams; what a terminal would obey fails."""
    main(list(arguments))
    found = capsys.readouterr()
    text = found.out + found.err
    assert "Traceback" not in text and "did not expect" not in text
    assert not (set(text) & (BAD - {"\x1b"})) and "\x1b]" not in text, repr(text)
    return text


def quoted(text: str) -> str:
    """A text of TOML."""
    return json.dumps(text).replace("\x7f", "\\u007f")


def vehicle(name: str = "mine.toml") -> str:
    """The file of a vehicle with hostile names, notes and sources."""
    text = vehicle_text("ellipsoid").replace('name = "', f"name = {quoted(HOSTILE)[:-1]}\\n[system]\\n", 1)
    text = text.replace('note = "Nothing', f"note = {quoted(HOSTILE)[:-1]}Nothing").replace(
        'OWN = "', f"OWN = {quoted(HOSTILE)[:-1]}"
    )
    text = text.replace('description = "', f"description = {quoted(HOSTILE)[:-1]}", 1)
    Path(name).write_text(text, encoding="utf-8")
    return name


def test_escapes_mean_the_same_character_in_json_and_toml():
    assert printable(f"a\tb\n{HOSTILE}é𝒢") == f"a\tb\n{ESCAPED}é𝒢"
    assert printable("\ud800x") == r"\ud800x"
    raw = json.dumps({"name": HOSTILE}, ensure_ascii=False)
    assert json.loads(printable(raw)) == {"name": HOSTILE}
    assert tomllib.loads(f'name = "{printable(HOSTILE)}"') == {"name": HOSTILE}


def test_errors_warnings_and_log_messages_hold_no_control_characters(caplog):
    assert str(CoadjointError(f"No {HOSTILE}.")) == f"No {ESCAPED}."
    with terminal.warned():
        assert warnings.formatwarning(f"Look: {HOSTILE}", UserWarning, "x.py", 1) == f"Warning: Look: {ESCAPED}\n"
        assert ESCAPED in warnings.formatwarning(HOSTILE, RuntimeWarning, "x.py", 1)
    with pytest.warns(UserWarning) as told:
        warn(HOSTILE)
    assert str(told[0].message) == ESCAPED and told[0].filename == __file__
    assert str(Interrupted(HOSTILE)) == ESCAPED
    with caplog.at_level(logging.INFO, "coadjoint"):
        logger("coadjoint.here").info("%s: %d steps", HOSTILE, 3)
    assert caplog.messages == [f"{ESCAPED}: 3 steps"]


def test_tables_lines_and_json_hold_no_control_characters(stream, capsys):
    terminal.table((HOSTILE, "[bold]b[/x]"), [(HOSTILE, f"a\n{HOSTILE}")])
    terminal.fields([(HOSTILE, "x")])
    terminal.line(HOSTILE)
    terminal.text(HOSTILE)
    terminal.json([HOSTILE])
    terminal.complain(HOSTILE)
    found = capsys.readouterr()
    assert not (set(found.out + found.err) & (BAD - {"\x1b"})) and "\x1b]" not in found.out + found.err
    assert (found.out + found.err).count(ESCAPED) == 7 and "[bold]b[/x]" in found.out


def test_a_bar_of_progress_shows_a_title_as_text(capsys):
    with Progress(10, True, f"{HOSTILE}[/x]") as bar:
        bar.advance(5, 2.0)
        assert bar._bar.tasks[0].description == f"{ESCAPED}[/x]"
    with compiling(f"{HOSTILE}[/x]", "of a system", True):
        pass
    assert not (set(capsys.readouterr().err) & (BAD - {"\x1b"}))


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "arguments",
    [("vehicles", "show"), ("vehicles", "show", "--json"), ("vehicles", "show", "--toml"), ("vehicles", "mission")],
    ids=" ".join,
)
def test_vehicles_of_others_are_shown_with_escapes(capsys, arguments):
    text = printed(capsys, *arguments[:2], vehicle(), *arguments[2:])
    assert ESCAPED in text or "owned" in text
    if arguments[-1] == "--json":
        assert json.loads(text)["description"].startswith(HOSTILE)
    if arguments[-1] == "mission":
        assert "system" not in tomllib.loads(text)


def test_folders_of_others_are_told_with_escapes(stream, capsys):
    folder = Path(f"run{HOSTILE}")
    folder.mkdir()
    (folder / "summary.json").write_text(json.dumps({"card": f"system  {HOSTILE}", "failure": HOSTILE}))
    for command in (("info",), ("info", "--json"), ("verify",), ("plot",), ("report",), ("resume",), ("view",)):
        text = printed(capsys, command[0], str(folder), *command[1:])
        assert "owned" in text, command
    assert "owned" in printed(capsys, "compare", str(folder), str(folder))
    (folder / "trajectory.nc").write_text(HOSTILE)
    assert "owned" in printed(capsys, "plot", str(folder))


def test_run_files_logs_and_models_of_others_are_refused_with_escapes(stream, capsys):
    file, raw = Path(f"{HOSTILE}.toml"), os.fsdecode(b"\xff.toml")
    file.write_text(f"{quoted(HOSTILE)} = 1\n[system]\n{quoted(HOSTILE)} = {quoted(HOSTILE)}\n", encoding="utf-8")
    for arguments in (("run", str(file)), ("run", str(file), "--check"), ("sweep", str(file)), ("run", raw)):
        assert "\\u" in printed(capsys, *arguments) or "\\x" in printed(capsys, *arguments)
    Path("log.csv").write_text(f"time_s,{HOSTILE.replace(chr(13), '')}\n0,1\n1,2\n", encoding="utf-8")
    printed(capsys, "identify", vehicle(), "log.csv", "--parameters", HOSTILE)
    Path("a.urdf").write_text(
        f'<robot name="{HOSTILE[8:10]}&#x9b;2J"><link name="a&#x9b;b"/></robot>', encoding="utf-8"
    )
    printed(capsys, "import", "a.urdf")
    assert "\\u001b" in printed(capsys, "serve", HOSTILE) and "\\u001b" in printed(capsys, "models", HOSTILE)


@pytest.mark.long
def test_two_runs_of_others_are_compared_with_escapes(stream, capsys):
    def lagrangian(xi):
        return 0.5 * xi @ xi

    for name in (f"a{HOSTILE}.nc", f"b{HOSTILE}.nc"):
        system = co.System(co.SO3(), lagrangian, name=HOSTILE)
        run = co.simulate(system, system.state(xi=[0, 0, 1.0]), dt=0.1, duration=0.2, progress=False)
        run.save(name)
    for arguments in (("compare", *sorted(map(str, Path(".").glob("*.nc")))), ("info", f"a{HOSTILE}.nc")):
        assert ESCAPED in printed(capsys, *arguments)
    assert ESCAPED in str(run) and ESCAPED in str(co.load(f"a{HOSTILE}.nc"))


def test_commands_print_through_one_place_alone():
    """No other module prints, writes to a stream, or has a console of rich, but the bars of progress."""
    telling = re.compile(r"^\s*print\(|[ :]print\(.*\)$|sys\.std(?:out|err)\.write|^\s*(?:from|import) rich\b", re.M)
    texts = {name: file.read_text(encoding="utf-8") for name, file in files().items()}
    found = {name: telling.findall(re.sub(r'""".*?"""', "", text, flags=re.S)) for name, text in texts.items()}
    assert {name for name, calls in found.items() if calls} == PRINTING
    assert found["cli/start.py"] == ["sys.stderr.write"]  # of two words of its own
    assert {name for name, text in texts.items() if "warnings.warn(" in text} == {"errors.py"}


@pytest.mark.parametrize("arguments", [("info", "a.nc", HOSTILE), ("info", "a.nc", f"--{HOSTILE}"), (HOSTILE,)])
def test_arguments_that_fit_no_command_are_shown_with_escapes(capsys, arguments):
    """As in `coadjoint info *` in a folder of somebody else."""
    with pytest.raises(SystemExit):
        printed(capsys, *arguments)
    found = capsys.readouterr()
    assert "own" in found.out + found.err and not (set(found.out + found.err) & BAD)
