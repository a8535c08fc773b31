"""Writes constraints.txt: the newest versions of all that the library needs, by version of Python where they differ."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping

from checks import completed
from parts import ROOT, Checks

from environments import OWN, VERSIONS, Environments, pythons

FILE = ROOT / "constraints.txt"
HEAD = """\
# The newest versions with which the tests have run: pip install --constraint constraints.txt . ./vehicles
# Written by .ci/constraints. Newer versions of Python than the last one named take its versions.
"""
LIST = "import importlib.metadata as m; print('\\n'.join(f'{one.name}=={one.version}' for one in m.distributions()))"
TOOLS = {"pip", "setuptools", "wheel", "uv", "coadjoint", "coadjoint-vehicles"}
"""The installers, and the two distributions themselves."""


def merged(found: Mapping[str, list[str]]) -> str:
    """The file, of the lines name==version by version of Python."""
    table: dict[str, dict[str, str]] = {}
    for python, lines in found.items():
        for line in lines:
            name, _, version = line.partition("==")
            name = name.lower().replace("_", "-").replace(".", "-")
            if name not in TOOLS:
                table.setdefault(name, {})[python] = version
    text = HEAD
    for name, versions in sorted(table.items()):
        rest = list(versions.items())
        while rest:
            python, version = rest[0]
            same = all(other == version for _, other in rest)
            marker = (
                "" if same and len(rest) == len(versions) else f'; python_version {">=" if same else "=="} "{python}"'
            )
            text += f"{name}=={version}{marker}\n"
            rest = [] if same else rest[1:]
    return text


def all_parts(checks: Checks) -> None:
    """An environment with every Python, and the file of what they hold."""
    environments, interpreters = Environments(checks), {OWN: sys.executable} | pythons()
    if not environments.build():
        return
    found: dict[str, list[str]] = {}
    for version in VERSIONS:
        if version in interpreters:
            programs = environments.make(
                version, "test,docs,fmu", above="learn,logs,maps", interpreter=interpreters[version]
            )
            if programs is None:
                return
            listed = subprocess.run([programs / "python", "-c", LIST], capture_output=True, text=True, check=True)
            found[version] = listed.stdout.split()
    FILE.write_text(merged(found), "utf-8")
    checks.note(f"{FILE.name} is of Python {', '.join(found)}")


if __name__ == "__main__":
    sys.exit(completed(3600.0, all_parts, tested=False))
