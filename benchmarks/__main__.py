"""Measure everything, print tables, write JSON and figures: `python -m benchmarks --out results/benchmarks`."""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks import clock

ROOT = Path(__file__).parents[1]
SECTIONS = {
    "one": ("one", 1, "one trajectory on one core"),
    "many_1": ("many", 1, "an ensemble on one core"),
    "many_2": ("many", 2, "an ensemble on two cores"),
    "gradients": ("gradients", 1, "gradients"),
    "stepping": ("stepping", 1, "one control period at a time"),
    "calls": ("calls", 1, "second calls, and the slowest of many"),
    "commands": ("commands", 1, "fresh processes and commands, cold and repeated"),
    "environments": ("environments", 1, "environments of Gymnasium"),
    "sweeps": ("sweeps", 2, "sweeps by one worker and by two"),
    "judging": ("judging", 1, "the accuracy of the card"),
    "optimal": ("optimal", 1, "an optimal motion"),
    "control": ("control", 1, "problems solved again, controllers, and local optima"),
    "predictive": ("predictive", 1, "model predictive control"),
    "preparing": ("preparing", 2, "fresh processes"),
    "instructions": ("instructions", 2, "instructions by callgrind"),
    "precision": ("precision", 1, "work and precision"),
    "orders": ("orders", 1, "higher orders"),
    "logs": ("logs", 1, "logs of robots"),
    "estimation": ("estimation", 1, "filters and identification"),
    "kirchhoff": ("kirchhoff", 1, "bodies in an ideal fluid, beside other simulators"),
}
"""Section → (module, cores, title): each runs in a process of its own, on so many cores."""


def main() -> int:
    """The command; 1 if a section failed."""
    arguments = _arguments()
    if arguments.section:
        return _section(arguments.section, arguments.quick, arguments.out)
    if importlib.util.find_spec("numba") is None:
        raise SystemExit('The hand-written loop, the yardstick, needs numba: pip install ".[benchmarks]".')
    out = Path(arguments.out).resolve()
    _refuse_the_repository(out)
    out.mkdir(parents=True, exist_ok=True)
    began, found, failed = time.perf_counter(), {}, []
    for name in arguments.only or SECTIONS:
        part = _run(name, arguments.quick)
        if part is None:
            failed.append(name)
        else:
            found[name] = part
            _report(name, part, out)
    found["seconds"] = time.perf_counter() - began
    _conclude(found, out)
    if failed:
        print(f"Failed: {', '.join(failed)}.")
    return 1 if failed else 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--out", default="results/benchmarks", help="folder for tables, JSON and figures")
    parser.add_argument("--quick", action="store_true", help="fewer settings and repetitions, under two minutes")
    parser.add_argument("--only", nargs="+", choices=list(SECTIONS), help="these sections only")
    parser.add_argument("--section", choices=list(SECTIONS), help=argparse.SUPPRESS)
    return parser.parse_args()


def _refuse_the_repository(out: Path) -> None:
    """What is measured here differs on every machine: it stays out of the repository, whose results/ is ignored."""
    inside = out.is_relative_to(ROOT) and not out.is_relative_to(ROOT / "results")
    if inside:
        raise SystemExit(f"--out must be outside the repository or under results/, but is {out}.")


def _run(name: str, quick: bool) -> dict[str, Any] | None:
    """A section in its own process, away from the repository: some programs write log files where they run."""
    print(f"\n── {SECTIONS[name][2]} …", flush=True)
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "found.json"
        command = [sys.executable, "-m", "benchmarks", "--section", name, "--out", str(result)]
        path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
        done = subprocess.run(
            [*command, "--quick"] if quick else command,
            cwd=folder, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            print(f"{name} failed:\n{done.stderr.strip()[-2000:]}")
            return None
        found = json.loads(result.read_text(encoding="utf-8"))
    print(f"   {time.perf_counter() - began:.0f} s", flush=True)
    return found


def _section(name: str, quick: bool, out: str) -> int:
    """In the process of a section: measure and leave JSON."""
    clock.single_threaded()
    module, cores, _ = SECTIONS[name]
    clock.pin(cores)
    found = importlib.import_module(f"benchmarks.{module}").measure(quick)
    Path(out).write_text(json.dumps(found), encoding="utf-8")
    return 0


def _report(name: str, part: dict[str, Any], out: Path) -> None:
    from benchmarks import figures
    from benchmarks.tables import tables

    for table in tables(name, part):
        table.print()
    if name == "precision":
        print(figures.work_precision(part, out / "work_precision.png"))
    if name == "one":
        print(figures.speed(part, out / "speed.png"))
    if name == "orders":
        print(figures.courses(part, out / "energy_500s.png"))
        print(figures.top(part, out / "heavy_top.png"))
    if name == "kirchhoff":
        print(figures.ideal_fluid(part, out / "ideal_fluid.png"))


def _conclude(found: dict[str, Any], out: Path) -> None:
    """The goals, and everything as files."""
    from benchmarks.goals import goals
    from benchmarks.tables import tables

    table = goals(found)
    if table.rows:
        table.print()
    parts = [t.markdown() for name in SECTIONS if name in found for t in tables(name, found[name])]
    (out / "tables.md").write_text("\n".join([table.markdown(), *parts]), encoding="utf-8")
    (out / "benchmarks.json").write_text(json.dumps(found, indent=1, ensure_ascii=False), encoding="utf-8")
    print(f"{found['seconds']:.0f} s; everything is in {out}")


if __name__ == "__main__":
    sys.exit(main())
