"""What the checks run: README's command among them, one path of each package, and every test in the audit."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / ".ci"))
import changes  # noqa: E402
import checks  # noqa: E402
import install  # noqa: E402
import prereleases  # noqa: E402

import audit  # noqa: E402
import environments  # noqa: E402

README = (ROOT / "README.md").read_text("utf-8")


class Recorded:
    """In the place of the checks: the commands of the parts, all of which pass but those that are named."""

    def __init__(self, folder: Path, failing: tuple[str, ...] = ()) -> None:
        self.folder, self.failing, self.notes = folder, failing, []
        self.commands: dict[str, list[str]] = {}

    def note(self, text: str) -> None:
        self.notes.append(text)

    def run(self, part: str, *command: str | Path, **_: object) -> bool:
        self.commands[part] = [str(word) for word in command]
        if part == "archive and wheel":
            (self.folder / "dist").mkdir()
            (self.folder / "dist/coadjoint-1-py3-none-any.whl").touch()
            (self.folder / "dist/coadjoint_vehicles-1-py3-none-any.whl").touch()
        return part not in self.failing

    tests = run


@pytest.fixture
def two_pythons(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Two versions of Python, and a changed package that has a test marked `long`."""
    (tmp_path / "test_long.py").write_text("@pytest.mark.long\n")
    monkeypatch.delenv("BASE", raising=False)
    monkeypatch.setattr(environments, "OWN", "3.11")
    monkeypatch.setattr(environments, "pythons", lambda: {"3.12": "/python3.12"})
    monkeypatch.setattr(changes, "base", lambda: changes.Base("abc", "compared with abc"))
    monkeypatch.setattr(changes, "changed", lambda commit: {"src/coadjoint/groups/so3.py"})
    monkeypatch.setattr(changes, "chosen", lambda files: changes.Choice(["groups"], [f"{tmp_path}/test_long.py"], []))


def test_the_command_of_the_readme_is_the_one_that_runs(two_pythons, tmp_path):
    recorded = Recorded(tmp_path)
    checks.all_parts(recorded)
    (line,) = [line for line in README.splitlines() if "-m pytest" in line and line.startswith("python3 -m venv")]
    words = shlex.split(line.split(" && ")[-1])
    assert words[0] == ".venv/bin/python"
    assert recorded.commands["tests"][: len(words)] == [f"{tmp_path}/tests/bin/python", *words[1:]]
    requirement, above = (word for word in recorded.commands["tests: install"] if ".whl" in word)
    assert requirement.endswith("coadjoint-1-py3-none-any.whl[test]") and '".[test]" ./vehicles' in line
    assert above.endswith("coadjoint_vehicles-1-py3-none-any.whl")
    (alone,) = (word for word in recorded.commands["core: install"] if ".whl" in word)
    assert alone.endswith("coadjoint-1-py3-none-any.whl")


@pytest.mark.parametrize(
    "readme",
    [
        "",
        README.replace('".[test]"', '".[test,docs]"'),
        README.replace(".venv/bin/python -m pytest", "python -m pytest"),
        README + README,
    ],
)
def test_a_readme_with_another_command_is_an_error(readme):
    with pytest.raises(ValueError, match=r"README\.md must"):
        environments.readme_command(readme)


def test_every_part_is_there_in_its_order(two_pythons, tmp_path):
    recorded = Recorded(tmp_path)
    checks.all_parts(recorded)
    ended = ("install", "reproduce", "selection")
    assert list(recorded.commands) == [
        *(
            "tools",
            "archive and wheel",
            "vehicles: archive and wheel",
            "tests: install",
            "version",
            "lint",
            "format",
            "types",
            "interface",
        ),
        *("more: install", "site", "extras", "other libraries", "core: install", "core: reproduce", "tests"),
        *(f"3.12: {end}" for end in ended),
        *(f"oldest: {end}" for end in ended),
        "long, changed",
    ]
    assert "no Python 3.13 was found: it is not tested" in recorded.notes
    assert recorded.commands["oldest: install"][-2] == "--constraint"
    assert "coadjoint-1-py3-none-any.whl[test]" in recorded.commands["3.12: install"][-2]
    assert recorded.commands["3.12: selection"][-len(checks.selection()) :] == checks.selection()


@pytest.mark.parametrize(
    ("commit", "packages", "within"),
    [("abc", 0, 100.0), ("abc", 1, 100.0), ("abc", 2, 200.0), ("abc", 9, 300.0), (None, 0, 300.0)],
)
def test_the_time_of_long_tests_grows_with_the_changed_packages_to_a_limit(
    two_pythons, monkeypatch, tmp_path, commit, packages, within
):
    recorded, file = Recorded(tmp_path), f"{tmp_path}/test_long.py"
    monkeypatch.setattr(changes, "base", lambda: changes.Base(commit, "why"))
    monkeypatch.setattr(changes, "every_test", lambda: [file])
    monkeypatch.setattr(changes, "chosen", lambda files: changes.Choice(["a"] * packages, [file], []))
    checks.long_tests(recorded, tmp_path / "python", 5.0)
    command = recorded.commands["long, changed"]
    assert command[command.index("--within") + 1] == str(within)
    assert command[command.index("--before") + 1] == str(5.0 + checks.LAST)


@pytest.mark.parametrize("failing", ["tools", "archive and wheel", "tests: install"])
def test_without_the_library_nothing_else_is_tried(two_pythons, tmp_path, failing):
    recorded = Recorded(tmp_path, (failing,))
    checks.all_parts(recorded)
    assert list(recorded.commands)[-1] == failing


