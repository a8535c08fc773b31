"""What `.ci/audit` runs: all cases of the tests of each package, other versions, and the sample of errors.

.ci/audit             every part, in hours
.ci/audit PART…       some; `.ci/audit --list` prints their names
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from checks import LEAST, UNTIMED, completed
from parts import ROOT, Checks

from environments import COMPANIONS, Environments, readme_command

DEADLINE = 7 * 24 * 3600.0
TIMEOUT = 7200
"""Wall time, s, after which a single test is taken to hang."""
SAMPLE = ("--seed", "7", "--count", "120", "--least", "0.9")
"""The sample of errors, and the share of it that tests must catch."""
PACKAGES = ("coadjoint", "coadjoint_vehicles")
OTHERS, REPEATS, ERRORS = "versions", "repeats", "errors"


def suites() -> dict[str, list[str]]:
    """The files of tests of each folder of `tests`: `kernels.emit`, `truth`; `tests` for those at its top."""
    found: dict[str, list[str]] = {}
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        name = ".".join(path.parent.relative_to(ROOT / "tests").parts) or "tests"
        found.setdefault(name, []).append(str(path.relative_to(ROOT)))
    return found


def chosen(arguments: list[str]) -> list[str]:
    """The parts that are asked for, all without arguments; raises ValueError for one that there is not."""
    there = [*suites(), OTHERS, REPEATS, ERRORS]
    unknown = [name for name in arguments if name not in there]
    if unknown:
        raise ValueError(f"Part `{unknown[0]}` must be one of: {', '.join(there)}.")
    return arguments or there


def all_parts(checks: Checks, wanted: list[str], left: list[str]) -> None:
    """The parts; `left` holds those that have not passed yet."""
    environments = Environments(checks)
    programs = environments.make("all", "test,docs", "--compile", *COMPANIONS) if environments.build() else None
    if programs is None:
        return
    python = programs / "python"
    files = suites()
    for name in wanted:
        if name == OTHERS:
            passed = versions(checks, environments)
        elif name == REPEATS:
            passed = repeats(checks, python)
        elif name == ERRORS:
            done = [checks.run(name, python, "tests/mutation", *SAMPLE, "--package", one) for one in PACKAGES]
            passed = all(done)
        else:
            command = (python, *UNTIMED, "-m", "", f"--timeout={TIMEOUT}")
            passed = checks.tests(name, *command, *files[name])
        if passed:
            left.remove(name)


def versions(checks: Checks, environments: Environments) -> bool:
    """The complete products of the tests that run by default, with every other Python and the oldest dependencies."""
    done = []
    for name, programs in environments.others():
        done.append(programs is not None and checks.tests(name, programs / "python", *UNTIMED, least=LEAST))
    return all(done)


def repeats(checks: Checks, python: Path) -> bool:
    """README's tests ten times on a busy machine, forwards and backwards, with ten seeds of hashes."""
    command = readme_command((ROOT / "README.md").read_text("utf-8"))[1:]
    loops = [subprocess.Popen([python, "-c", "while True: pass"]) for _ in range(2)]
    try:
        done = []
        for seed in range(10):
            order = ("-p", "bounded", *(("--backwards",) if seed % 2 else ()))
            variables = {"PYTHONHASHSEED": str(seed), "PYTHONPATH": ROOT / ".ci"}
            done.append(checks.tests(f"repeat {seed}", python, *command, *order, least=LEAST, **variables))
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()
    return all(done)


def main(arguments: list[str]) -> int:
    if arguments == ["--list"]:
        print("\n".join(chosen([])))
        return 0
    wanted = chosen(arguments)

    def parts(checks: Checks) -> None:
        left = list(wanted)
        try:
            all_parts(checks, wanted, left)
        finally:
            if left:
                checks.note(f"to go on: .ci/audit {' '.join(left)}")

    return completed(DEADLINE, parts)


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except ValueError as error:
        sys.exit(str(error))
