"""The environments of the checks: the Pythons that there are, the wheel, and what is installed next to it."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from parts import ROOT, Checks

VERSIONS = ("3.11", "3.12", "3.13", "3.14")
COMPANIONS = ("numba", "optimistix", "diffrax", "blackjax")
"""What benchmarks and the page on other libraries use, next to the extras `test` and `docs`."""
FOR_OLDEST = ("pytest", "pytest-xdist", "pytest-timeout", "hypothesis", "rosbags", "mcap-ros2-support")
"""What tests need with the oldest dependencies; others of the extra `test` demand newer ones."""
OWN = "{}.{}".format(*sys.version_info[:2])
INSTALL = (".venv/bin/pip", "install", ".[test]", "./vehicles")
"""How README.md installs what its tests need; here the wheels are installed instead of the folders."""
ABOVE = ("vehicles",)
"""The folders of the distributions that are built with the library."""


def readme_command(readme: str) -> list[str]:
    """The words of the command in README.md that runs the tests; raises ValueError where it installs something else."""
    lines = [line for line in readme.splitlines() if "-m pytest" in line and " && " in line]
    if len(lines) != 1:
        raise ValueError(f"README.md must have one command that installs and runs the tests, but has {len(lines)}.")
    *before, tests = (shlex.split(step) for step in lines[0].split(" && "))
    if before != [["python3", "-m", "venv", ".venv"], [*INSTALL]] or tests[0] != ".venv/bin/python":
        raise ValueError(f"README.md must install {' '.join(INSTALL[2:])} and run the tests there, but has: {lines[0]}")
    return tests


def pythons() -> dict[str, str]:
    """One interpreter of each version but that of this process, on PATH or in pyenv."""
    found = {}
    for version in VERSIONS:
        for candidate in _candidates(version):
            if version != OWN and _version(candidate) == version:
                found[version] = candidate
                break
    return found


def _candidates(version: str) -> Iterator[str]:
    if (on_path := shutil.which(f"python{version}")) is not None:
        yield on_path
    home = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv")
    yield from map(str, sorted(home.glob(f"versions/{version}*/bin/python")))


def _version(interpreter: str) -> str:
    """The version of an interpreter that can make environments, else an empty text."""
    program = "import ensurepip, sys, venv; print('%d.%d' % sys.version_info[:2])"
    try:
        done = subprocess.run([interpreter, "-c", program], capture_output=True, text=True, check=False, timeout=60)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


class Environments:
    """Makes environments with the library from its wheel, as parts of the checks."""

    def __init__(self, checks: Checks) -> None:
        self.checks, self.tools, self.dist = checks, checks.folder / "tools", checks.folder / "dist"

    def build(self) -> bool:
        """The tools, and the wheels from the source archives."""
        install = (sys.executable, ".ci/install.py")
        return self.checks.run("tools", *install, "tools", self.tools) and all(
            self.checks.run(part, *install, "wheel", self.tools, self.dist, folder)
            for part, folder in (("archive and wheel", "."), *((f"{one}: archive and wheel", one) for one in ABOVE))
        )

    def make(
        self, name: str, extras: str, *more: str, above: str | None = "", interpreter: str = sys.executable
    ) -> Path | None:
        """The folder of programs of a new environment with the library and its extras; None where that failed.

        above: the extras of the packages above it; None leaves these packages out.
        """
        (wheel,) = self.dist.glob("coadjoint-*.whl")
        others = (
            []
            if above is None
            else [f"{one}[{above}]" if above else str(one) for one in self.dist.glob("coadjoint_*.whl")]
        )
        home = self.checks.folder / name.replace(" ", "-")
        command = (sys.executable, ".ci/install.py", "environment", self.tools, home, interpreter)
        made = self.checks.run(
            f"{name}: install", *command, f"{wheel}[{extras}]" if extras else str(wheel), *others, *more
        )
        return home / "bin" if made else None

    def others(self) -> Iterator[tuple[str, Path | None]]:
        """The environments of the other versions of Python, and the one with the oldest dependencies."""
        found = pythons()
        for version in VERSIONS:
            if version in found:
                yield version, self.make(version, "test", interpreter=found[version])
            elif version != OWN:
                self.checks.note(f"no Python {version} was found: it is not tested")
        interpreters = {OWN: sys.executable} | found
        oldest = next((interpreters[version] for version in ("3.11", "3.12") if version in interpreters), None)
        if oldest is None:  # the oldest NumPy has wheels for no newer Python
            self.checks.note("no Python 3.11 or 3.12 was found: the oldest dependencies are not tested")
            return
        pins = self.checks.folder / "oldest.txt"
        done = subprocess.run([sys.executable, ".ci/oldest.py"], cwd=ROOT, capture_output=True, text=True, check=True)
        pins.write_text(done.stdout, "utf-8")
        more = (*FOR_OLDEST, "--constraint", str(pins))
        yield "oldest", self.make("oldest", "control,cluster", *more, above="learn,logs", interpreter=oldest)
