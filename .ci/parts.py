"""Parts of a check: processes whose processor time, tests and skips are counted, and the table at the end."""

from __future__ import annotations

import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from xml.etree import ElementTree

from bounded import LEFT_OUT

ROOT = Path(__file__).resolve().parents[1]
SKIPS = ROOT / ".ci/skips.toml"


@dataclass
class Counts:
    """How many tests of a part passed, failed, were skipped, and were left out when its time was up."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0
    left_out: int = 0
    refused: list[str] = field(default_factory=list)
    """Skips that the list does not allow."""


@dataclass
class Outcome:
    """A part that ran: why it failed (empty where it passed), seconds of processor and wall time, tests."""

    part: str
    failure: str
    processor: float
    wall: float
    counts: Counts | None


def counted(report: Path, part: str, allowed: Sequence[Mapping]) -> Counts:
    """The tests of a JUnit report; `allowed` holds the entries of `skips.toml`."""
    counts = Counts()
    for case in ElementTree.parse(report).iter("testcase"):
        name = "::".join(filter(None, (case.get("classname"), case.get("name"))))
        skipped = case.find("skipped")
        if case.find("failure") is not None or case.find("error") is not None:
            counts.failed += 1
        elif skipped is None:
            counts.passed += 1
        elif LEFT_OUT in (message := f"{skipped.get('message')} {skipped.text}"):
            counts.left_out += 1
        else:
            counts.skipped += 1
            file = name.partition("::")[0].replace(".", "/")
            if not any(_allows(one, file, message, part) for one in allowed):
                counts.refused.append(f"{name}: {message.strip()}")
    return counts


def _allows(entry: Mapping, file: str, message: str, part: str) -> bool:
    parts = entry.get("parts", ["*"])
    return fnmatch(file, entry["file"]) and entry["message"] in message and any(fnmatch(part, one) for one in parts)


class Checks:
    """Runs parts one after another, in a folder of its own and up to a deadline."""

    def __init__(self, folder: Path, seconds: float, skips: Path = SKIPS) -> None:
        self.folder, self.deadline = folder, time.monotonic() + seconds
        self.allowed: list[Mapping] = tomllib.loads(skips.read_text("utf-8"))["skip"]
        self.outcomes: list[Outcome] = []
        self.notes: list[str] = []
        self.environment = dict(os.environ)

    def say(self, text: str) -> None:
        """Print a line of the run itself."""
        print(f"── {text}", flush=True)

    def note(self, text: str) -> None:
        """Print a line, and again below the table."""
        self.say(text)
        self.notes.append(text)

    def run(self, part: str, *command: str | Path, **environment: str | Path) -> bool:
        """Run a process, and return whether it succeeded; **environment holds further variables."""
        return self._run(part, command, environment, None)

    def tests(self, part: str, *command: str | Path, least: int = 1, **environment: str | Path) -> bool:
        """Run pytest, and return whether no test failed, `least` passed, and none was skipped that must not be."""
        return self._run(part, command, environment, least)

    def _run(self, part: str, command: Sequence, environment: Mapping, least: int | None) -> bool:
        words = [str(word) for word in command]
        report = self.folder / f"{part.replace(' ', '-')}.xml"
        if least is not None:
            words += ["-p", "no:cacheprovider", f"--junitxml={report}"]
        self.say(f"{part}: {shlex.join(words)}")
        began = time.monotonic()
        status, processor = self._process(words, {name: str(value) for name, value in environment.items()})
        failure, counts = "" if status == 0 else f"exit status {status}", None
        if time.monotonic() > self.deadline:
            failure = "the time of the complete run was up"
        if least is not None:
            failure, counts = self._judged(part, report, failure, least)
        self.outcomes.append(Outcome(part, failure, processor, time.monotonic() - began, counts))
        self.say(f"{part} {'FAILED: ' + failure if failure else 'passed'}")
        return not failure

    def _judged(self, part: str, report: Path, failure: str, least: int) -> tuple[str, Counts]:
        try:
            counts = counted(report, part, self.allowed)
        except (OSError, ElementTree.ParseError) as error:
            return f"{failure or 'no report'} ({error})", Counts()
        for name in counts.refused:
            self.say(f"a skip that {SKIPS.name} does not list: {name}")
        if counts.failed:
            failure = f"{counts.failed} tests failed"
        elif not failure and counts.refused:
            failure = f"{len(counts.refused)} skips that {SKIPS.name} does not list"
        elif not failure and counts.passed < least:
            failure = f"{counts.passed} tests passed, but at least {least} must"
        return failure, counts

    def _process(self, words: list[str], environment: dict[str, str]) -> tuple[int, float]:
        """The exit status of a process and its processor time, s, with that of its children."""
        try:
            process = subprocess.Popen(
                words, cwd=ROOT, env=self.environment | environment, stdin=subprocess.DEVNULL, start_new_session=True
            )
        except OSError as error:
            self.say(str(error))
            return 127, 0.0
        timer = threading.Timer(max(0.0, self.deadline - time.monotonic()), _end, [process])
        timer.start()
        try:
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        finally:
            timer.cancel()
            _end(process)
        return process.returncode, usage.ru_utime + usage.ru_stime

    def close(self, tested: bool = True) -> int:
        """Print the table, and return the exit status: 0 if every part passed and, where `tested`, some test."""
        width = max(len(outcome.part) for outcome in self.outcomes)
        self.say(f"{'part':{width}}  processor s  wall s  tests")
        for one in self.outcomes:
            tests = f"{one.counts.passed + one.counts.failed:5d}" if one.counts else "    –"
            more = f" {one.counts.skipped} skipped" if one.counts and one.counts.skipped else ""
            more += f" {one.counts.left_out} left out" if one.counts and one.counts.left_out else ""
            failure = f" FAILED: {one.failure}" if one.failure else ""
            self.say(f"{one.part:{width}}  {one.processor:11.1f}  {one.wall:6.1f}  {tests}{more}{failure}")
        totals = (sum(getattr(one, name) for one in self.outcomes) for name in ("processor", "wall"))
        self.say("{:{}}  {:11.1f}  {:6.1f}".format("all", width, *totals))
        for text in self.notes:
            self.say(text)
        failed = [one.part for one in self.outcomes if one.failure]
        counts = [one.counts for one in self.outcomes if one.counts]
        passed, broken = sum(one.passed for one in counts), sum(one.failed for one in counts)
        enough = passed or not tested
        self.say(f"FAILED: {', '.join(failed)}" if failed else "all parts passed" if enough else "FAILED: no test ran")
        print(
            f"{passed} passed, {broken} failed, {sum(one.skipped + one.left_out for one in counts)} skipped", flush=True
        )
        return 1 if failed or not enough else 0


def _end(process: subprocess.Popen) -> None:
    """End a process and all of its group; each is the leader of its own."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except (ProcessLookupError, PermissionError):
        return


@contextmanager
def temporary() -> Iterator[Path]:
    """A folder that vanishes however the program ends; tests that give up their rights may enter it."""

    def ended(number: int, _: object) -> None:
        sys.exit(128 + number)

    numbers = (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
    before = [signal.signal(number, ended) for number in numbers]
    folder = Path(tempfile.mkdtemp(prefix="ci-"))
    try:
        folder.chmod(0o755)
        yield folder
    finally:
        for number in numbers:  # a second one must not leave half of it
            signal.signal(number, signal.SIG_IGN)
        shutil.rmtree(folder, ignore_errors=True)
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
