"""Tries pre-releases of JAX and NumPy, whatever the bounds of pyproject.toml say, and prints what breaks."""

from __future__ import annotations

import subprocess
import sys

from checks import UNTIMED, completed, selection
from parts import Checks

from environments import OWN, VERSIONS, Environments, pythons

TRIED = (("jax", "jaxlib"), ("numpy",))
VERSION = "import importlib.metadata as m; print(m.version({!r}))"


def all_parts(checks: Checks) -> None:
    """For each package an environment of the newest Python and versions, and in it its newest pre-release."""
    environments, interpreters = Environments(checks), {OWN: sys.executable} | pythons()
    if not environments.build():
        return
    newest = [interpreters[version] for version in VERSIONS if version in interpreters][-1]
    for packages in TRIED:
        name = packages[0]
        if (programs := environments.make(f"{name} pre", "test", interpreter=newest)) is None:
            continue
        python = programs / "python"
        before = _version(python, name)
        checks.run(f"{name}: install pip", python, "-m", "ensurepip", "--upgrade")
        pip = (python, "-m", "pip", "install", "--quiet", "--pre", "--upgrade")
        if not checks.run(f"{name}: pre-release", *pip, *packages):
            continue
        now = _version(python, name)
        checks.note(f"{name} {now}, in place of {before}" if now != before else f"{name}: nothing is newer than {now}")
        checks.run(f"{name}: reproduce", programs / "coadjoint", "reproduce", "--out", checks.folder / f"out-{name}")
        checks.tests(f"{name}: selection", python, *UNTIMED, *selection(), "-rfE")


def _version(python: object, package: str) -> str:
    command = [str(python), "-c", VERSION.format(package)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


if __name__ == "__main__":
    sys.exit(completed(3600.0, all_parts))
