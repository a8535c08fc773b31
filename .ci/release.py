"""What `.ci/release` runs: equal archives of two builds, their metadata, and what they do where they are installed."""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

from checks import completed
from parts import ROOT, Checks

from environments import ABOVE, OWN, VERSIONS, Environments, pythons

SOURCES = (".", *ABOVE)
PLUGIN = "tests/plugin"
NOTICES = {
    "coadjoint": ("LICENSE", "NOTICE", "src/coadjoint/plotting/page/three.LICENSE"),
    "coadjoint_vehicles": ("LICENSE", "NOTICE"),
}
"""Files that each wheel holds under dist-info/licenses."""


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def versions() -> dict[str, str]:
    """The version as each place states it, and the date of the release."""
    projects = {one: tomllib.loads((ROOT / one / "pyproject.toml").read_text("utf-8"))["project"] for one in SOURCES}
    found = {f"{one}/pyproject.toml": project["version"] for one, project in projects.items()}
    found["the core that vehicles need"] = projects["vehicles"]["dependencies"][0].removeprefix("coadjoint==")
    init = (ROOT / "src/coadjoint/__init__.py").read_text("utf-8")
    found["coadjoint.__version__"] = re.findall(r'^__version__ = "(.*)"$', init, re.MULTILINE)[0]
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    found["CITATION.cff"] = re.findall(r"^version: (.*)$", citation, re.MULTILINE)[0]
    return found


def dated() -> tuple[str, str]:
    """The title of the first section of CHANGELOG.md, and the title that the version and date of CITATION.cff give."""
    first = re.findall(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)[0]
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    (date,) = re.findall(r"^date-released: (.*)$", citation, re.MULTILINE)
    return first, f"{versions()['CITATION.cff']}, {date}"


def stated(checks: Checks) -> bool:
    """Whether all places state one version, the changes are dated, its files stored, and nothing is left to commit."""
    found, (first, expected) = versions(), dated()
    mistakes = [f"{place} is {version}" for place, version in found.items() if version != found["./pyproject.toml"]]
    mistakes += [] if first == expected else [f"CHANGELOG.md begins with `{first}`, but must with `{expected}`"]
    stored = f"tests/stored/{found['./pyproject.toml']}.tar.gz"
    mistakes += [] if (ROOT / stored).exists() else [f"{stored} is missing: python .ci/stored.py writes it"]
    mistakes += [f"not committed: {line}" for line in _git("status", "--porcelain").splitlines()]
    for sentence in mistakes:
        checks.note(sentence)
    return checks.run("version", "true" if not mistakes else "false")


def built(checks: Checks, environments: Environments, name: str) -> Path | None:
    """The archives and wheels of the commit, built in a folder of this name; None where a build failed."""
    source, dist = checks.folder / f"source-{name}", checks.folder / f"dist-{name}"
    source.mkdir()
    archive = checks.folder / f"{name}.tar"
    if not checks.run(f"{name}: source", "git", "archive", "--output", archive, "HEAD"):
        return None
    shutil.unpack_archive(archive, source, filter="data")
    epoch = {"SOURCE_DATE_EPOCH": _git("log", "-1", "--format=%ct")}
    command = (sys.executable, ".ci/install.py", "wheel", environments.tools, dist)
    parts = [checks.run(f"{name}: {folder}", *command, source / folder, **epoch) for folder in (*SOURCES, PLUGIN)]
    return dist if all(parts) else None


def sums(folder: Path) -> dict[str, str]:
    """The SHA-256 of each archive and wheel."""
    files = sorted([*folder.glob("*.whl"), *folder.glob("*.tar.gz")])
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def lacking(folder: Path) -> list[str]:
    """Notices and markers of types that wheels lack, and files of tests that they hold."""
    found = []
    for package, notices in NOTICES.items():
        (wheel,) = folder.glob(f"{package}-*.whl")
        with zipfile.ZipFile(wheel) as archive:
            names = archive.namelist()
        (about,) = {name.partition("/")[0] for name in names if ".dist-info/" in name}
        wanted = [f"{about}/licenses/{notice}" for notice in notices] + [f"{package}/py.typed"]
        found += [f"{wheel.name} lacks {name}" for name in wanted if name not in names]
        strange = [name for name in names if not name.startswith((f"{package}/", f"{about}/"))]
        found += [f"{wheel.name} holds {name}" for name in strange]
    return found


def all_parts(checks: Checks) -> None:
    """Every part; nothing is written to dist/ unless all of them passed."""
    environments = Environments(checks)
    install = (sys.executable, ".ci/install.py")
    stated(checks)
    if not checks.run("tools", *install, "tools", environments.tools):
        return
    first, second = (built(checks, environments, name) for name in ("first", "second"))
    if first is None or second is None:
        return
    found = sums(first)
    checks.run("equal bytes", "true" if found == sums(second) else "false")
    checks.run("twine: install", environments.tools / "bin/python", "-m", "pip", "install", "--quiet", "twine")
    checks.run("metadata", environments.tools / "bin/python", "-m", "twine", "check", "--strict", *_files(first, found))
    for sentence in (problems := lacking(first)):
        checks.note(sentence)
    checks.run("contents", "true" if not problems else "false")
    environments.dist = first
    interpreters = {OWN: sys.executable} | pythons()
    for version in VERSIONS:
        if version not in interpreters:
            checks.note(f"no Python {version} was found: it is not tried")
            continue
        (plugin,) = first.glob("drifters-*.whl")
        programs = environments.make(version, "", str(plugin), interpreter=interpreters[version])
        if programs is not None:
            cache = checks.folder / f"cache-{version}"
            home = checks.folder / f"home-{version}"
            checks.run(f"{version}: installed", programs / "python", ".ci/installed.py", home, COADJOINT_CACHE=cache)
    if any(outcome.failure for outcome in checks.outcomes):
        return
    _written(checks, first, {name: digest for name, digest in found.items() if name.startswith("coadjoint")})


def _files(folder: Path, found: dict[str, str]) -> list[Path]:
    return [folder / name for name in found if name.startswith("coadjoint")]


def _written(checks: Checks, folder: Path, found: dict[str, str]) -> None:
    """Put the files into dist/ in place of earlier ones, with their checksums in the format of `sha256sum --check`."""
    target = ROOT / "dist"
    target.mkdir(exist_ok=True)
    for earlier in [*target.glob("*.whl"), *target.glob("*.tar.gz")]:
        earlier.unlink()
    for name in found:
        shutil.copyfile(folder / name, target / name)
    lines = [f"{digest}  {name}\n" for name, digest in found.items()]
    (target / "SHA256SUMS").write_text("".join(lines), "utf-8")
    for line in lines:
        checks.note(line.rstrip())


if __name__ == "__main__":
    sys.exit(completed(3600.0, all_parts, tested=False))
