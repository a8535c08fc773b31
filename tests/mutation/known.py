"""Which tests execute a line, and what each costs, as the runs that `executed.Mapping` followed have left it."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from executed import MODULE, Places, digest
from mutants import Mutant

ELSEWHERE = 1.0
"""Seconds by which tests of other folders than the changed file's come later: they know less of it."""


@dataclass
class TestFile:
    digest: str
    default: list[str] | None = None
    """Its tests that the README's command runs; None if the run that followed it ended before they were known."""
    collection: float = 0.0
    """Processor time that its import takes, s."""
    lines: dict[str, set[int]] = field(default_factory=lambda: defaultdict(set))
    """What is executed for all its tests: lines by function."""


@dataclass
class Test:
    seconds: float
    lines: dict[str, list[int]]


class Known:
    """The tests of the README's command that passed on the library without an error.

    record: what `executed.Mapping` wrote; later entries of a test replace earlier ones. root: that of the repository.
    files: the changed files; what tests execute elsewhere is forgotten.
    """

    def __init__(self, record: Path, root: Path, files: Sequence[str] = ()):
        self.root, self.of = root, set(files)
        self.files: dict[str, TestFile] = {}
        self.tests: dict[str, Test] = {}
        self.failed: set[str] = set()
        now = {path.relative_to(root).as_posix(): digest(path.read_bytes()) for path in _test_files(root)}
        for entry in _entries(record):
            name = entry.get("file") or entry["test"].split("::")[0]
            if now.get(name) == entry["digest"]:
                self._add(name, entry)
        self.missing = [name for name in now if not self._is_known(name)]
        """Files of which not every test is known."""

    def _add(self, name: str, entry: dict) -> None:
        file = self.files.setdefault(name, TestFile(entry["digest"]))
        if "test" in entry:
            if entry.get("failed"):
                self.failed.add(entry["test"])
            else:
                self.tests[entry["test"]] = Test(entry["seconds"], self._kept(entry["lines"]))
            return
        file.default = entry.get("default", file.default)
        file.collection = entry.get("seconds", file.collection)
        for function, lines in self._kept(entry.get("lines", {})).items():
            file.lines[function].update(lines)

    def _kept(self, lines: dict[str, list[int]]) -> dict[str, list[int]]:
        return {function: found for function, found in lines.items() if function.split(":")[0] in self.of}

    def _is_known(self, name: str) -> bool:
        file = self.files.get(name)
        if file is None or file.default is None:
            return False
        return all(test in self.tests or test in self.failed for test in file.default)

    def executing(self, mutant: Mutant, places: Places) -> list[str]:
        """The tests that execute a line of the mutant's statement, the cheapest of its own folder first.

        Where none does, the function was changed after the tests were followed, or the line is executed by an import:
        then those that execute anything of the function, or of the file, or all. Tests of the files of which one
        executes the line come last: they share what its set-up keeps.
        """
        wanted = {places.place(mutant.file, n) for n in range(mutant.lines[0], mutant.lines[1] + 1)}
        wanted |= {places.place(mutant.file, mutant.line)}
        function = next(iter(wanted))[0]
        if all(name.endswith(MODULE) for name, _ in wanted):
            exact = self._where(lambda name, _: name.startswith(f"{mutant.file}:")) or list(self.tests)
        else:
            exact = self._where(lambda name, lines: any((name, n) in wanted for n in lines))
            if not exact and not any(function in test.lines for test in self.tests.values()):
                older = function.rpartition(":")[0]
                exact = self._where(lambda name, _: name.rpartition(":")[0] == older)
        shared = {test.split("::")[0] for test in exact}
        others = [test for name in shared for test in self.files[name].default or () if test not in exact]
        return self._ordered(exact, mutant) + self._ordered([t for t in others if t in self.tests], mutant)

    def _where(self, holds) -> list[str]:
        """Tests that execute what `holds` by themselves, and all those of files in which it is executed for all."""
        files = {name for name, file in self.files.items() if any(holds(f, lines) for f, lines in file.lines.items())}
        current = (name for file in self.files.values() for name in file.default or ())
        return [
            name
            for name in current
            if name in self.tests
            and (name.split("::")[0] in files or any(holds(f, n) for f, n in self.tests[name].lines.items()))
        ]

    def _ordered(self, tests: Sequence[str], mutant: Mutant) -> list[str]:
        path = PurePosixPath(mutant.file)
        own = f"tests/{path.parent}/" if path.parent.name else f"tests/test_{path.stem}"

        def cost(test: str) -> float:
            file = test.split("::")[0]
            later = 0.0 if file.startswith(own) else ELSEWHERE
            return self.tests[test].seconds + self.files[file].collection + later

        return sorted(tests, key=lambda test: (cost(test), test))

    def batches(self, tests: Sequence[str], sizes: Sequence[float], most: float) -> Iterator[tuple[list[str], float]]:
        """The tests in order, in groups that cost about so many seconds each, and what each costs, up to `most` s."""
        group: list[str] = []
        cost, spent, bounds = 0.0, 0.0, list(sizes)
        for test in tests:
            file = test.split("::")[0]
            cost += self.tests[test].seconds
            cost += 0.0 if any(other.startswith(f"{file}::") for other in group) else self.files[file].collection
            group.append(test)
            if cost >= bounds[0] or spent + cost >= most:
                yield group, cost
                group, spent, cost = [], spent + cost, 0.0
                bounds = bounds[1:] or bounds
                if spent >= most:
                    return
        if group:
            yield group, cost


def _test_files(root: Path) -> Iterator[Path]:
    yield from sorted((root / "tests").rglob("test_*.py"))


def _entries(record: Path) -> Iterator[dict]:
    if record.exists():
        with record.open() as file:
            for line in file:
                try:
                    yield json.loads(line)
                except ValueError:  # a run ended while it wrote
                    continue
