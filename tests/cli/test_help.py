"""Help of commands: words for values, each option documented; suggestions, sections in messages, doctor, completion."""

from __future__ import annotations

import ast
import inspect
import json
import re
from dataclasses import fields
from itertools import pairwise
from pathlib import Path
from typing import get_args

import pytest

from coadjoint.checks import unknown
from coadjoint.cli import installation
from coadjoint.cli.main import every_command, main
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.library import digest_of_files
from coadjoint.known_names import written_out
from coadjoint.sections import of_section

COMMANDS = {get_args(one)[1].name: get_args(one)[0] for one in get_args(every_command())}


def printed(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit):
        main([*arguments, "--help"])
    return capsys.readouterr().out


@pytest.mark.parametrize("name", COMMANDS)
def test_help_documents_each_option_and_has_words_for_values(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = printed([name], capsys)
    assert not re.search(r"\bSTR\b|\bPATH\b|\bINT\b|\bFLOAT\b|None|default: (''|\))", text)
    (tree,) = ast.parse(inspect.getsource(COMMANDS[name])).body
    assert isinstance(tree, ast.ClassDef)
    said = {
        ast.unparse(one.target): below.value.value
        for one, below in pairwise(tree.body)
        if isinstance(one, ast.AnnAssign) and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
    }
    for field in fields(COMMANDS[name]):
        assert str(said[field.name]).endswith("."), f"{field.name} has no sentence"


def test_the_first_help_names_version_and_all_commands(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed([], capsys)
    assert "--version" in text and all(f"• {name}" in text for name in COMMANDS)
    assert main(["--version"]) == 0 and capsys.readouterr().out.startswith("coadjoint ")


@pytest.mark.parametrize(
    ("given", "known", "meant"),
    [
        ("speed_kts", ["speed", "depth"], "speed_knots"),
        ("spd_kts", ["speed", "depth"], "speed_knots"),
        ("hdg_degrees", ["heading", "time"], "heading_deg"),
        ("duration_mins", ["duration", "dt"], "duration_min"),
        ("pos", ["position"], "position"),
        ("depth_ft", ["depth"], ""),
        ("xyz_kts", ["speed"], ""),
    ],
)
def test_suggestions_know_abbreviations_of_names_and_units(given: str, known: list[str], meant: str) -> None:
    assert written_out(given, known) == meant
    if meant:
        assert f"did you mean `{meant}`?" in unknown(f"key `{given}`", "Section [a]", given, known)


def test_errors_of_arguments_are_those_of_keys_inside_a_section() -> None:
    with pytest.raises(ArgumentError, match=r"^`water\.velocity` must have shape \(3,\)\.$"), of_section("water"):
        raise ArgumentError("Argument `velocity` must have shape (3,).")
    with pytest.raises(ArgumentError, match=r"^The vehicle sinks\."), of_section("water"):
        raise ArgumentError("The vehicle sinks.")


def test_the_doctor_says_what_is_missing_and_what_to_do(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setenv("COADJOINT_CACHE", str(tmp_path))
    (tmp_path / "code").write_bytes(bytes(2_000_000))
    version = installation._version
    monkeypatch.setattr(installation, "_version", lambda name: "" if name == "casadi" else version(name))
    assert main(["doctor", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["versions"].startswith("coadjoint ") and found["cache"] == f"{tmp_path}: 1 files, 2.0 MB"
    assert found["files"] == f"SHA-256 {digest_of_files()[:16]} of the library's own"
    assert found["[control]"].startswith("lacks casadi: ") and "cpu" in found["devices"]
    assert any('pip install "coadjoint[control]"' in sentence for sentence in found["to do"])
    assert found["ffmpeg"].startswith("not on the PATH")
    monkeypatch.setenv("COADJOINT_CACHE", "")
    assert installation._cache()[0] == "off" and "Unset COADJOINT_CACHE" in installation._cache()[1][0]


def test_requirements_of_an_extra_are_names_of_packages() -> None:
    assert installation.requirements("coadjoint", "cluster") == ["dask", "distributed"]


def test_a_script_completes_commands(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "bash"]) == 0
    assert "doctor" in capsys.readouterr().out
