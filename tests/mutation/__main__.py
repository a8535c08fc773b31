"""How many errors of one line the tests of the README catch.

    python tests/mutation --seed 7 --count 120

draws errors over the folders of a package (`mutants.py`), and runs for each those tests of the README's command
that execute its line, cheap ones first, until one fails. The first run follows all tests (`executed.py`) and keeps in
`build/mutation` which lines each executes; later ones follow only what has changed. An error that no test notices,
because the program means the same, belongs in `equivalent.toml` with the reason. Python 3.12 and
newer follow tests faster than 3.11.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import judged
from executed import Mapping, Places, append
from known import Known
from mutants import Mutant, changed, draw

BATCHES = (3.0, 10.0, 30.0)
"""Seconds of processor time of the first groups of tests of a mutant, and of all others."""

EQUIVALENT = Path(__file__).with_name("equivalent.toml")


@dataclass(frozen=True)
class Verdict:
    word: str
    """`killed`, `survived`, `not executed` or `equivalent`."""
    by: str = ""
    """The test that failed and why; of those that survive, how many tests ran."""


def arguments(given: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python tests/mutation", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seed", type=int, default=7, help="of the sample (7)")
    parser.add_argument("--count", type=int, default=120, help="number of errors (120)")
    parser.add_argument("--folders", nargs="*", default=(), help="folders of the package, `.` for files next to them")
    parser.add_argument("--seconds", type=float, default=120.0, help="processor time of tests for an error, s (120)")
    parser.add_argument("--least", type=float, default=0.0, help="share that must be caught, else the status is 1 (0)")
    parser.add_argument("--processes", type=int, default=1, help="that follow tests, and that judge, at a time (1)")
    parser.add_argument("--survivors", action="store_true", help="judge again only what the last run did not kill")
    parser.add_argument("--list", action="store_true", help="print the sample, and judge nothing")
    parser.add_argument("--root", type=Path, default=judged.ROOT, help="of the repository, with src and tests")
    parser.add_argument("--package", default="coadjoint", help="coadjoint or coadjoint_vehicles (coadjoint)")
    return parser.parse_args(given)


def equivalent(file: Path = EQUIVALENT) -> dict[tuple[str, str, str], str]:
    """The reviewed errors that change nothing, with the reason of each."""
    entries = tomllib.loads(file.read_text(encoding="utf-8"))["equivalent"] if file.exists() else []
    return {(entry["file"], entry["before"], entry["after"]): entry["reason"] for entry in entries}


class Judge:
    """Judges errors by the tests of `root`, and keeps what it finds in `build/mutation`."""

    def __init__(self, chosen: argparse.Namespace, folder: Path, number: int = 0):
        self.root, self.most, self.processes = chosen.root.resolve(), chosen.seconds, chosen.processes
        self.build = self.root / "build" / "mutation" / chosen.package
        self.build.mkdir(parents=True, exist_ok=True)
        names = "tests.jsonl", f"log-{number}", f"note-{number}.json"
        self.record, self.log, self.note = (self.build / name for name in names)
        self.copy = judged.Copy(folder / str(number), self.root, chosen.package)
        self.places = Places(self.copy.package)

    def follow(self) -> None:
        """Follow the tests of files that have changed since they were followed last."""
        missing = Known(self.record, self.root).missing
        if not missing:
            return
        print(f"Following the tests of {len(missing)} files once.", flush=True)
        tests, package = self.root / "tests", self.copy.package
        shares = [missing[k :: self.processes] for k in range(min(self.processes, len(missing)))]
        logs = [self.build / f"log-{k}" for k in range(len(shares))]
        started = [
            judged.start(self.copy, share, lambda: Mapping(package, tests, self.record), 10**5, log)
            for share, log in zip(shares, logs, strict=True)
        ]
        for status, log in zip(map(judged.ended, started), logs, strict=True):
            if status not in (0, 1, 5):
                raise SystemExit(f"The tests could not be followed; pytest ended with status {status}, see {log}.")
        known = Known(self.record, self.root)
        for name in [*known.missing, *sorted(known.failed)]:
            print(f"{name} failed without an error, and judges none.")

    def judge(self, mutant: Mutant, known: Known) -> Verdict:
        tests = known.executing(mutant, self.places)
        if not tests:
            return Verdict("not executed")
        path = self.copy.package / mutant.file
        ran = 0
        with judged.changed(path, changed(path.read_text(encoding="utf-8"), mutant.edit)):
            for group, seconds in known.batches(tests, BATCHES, self.most):
                by = self._failure(group, seconds)
                if by:
                    return Verdict("killed", by)
                ran += len(group)
        return Verdict("survived", f"{ran} of {len(tests)} tests")

    def _failure(self, tests: Sequence[str], seconds: float) -> str:
        """The first test that fails and why, empty where all pass."""
        self.note.unlink(missing_ok=True)
        files = list(dict.fromkeys(test.split("::")[0] for test in tests))
        limit = int(30 + 10 * seconds)
        status = judged.run(self.copy, ["-x", *files], lambda: judged.Chosen(tests, self.note), limit, self.log)
        if status == 0 or status == 5:
            return ""
        if self.note.exists():
            return " — ".join(json.loads(self.note.read_text()))
        return f"signal {-status}" if status < 0 else f"status {status} of pytest"

    def doubtful(self, killers: Sequence[str]) -> list[str]:
        """Of the tests that killed, those that fail without an error too."""
        tests = [name for name in dict.fromkeys(killers) if "::" in name]
        return [name for name in tests if self._failure([name], 60)] if tests and self._failure(tests, 600) else []


def main(given: Sequence[str]) -> int:
    chosen = arguments(given)
    package = next(
        path for path in (folder / chosen.package for folder in judged.sources(chosen.root)) if path.is_dir()
    )
    sample = draw(package, chosen.seed, chosen.count, chosen.folders)
    if chosen.list:
        for mutant in sample:
            print(row(mutant))
        return 0
    if chosen.root == judged.ROOT:
        judged.load()
    with tempfile.TemporaryDirectory(prefix="coadjoint-mutation-") as folder:
        judges = [Judge(chosen, Path(folder), number) for number in range(chosen.processes)]
        judges[0].follow()
        found = judge_all(judges, sample, judges[0].build / f"seed-{chosen.seed}.jsonl", chosen.survivors)
        killers = [verdict.by.split(" — ")[0] for verdict in found.values() if verdict.word == "killed"]
        wrong = judges[0].doubtful(killers)
    print(summary(found, wrong))
    return int(caught(found) < chosen.least)


def judge_all(judges: Sequence[Judge], sample: Sequence[Mutant], out: Path, again: bool) -> dict[Mutant, Verdict]:
    """The verdict on each error, also as lines of JSON in `out`. again: those that were killed before stay so.

    Each judge has a process of its own.
    """
    known = Known(judges[0].record, judges[0].root, [mutant.file for mutant in sample])
    same, before = equivalent(), _verdicts(out) if again else {}
    if not again:
        out.write_text("")

    def share(number: int) -> None:
        for place, mutant in list(enumerate(sample, 1))[number :: len(judges)]:
            last = before.get(mutant.key)
            if mutant.key in same:
                verdict = Verdict("equivalent", same[mutant.key])
            elif last is not None and last.word == "killed":
                verdict = last
            else:
                verdict = judges[number].judge(mutant, known)
            append(out, [*mutant.key, verdict.word, verdict.by])
            print(f"{place:4d} {row(mutant)}\n     {verdict.word}: {verdict.by}", flush=True)

    if len(judges) == 1:
        share(0)
    elif sum(map(judged.ended, [judged.forked(share, k) for k in range(len(judges))])):
        raise SystemExit("A process that judges errors failed.")
    verdicts = _verdicts(out)
    return {mutant: verdicts[mutant.key] for mutant in sample}


def _verdicts(out: Path) -> dict[tuple[str, str, str], Verdict]:
    if not out.exists():
        return {}
    entries = (json.loads(line) for line in out.read_text().splitlines())
    return {(file, before, after): Verdict(word, by) for file, before, after, word, by in entries}


def row(mutant: Mutant) -> str:
    return f"{mutant.operator:10s} {mutant.file}:{mutant.line}\n     - {mutant.before}\n     + {mutant.after}"


def caught(found: dict[Mutant, Verdict]) -> float:
    """The share of the errors that are not equivalent which some test caught."""
    words = [verdict.word for verdict in found.values() if verdict.word != "equivalent"]
    return words.count("killed") / max(len(words), 1)


def summary(found: dict[Mutant, Verdict], doubtful: Sequence[str]) -> str:
    count = Counter(verdict.word for verdict in found.values())
    others = len(found) - count["equivalent"]
    lines = [f"{word:13s}{count[word]:5d}" for word in ("killed", "survived", "not executed", "equivalent")]
    lines.append(f"{count['killed']} of {others} errors that are not equivalent are caught: {caught(found):.0%}.")
    lines += [f"{name} fails without an error too." for name in doubtful]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