def test_a_version_that_cannot_be_installed_is_left_and_the_others_run(two_pythons, tmp_path):
    recorded = Recorded(tmp_path, ("3.12: install", "more: install"))
    checks.all_parts(recorded)
    assert {"3.12: selection", "site"}.isdisjoint(recorded.commands) and "oldest: selection" in recorded.commands


def test_a_run_that_is_interrupted_fails_and_says_so(capfd):
    def parts(run):
        assert run.run("lint", "true")
        raise ValueError("README.md must be there")

    with pytest.raises(ValueError, match="must be there"):
        checks.completed(60.0, parts)
    assert "FAILED: ValueError('README.md must be there')" in capfd.readouterr().out


def test_what_is_left_out_differs_between_commits():
    files = [str(i) for i in range(40)]
    assert checks.by_hash(files, "a") == checks.by_hash(files, "a") != checks.by_hash(files, "b")
    assert sorted(checks.by_hash(files, "a")) == sorted(files)


@pytest.mark.parametrize("uv", ["works", "fails", "is missing"])
def test_pip_installs_where_uv_does_not(monkeypatch, tmp_path, uv):
    ran = []

    def done(*command):
        ran.append(Path(command[0]).name)
        return not (uv == "fails" and ran[-1] == "uv" and "install" in command)

    monkeypatch.setattr(install, "done", done)
    (tmp_path / "bin").mkdir()
    if uv != "is missing":
        (tmp_path / "bin/uv").touch()
    assert install.environment(tmp_path, tmp_path / "new", Path("/python3.12"), "coadjoint")
    by_uv, by_pip = ["uv", "uv"], ["python3.12", "python"]
    assert ran == {"works": by_uv, "fails": by_uv + by_pip, "is missing": by_pip}[uv]


def start(tmp_path: Path, program: str, **environment: str) -> subprocess.CompletedProcess:
    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\n{program}\n")
    python.chmod(0o755)
    environment = {"PATH": "/usr/bin:/bin", "PYTHON": str(python)} | environment
    command = ["bash", str(ROOT / ".ci/run"), "word"]
    return subprocess.run(command, env=environment, capture_output=True, text=True, input="typed")


def test_the_script_has_the_status_of_the_program_that_writes_byte_code_and_reads_nothing(tmp_path):
    program = '[ "$1" = -c ] || { echo "$@ ${PYTHONDONTWRITEBYTECODE-unset} $(cat)"; exit 3; }'
    done = start(tmp_path, program, PYTHONDONTWRITEBYTECODE="1")
    assert (done.returncode, done.stdout) == (3, ".ci/checks.py word unset \n")


def test_the_script_fails_without_a_python(tmp_path):
    done = start(tmp_path, "exit 1")
    assert done.returncode == 1 and "No Python from 3.11 to 3.14" in done.stdout


def test_the_audit_repeats_the_command_of_the_readme_with_other_seeds_in_both_orders_on_a_busy_machine(
    monkeypatch, tmp_path
):
    loops, ended = [], []

    class Loop:
        def __init__(self, command):
            loops.append(self)
            self.kill = lambda: ended.append(self)

        def wait(self):
            assert self in ended

    monkeypatch.setattr(audit.subprocess, "Popen", Loop)
    recorded = Recorded(tmp_path, ("repeat 7",))
    busy = []
    monkeypatch.setattr(
        recorded, "tests", lambda *words, **more: busy.append(len(loops) - len(ended)) or recorded.run(*words, **more)
    )
    assert not audit.repeats(recorded, tmp_path / "python")
    words = environments.readme_command(README)[1:]
    assert all(command[1 : 1 + len(words)] == words for command in recorded.commands.values())
    assert busy == [2] * 10 and loops == ended
    assert ["--backwards" in command for command in recorded.commands.values()] == [False, True] * 5


def test_the_audit_runs_every_file_of_tests_and_refuses_parts_that_there_are_not():
    assert sorted(file for files in audit.suites().values() for file in files) == changes.every_test()
    assert audit.chosen(["methods", "kernels.emit"]) == ["methods", "kernels.emit"]
    assert set(audit.chosen([])) == {*audit.suites(), "versions", "repeats", "errors"}
    with pytest.raises(ValueError, match="Part `method` must be one of: audit, "):
        audit.chosen(["method"])


def test_pre_releases_are_tried_with_the_newest_python(two_pythons, tmp_path, monkeypatch):
    monkeypatch.setattr(prereleases, "OWN", "3.11")
    monkeypatch.setattr(prereleases, "pythons", environments.pythons)
    found = iter(["0.12", "0.13", "2.5", "2.5"])
    monkeypatch.setattr(prereleases, "_version", lambda *_: next(found))
    recorded = Recorded(tmp_path)
    prereleases.all_parts(recorded)
    parts = ("install pip", "pre-release", "reproduce", "selection")
    for name in ("jax", "numpy"):
        assert recorded.commands[f"{name} pre: install"][5] == "/python3.12"
        assert [part for part in recorded.commands if part.startswith(f"{name}: ")] == [
            f"{name}: {one}" for one in parts
        ]
    assert recorded.commands["jax: pre-release"][-4:] == ["--pre", "--upgrade", "jax", "jaxlib"]
    assert recorded.notes == ["jax 0.13, in place of 0.12", "numpy: nothing is newer than 2.5"]


def test_the_programs_need_the_standard_library_alone():
    command = [
        sys.executable,
        "-I",
        "-S",
        "-c",
        "import sys; sys.path.insert(0, '.'); import audit, checks, constraints, prereleases, release",
    ]
    done = subprocess.run(command, cwd=ROOT / ".ci", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
