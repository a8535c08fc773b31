"""Tests of a changed copy of the library: each set of tests runs in a process of its own, forked once NumPy and JAX
are imported, with the copy first on the path, also for the processes that tests start."""

from __future__ import annotations

import gc
import importlib
import json
import os
import resource
import shutil
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).parents[1]
ROOT = TESTS.parent
LOADED = ("numpy", "scipy.optimize", "scipy.sparse.linalg", "scipy.interpolate", "scipy.stats", "jax", "jax.numpy",
          "jax.scipy", "jax.experimental", "xarray", "h5py", "h5netcdf", "zarr", "matplotlib.pyplot", "rich.console",
          "tyro", "llvmlite.binding", "hypothesis")  # fmt: skip
"""What most tests import, and no test changes."""

MEMORY = 8 * 2**30
"""Bytes that a process of tests may take."""

STARTED = """\
import sys
sys.path.insert(0, {here!r})
import executed, os, pathlib
if executed.FOLLOWED in os.environ:
    executed.follow(pathlib.Path({source!r}))
sys.path.remove({here!r})
"""


def sources(root: Path) -> list[Path]:
    """The folders of a repository that hold packages, one for each distribution."""
    return [folder for folder in (root / "src", root / "vehicles" / "src") if folder.is_dir()]


class Copy:
    """A copy of the sources of `root` in a folder that is thrown away, in which one line at a time is changed."""

    def __init__(self, folder: Path, root: Path, package: str):
        self.root, self.source, self.site = root, folder / "src", folder / "site"
        self.package = self.source / package
        for source in sources(root):
            shutil.copytree(source, self.source, ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True)
        self.site.mkdir()
        text = STARTED.format(here=str(Path(__file__).parent), source=str(self.package))
        (self.site / "sitecustomize.py").write_text(text)

    def path(self) -> list[str]:
        return [str(self.source), str(self.site)]


@contextmanager
def changed(path: Path, text: str) -> Iterator[None]:
    """The file holds `text` meanwhile."""
    kept = path.read_text(encoding="utf-8")
    _write(path, text)
    try:
        yield
    finally:
        _write(path, kept)


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
    for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*"):  # it may be of the same second and size
        compiled.unlink()


def load() -> None:
    """Import what processes of tests share once they are forked; `conftest` sets what must be set before."""
    sys.path.insert(0, str(TESTS))
    for name in ("conftest", *LOADED):
        importlib.import_module(name)
    sys.path.remove(str(TESTS))
    for name, module in list(sys.modules.items()):
        if Path(getattr(module, "__file__", None) or "/").parent == TESTS:
            del sys.modules[name]  # each run of tests imports its own
    gc.freeze()  # the pages of what is loaded stay shared


def run(copy: Copy, arguments: Sequence[str], plugin: Callable[[], object], seconds: int, log: Path) -> int:
    """The exit status of pytest on a copy of the library, negative where a signal ended it.

    plugin: makes a plugin of pytest in the process. seconds: processor time after which the process ends by SIGXCPU.
    """
    return ended(start(copy, arguments, plugin, seconds, log))


def start(copy: Copy, arguments: Sequence[str], plugin: Callable[[], object], seconds: int, log: Path) -> int:
    """The process of `run`."""
    return forked(_tests, copy, arguments, plugin, seconds, log)


def forked(function: Callable[..., int | None], *arguments: Any) -> int:
    """A process that ends with the status that the function returns, 0 for None."""
    sys.stdout.flush()
    process = os.fork()
    if process == 0:
        status = 70
        try:
            status = function(*arguments) or 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(status)
    return process


def ended(process: int) -> int:
    """The exit status of a process that has ended, negative where a signal ended it."""
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def _tests(copy: Copy, arguments: Sequence[str], plugin: Callable[[], object], seconds: int, log: Path) -> int:
    out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(out, 1)
    os.dup2(out, 2)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 10))
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    os.chdir(copy.root)
    sys.dont_write_bytecode = False  # without byte code each process would compile the library anew
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.path[:0] = [*copy.path(), str(copy.root)]  # the last as `python -m pytest` has it
    os.environ["PYTHONPATH"] = os.pathsep.join([*copy.path(), os.environ.get("PYTHONPATH", "")]).strip(os.pathsep)
    with tempfile.TemporaryDirectory(prefix="coadjoint-mutant-") as folder:
        tempfile.tempdir = os.environ["TMPDIR"] = folder
        options = ["-p", "no:cacheprovider", "--basetemp", os.path.join(folder, "tests")]
        return int(pytest.main([*options, *arguments], plugins=[plugin()]))


class Chosen:
    """A plugin that runs the wanted tests alone, in the order given, and notes the first that fails in `note`."""

    def __init__(self, wanted: Iterable[str], note: Path):
        self.place = {name: i for i, name in enumerate(wanted)}
        self.note = note

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items):
        items[:] = sorted((item for item in items if item.nodeid in self.place), key=lambda i: self.place[i.nodeid])

    @pytest.hookimpl(trylast=True)
    def pytest_runtest_logreport(self, report):
        if report.failed:
            self._write(report.nodeid, report.longrepr)

    def pytest_collectreport(self, report):
        if report.failed:
            self._write(f"{report.nodeid} (import)", report.longrepr)

    def _write(self, name: str, why: object) -> None:
        lines = [line[1:].strip() for line in str(why).splitlines() if line.startswith("E ")]
        self.note.write_text(json.dumps([name, (lines or [""])[0]]))
