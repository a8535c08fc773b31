"""A part that fails, a skip that is not listed, and a run without tests fail the checks."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / ".ci"))
import bounded  # noqa: E402
import parts  # noqa: E402

PYTEST = (
    """for word; do case $word in --junitxml=*) printf '%s' "$REPORT" > "${word#*=}";; esac; done; exit "$STATUS" """
)
"""A program that takes the place of pytest: it writes a report and ends with a status."""
LISTED = '[[skip]]\nfile = "tests/a/test_?"\nmessage = "no browser"\nparts = ["tests", "long*"]\nreason = "it may"\n'


@pytest.fixture
def checks(tmp_path: Path) -> parts.Checks:
    (tmp_path / "skips.toml").write_text(LISTED)
    return parts.Checks(tmp_path, 60.0, tmp_path / "skips.toml")


def case(inner: str = "", file: str = "tests.a.test_b") -> str:
    return f'<testcase classname="{file}" name="test_c[1]">{inner}</testcase>'


def skipped(message: str, file: str = "tests.a.test_b") -> str:
    return case(f'<skipped type="pytest.skip" message="{message}">file: {message}</skipped>', file)


def run_tests(checks: parts.Checks, *cases: str, status: int = 0, part: str = "tests", least: int = 1) -> bool:
    report = f"<testsuites><testsuite>{''.join(cases)}</testsuite></testsuites>"
    return checks.tests(part, "bash", "-c", PYTEST, "pytest", least=least, REPORT=report, STATUS=str(status))


def test_parts_that_pass_make_a_table_and_status_0(checks, capfd):
    assert checks.run("lint", "true") and run_tests(checks, case(), case(), skipped("no browser"))
    assert checks.close() == 0
    lines = capfd.readouterr().out.splitlines()
    assert lines[-1] == "2 passed, 0 failed, 1 skipped" and lines[-2].endswith("all parts passed")
    assert [line.split()[1] for line in lines[-6:-2]] == ["part", "lint", "tests", "all"]
    assert lines[-4].split()[4:] == ["2", "1", "skipped"]


def test_a_part_that_fails_fails_the_run_and_the_next_ones_run(checks, capfd):
    assert not checks.run("types", "false") and not checks.run("site", "no-such-program")
    assert run_tests(checks, case())
    assert checks.close() == 1
    assert "FAILED: types, site" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("cases", "status"),
    [
        ([case(), case("<failure>it is wrong</failure>")], 1),
        ([case(), case("<error>a fixture</error>")], 0),
        ([case()], 1),  # a budget that is exceeded
        ([], 5),
        ([], 0),
        ([skipped("no browser")], 0),
    ],
)
def test_tests_that_fail_or_do_not_run_fail_the_run(checks, cases, status):
    assert not run_tests(checks, *cases, status=status)
    assert checks.close() == 1


def test_fewer_tests_than_expected_fail_and_where_all_may_be_left_out_there_must_be_some(checks):
    assert not run_tests(checks, case(), case(), least=3)
    assert run_tests(checks, skipped(bounded.LEFT_OUT), least=0)
    assert not run_tests(checks, status=5, least=0)


def test_a_report_that_was_not_written_fails(checks):
    assert not checks.tests("tests", "true")


@pytest.mark.parametrize(
    ("message", "file", "part", "passes"),
    [
        ("no browser", "tests.a.test_b", "tests", True),
        ("no browser", "tests.a.test_b", "long, changed", True),
        ("no browser", "tests.a.test_b", "plotting", False),
        ("no browser", "tests.c.test_b", "tests", False),
        ("no Sphinx", "tests.a.test_b", "tests", False),
    ],
)
def test_a_skip_that_is_not_listed_for_the_part_fails(checks, capfd, message, file, part, passes):
    assert run_tests(checks, case(), skipped(message, file), part=part) == passes
    assert (f"{file}::test_c[1]" in capfd.readouterr().out) != passes


def test_a_file_that_is_skipped_while_it_is_collected_is_compared_with_the_list(checks):
    whole = '<testcase classname="" name="tests.a.test_b"><skipped message="collection skipped">{}</skipped></testcase>'
    assert run_tests(checks, case(), whole.format("('/tests/a/test_b.py', 1, 'Skipped: no browser')"))
    assert not run_tests(checks, case(), whole.format("('/tests/a/test_b.py', 1, 'Skipped: no Numba')"))


def test_a_run_in_which_no_test_ran_fails(checks, capfd):
    assert checks.run("lint", "true")
    assert checks.close() == 1
    assert "no test ran" in capfd.readouterr().out


def test_what_was_left_out_is_counted_and_no_skip(checks, capfd):
    assert run_tests(checks, case(), skipped(bounded.LEFT_OUT), skipped(bounded.LEFT_OUT))
    assert checks.close() == 0
    assert "1 2 left out" in capfd.readouterr().out


def test_at_the_deadline_a_part_and_what_it_started_are_ended(tmp_path):
    (tmp_path / "skips.toml").write_text(LISTED)
    checks = parts.Checks(tmp_path, 0.2, tmp_path / "skips.toml")
    began = time.monotonic()
    assert not checks.run("slow", "bash", "-c", f"sleep 60 & echo $! > {tmp_path}/child; wait")
    assert time.monotonic() - began < 30, "the part ended by itself"
    child = int((tmp_path / "child").read_text())
    for _ in range(200):  # the system may take a moment
        if not Path(f"/proc/{child}").exists() or "\nState:\tZ" in Path(f"/proc/{child}/status").read_text():
            break
        time.sleep(0.01)
    else:
        pytest.fail("the process that the part started is still there")
    assert checks.close() == 1


def test_the_processor_time_of_children_is_counted(checks):
    checks.run("busy", "bash", "-c", "(for ((i = 0; i < 60000; i++)); do :; done); sleep 0.1")
    (outcome,) = checks.outcomes
    assert outcome.processor > 0.01 and outcome.wall > 0.1


@pytest.mark.parametrize(
    ("within", "before", "workers", "begins"),
    [(1e9, float("inf"), "1", True), (0.0, float("inf"), "1", False), (1e9, 0.0, "1", False), (2.0, 1e99, "2", False)],
)
def test_no_test_begins_after_its_processes_share_of_the_time(monkeypatch, within, before, workers, begins):
    monkeypatch.setenv("PYTEST_XDIST_WORKER_COUNT", workers)
    monkeypatch.setattr(os, "times", lambda: (0.5, 0.25, 0.25, 0.25, 9.0))
    item = SimpleNamespace(config=SimpleNamespace(option=SimpleNamespace(within=within, before=before)))
    if begins:
        bounded.pytest_runtest_setup(item)
    else:
        with pytest.raises(pytest.skip.Exception, match=bounded.LEFT_OUT):
            bounded.pytest_runtest_setup(item)


def test_tests_run_backwards_where_that_is_asked_for():
    items = [1, 2, 3]
    for backwards, expected in ((False, [1, 2, 3]), (True, [3, 2, 1])):
        bounded.pytest_collection_modifyitems(SimpleNamespace(option=SimpleNamespace(backwards=backwards)), items)
        assert items == expected


def test_a_temporary_folder_vanishes_when_its_program_is_ended():
    program = "import parts, os, signal\nwith parts.temporary() as f:\n print(f, flush=True); os.kill(os.getpid(), 15)"
    done = parts.subprocess.run(
        [sys.executable, "-c", program], env={"PYTHONPATH": str(ROOT / ".ci")}, capture_output=True, text=True
    )
    assert done.returncode == 143 and not Path(done.stdout.strip()).exists() and done.stdout.strip()
