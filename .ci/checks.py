"""What `.ci/run` runs, part after part; the dear tests of what changed come last and take what time is left."""

from __future__ import annotations

import random
import sys
import time
from collections.abc import Callable
from pathlib import Path

import changes
from parts import ROOT, Checks, Outcome, temporary

from environments import COMPANIONS, OWN, Environments, readme_command

sys.path.insert(0, str(ROOT / "tests"))
from calibration import loop

DEADLINE = 80 * 60.0
"""Wall time, s, after which the complete run is ended, and fails."""
LAST = 45 * 60.0
"""Wall time, s, after which no test marked `long` begins."""
WITHIN = {"own": (100.0, 300.0), "importing": (80.0, 150.0)}
"""Processor time, s, after which no test marked `long` begins, for each changed package and at most: of the tests of
what has changed, and of what imports that."""
LEAST = 2000
"""Tests that README's command runs at least."""
UNTIMED = ("-m", "pytest", "-n", "2", "--all")
"""Runs tests without a limit on the cost of each: the processor time of other versions is not what the limit is for."""
SITE = 120
"""Processor time that the site may take, s; it takes some 20 on a fast processor."""
EXTRAS = (
    "tests/docs/test_site.py",
    "tests/docs/test_site_contrast.py",
    "tests/docs/test_example_notebooks.py",
    "tests/benchmarks",
)
"""Tests that need more than the extra `test`, and are skipped without it."""
OTHER_LIBRARIES = "tests/docs/test_docs.py::test_recipes_with_other_libraries_run_where_they_are_installed"


def selection() -> list[str]:
    """One test of each package, for other versions."""
    lines = (ROOT / ".ci/selection.txt").read_text("utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def by_hash(files: list[str], tree: str) -> list[str]:
    """Another order for each tree of files, so that what is left out when the time is up differs."""
    return random.Random(tree).sample(files, len(files))


def long_tests(checks: Checks, python: Path, began: float) -> None:
    """The tests marked `long` of what changed, then those of what imports it."""
    found = changes.base()
    checks.note(found.why)
    if found.commit is None:
        choice = changes.Choice(["all"], changes.every_test(), [])
    else:
        choice = changes.chosen(changes.changed(found.commit))
    checks.note(f"changed packages: {', '.join(choice.packages) or 'none'}")
    for name, title in (("own", "long, changed"), ("importing", "long, importing")):
        files = [file for file in getattr(choice, name) if "mark.long" in (ROOT / file).read_text("utf-8")]
        if not files:
            checks.note(f"{title}: no file of tests has one")
            continue
        each, most = WITHIN[name]
        within = min(most, each * max(1, len(choice.packages))) if found.commit else most
        bounds = ("-p", "bounded", "--within", str(within), "--before", str(began + LAST))
        command = (python, "-m", "pytest", "-n", "2", "-m", "long", *bounds, *by_hash(files, changes.tree()))
        checks.tests(title, *command, least=0, PYTHONPATH=ROOT / ".ci")  # all may be left out


def other_versions(checks: Checks, environments: Environments) -> None:
    """One path of each package and `coadjoint reproduce`, with other Pythons and with the oldest dependencies."""
    chosen = selection()
    for name, programs in environments.others():
        if programs is None:
            continue
        cache = checks.folder / f"cache-{name}"
        out = checks.folder / f"reproduction-{name}"
        checks.run(f"{name}: reproduce", programs / "coadjoint", "reproduce", "--out", out, COADJOINT_CACHE=cache)
        command = (programs / "python", *UNTIMED, *chosen)
        checks.tests(f"{name}: selection", *command, least=len(chosen), COADJOINT_CACHE=cache)


def all_parts(checks: Checks) -> None:
    """Every part, in order; those that need an environment which could not be made are missing, and the run fails."""
    began = time.time()
    environments = Environments(checks)
    if not environments.build() or (programs := environments.make("tests", "test", "--compile")) is None:
        return
    python = programs / "python"
    checks.run("version", programs / "coadjoint", "--version")
    checks.run("lint", programs / "ruff", "check", ".")
    checks.run("format", programs / "ruff", "format", "--check", ".")
    checks.run("types", programs / "pyright", "--pythonpath", python)
    since = changes.base().commit or "HEAD"
    checks.run("interface", python, ".ci/interface.py", "--check", since)
    if (more := environments.make("more", "test,docs", *COMPANIONS)) is not None:
        words = f"ulimit -t {SITE}; exec '{more}/python' -m sphinx -q -W --keep-going -c docs . '{checks.folder}/site'"
        checks.run("site", "bash", "-c", words)
        checks.tests("extras", more / "python", *UNTIMED, *EXTRAS)
        checks.tests("other libraries", more / "python", *UNTIMED, "-m", "", OTHER_LIBRARIES)
    if (alone := environments.make("core", "", above=None)) is not None:
        checks.run("core: reproduce", alone / "coadjoint", "reproduce", "--out", checks.folder / "reproduction-core")
    command = readme_command((ROOT / "README.md").read_text("utf-8"))
    checks.tests("tests", python, *command[1:], "--budget", "--durations=15", least=LEAST)
    other_versions(checks, environments)
    if more is not None:
        long_tests(checks, more / "python", began)


def completed(seconds: float, parts: Callable[[Checks], None], tested: bool = True) -> int:
    """The exit status of parts that run in a temporary folder for at most so many seconds; prints their table.

    tested: whether some test must have passed.
    """
    with temporary() as folder:
        checks = Checks(folder, seconds)
        checks.environment |= {"MPLBACKEND": "Agg", "MPLCONFIGDIR": str(folder / "matplotlib"), "TMPDIR": str(folder)}
        checks.environment |= {"UV_PYTHON_DOWNLOADS": "never", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
        checks.note(f"Python {OWN} at {sys.executable}; a loop of a million additions takes {loop():.3f} s")
        try:
            parts(checks)
        except BaseException as error:
            checks.outcomes.append(Outcome("interrupted", repr(error), 0.0, 0.0, None))
            checks.close(tested)
            raise
        return checks.close(tested)


if __name__ == "__main__":
    sys.exit(completed(DEADLINE, all_parts))
