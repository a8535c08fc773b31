"""Which lines of the library each test executes.

A line is kept by the function that holds it and counted from the beginning of that function, so that an edit elsewhere
in the file moves nothing. Processes that a test starts are followed too: `follow` is what they call at their start.
"""

from __future__ import annotations

import ast
import atexit
import hashlib
import json
import os
import sys
import tempfile
import threading
from collections import defaultdict
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest

FOLLOWED = "COADJOINT_LINES"
"""The variable that names the folder to which processes that a test starts write their lines."""

MODULE = "<module>"
TOOL = 1
"""The number of `sys.monitoring` for what measures coverage."""


def digest(text: str | bytes) -> str:
    return hashlib.sha256(text if isinstance(text, bytes) else text.encode()).hexdigest()[:10]


def append(file: Path, entry: object) -> None:
    """Append a line of JSON by one call, so that lines of several processes stay whole."""
    with file.open("ab", buffering=0) as out:
        out.write(json.dumps(entry).encode() + b"\n")


def functions(text: str) -> list[tuple[int, int, str]]:
    """First line, last line, and name with digest of each function of a module; inner ones after those around them.

    The first line is that of the body: decorators and defaults are executed with what is around the function.
    """
    lines = text.splitlines(keepends=True)
    found = []

    def visit(node: ast.AST, names: tuple[str, ...]) -> None:
        for child in ast.iter_child_nodes(node):
            inner = names
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                inner = (*names, child.name)
                if not isinstance(child, ast.ClassDef):
                    first = min([child.lineno, *(d.lineno for d in child.decorator_list)])
                    written = "".join(lines[first - 1 : child.end_lineno])
                    found.append(
                        (child.body[0].lineno, child.end_lineno or first, f"{'.'.join(inner)}:{digest(written)}")
                    )
            visit(child, inner)

    visit(ast.parse(text), ())
    return found


class Places:
    """Lines of the files below `source` as function and number of the line in it."""

    def __init__(self, source: Path):
        self.source = source
        self.of_file = cache(self._of_file)

    def _of_file(self, name: str) -> list[tuple[int, int, str]]:
        return functions((self.source / name).read_text(encoding="utf-8"))

    def place(self, name: str, line: int) -> tuple[str, int]:
        """The function, as `file:name:digest`, and the line counted from its first; `file:<module>` outside of all."""
        inside = [entry for entry in self.of_file(name) if entry[0] <= line <= entry[1]]
        if not inside:
            return f"{name}:{MODULE}", line
        first, _, function = inside[-1]
        return f"{name}:{function}", line - first


class Recorder:
    """Lines of the files below `source` that were executed since `take` was last called."""

    def __init__(self, source: Path):
        self.source = os.path.join(source, "")
        self.lines: set[tuple[str, int]] = set()

    def start(self) -> None:
        if sys.version_info < (3, 12):  # each line of each call is then an event: some times slower
            sys.settrace(self._call)
            threading.settrace(self._call)
            return
        monitoring, events = sys.monitoring, sys.monitoring.events
        monitoring.use_tool_id(TOOL, "lines")
        monitoring.register_callback(TOOL, events.PY_START, self._enter)
        monitoring.register_callback(TOOL, events.LINE, self._line)
        monitoring.set_events(TOOL, events.PY_START)

    def _enter(self, code, offset):
        if code.co_filename.startswith(self.source):
            sys.monitoring.set_local_events(TOOL, code, sys.monitoring.events.LINE)
        return sys.monitoring.DISABLE

    def _line(self, code, line):
        self.lines.add((code.co_filename, line))
        return sys.monitoring.DISABLE

    def _call(self, frame, event, argument):
        if frame.f_code.co_filename.startswith(self.source):
            self.lines.add((frame.f_code.co_filename, frame.f_lineno))
            return self._call
        return None

    def take(self) -> set[tuple[str, int]]:
        """Lines since the last call, as file below `source` and number; from now on each counts again."""
        found = {(name[len(self.source) :], line) for name, line in self.lines}
        self.lines.clear()
        if sys.version_info >= (3, 12):
            sys.monitoring.restart_events()
        return found


def follow(source: Path) -> None:
    """Record a process that a test started, and write its lines as it ends."""
    recorder = Recorder(source)
    recorder.start()

    def write() -> None:
        name = Path(os.environ[FOLLOWED], f"{os.getpid()}.json")
        if name.parent.is_dir():
            name.write_text(json.dumps(sorted(recorder.take())))

    atexit.register(write)


def spent() -> float:
    """Processor time of this process and of those that it waited for, s."""
    return sum(os.times()[:4])


class Mapping:
    """A plugin that appends a line to `out` for each test that passed, and for each file of tests."""

    def __init__(self, source: Path, tests: Path, out: Path, wanted: Iterable[str] | None = None):
        self.recorder, self.places, self.tests, self.out = Recorder(source), Places(source), tests, out
        self.wanted = None if wanted is None else set(wanted)
        self.children = Path(tempfile.mkdtemp())
        os.environ[FOLLOWED] = str(self.children)
        self.digests: dict[str, str] = {}
        self.recorder.start()

    def _write(self, **entry) -> None:
        append(self.out, entry)

    def _lines(self, collecting: bool = False) -> dict[str, list[int]]:
        lines = self.recorder.take()
        for name in self.children.glob("*.json"):
            lines |= {(file, line) for file, line in json.loads(name.read_text())}
            name.unlink()
        found = defaultdict(list)
        for name, line in sorted(lines):
            function, number = self.places.place(name, line)
            if not (collecting and function.endswith(MODULE)):  # which import comes first says nothing
                found[function].append(number)
        return found

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(self, collector):
        began = spent()
        self._lines()
        report = yield
        if isinstance(collector, pytest.Module):
            file = collector.nodeid
            self.digests[file] = digest(collector.path.read_bytes())
            self._write(
                file=file, digest=self.digests[file], seconds=spent() - began, lines=self._lines(collecting=True)
            )
        return report

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, config, items):
        for file in sorted({item.nodeid.split("::")[0] for item in items}):
            names = [item.nodeid for item in items if item.nodeid.split("::")[0] == file]
            self._write(file=file, digest=self.digests[file], default=names)
        if self.wanted is not None:
            items[:] = [item for item in items if item.nodeid in self.wanted]

    def pytest_runtest_logstart(self):
        self.began, self.passed = spent(), True

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item, call):
        report = yield
        self.passed &= report.passed
        file = item.nodeid.split("::")[0]
        if call.when == "setup":  # what a fixture of the module prepares serves all tests of the file
            self._write(file=file, digest=self.digests[file], lines=self._lines())
        elif call.when == "call":
            self.lines = self._lines()
        elif self.passed:
            self._write(test=item.nodeid, digest=self.digests[file], seconds=spent() - self.began, lines=self.lines)
        else:
            self._write(test=item.nodeid, digest=self.digests[file], failed=True)
        return report
