"""What was measured as tables: on the terminal by rich, and as Markdown for the docs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Table:
    """A title, the heads of the columns, and rows of text."""

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]

    def markdown(self) -> str:
        lines = [self.heads, ["---"] + ["--:"] * (len(self.heads) - 1), *self.rows]
        return f"**{self.title}**\n\n" + "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"

    def print(self) -> None:
        from rich.console import Console
        from rich.table import Table as Rich

        table = Rich(title=self.title, title_justify="left")
        for i, head in enumerate(self.heads):
            table.add_column(head, justify="right" if i else "left", overflow="fold")
        for row in self.rows:
            table.add_row(*row)
        console = Console()
        (console if console.is_terminal else Console(width=110)).print(table)


def tables(section: str, found: dict[str, Any]) -> list[Table]:
    """The tables of a section."""
    return _TABLES[section](found)


def _time(seconds: float) -> str:
    for unit, scale in (("ns", 1e-9), ("µs", 1e-6), ("ms", 1e-3)):
        if seconds < 1000 * scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds:.3g} s"


def _one(found: dict[str, Any]) -> list[Table]:
    rows = [
        (
            name,
            f"{row['ratio']:.4g}",
            _time(row["seconds"]),
            f"{row['energy']:.1e}" if "energy" in row else "",
            f"{row['iterations']:.2f}" if "iterations" in row else "",
            f"{row['step']:.3g}" if "step" in row else "",
        )
        for name, row in found["rows"].items()
    ]
    rows += [(f"{name}: not installed", "", "", "", "", "") for name in found["missing"]]
    heads = ("One trajectory, one core", "ratio", "a step", "energy error", "Newton", "mean step, s")
    return [Table("One trajectory: time per step relative to the hand-written left rule", heads, rows)]


def _many(found: dict[str, Any]) -> list[Table]:
    cores, tables = found["cores"], []
    for steps, part in found["lengths"].items():
        rows = [(name, f"{row['ratio']:.3g}", _time(row["seconds"])) for name, row in part["rows"].items()]
        title = f"{found['members']} vehicles, {steps} steps, {cores} core{'s' * (cores > 1)}, {found['lanes']} lanes"
        tables.append(Table(title, ("Ensemble", "ratio", "a trajectory and step"), rows))
    return tables


def _logs(found: dict[str, Any]) -> list[Table]:
    titles = {"mcap": "MCAP, an inertial unit", "ardupilot": "A log of ArduPilot"}
    tables = []
    for key, title in titles.items():
        rows = [(name, _time(row["seconds"]), f"{row['ratio']:.3g}") for name, row in found[key].items()]
        tables.append(Table(f"{title}, {found['messages']} messages", ("read by", "a message", "ratio"), rows))
    return tables


def _sweeps(found: dict[str, Any]) -> list[Table]:
    keys = ("seconds", "task_seconds", "kernel_seconds", "starting_seconds", "writing_seconds")
    rows = [
        (name.replace("_", ", ") + " worker", *(f"{part[key]:.3g} s" for key in keys), f"{part['orchestration']:.2%}")
        for name, part in found.items()
        if isinstance(part, dict) and "busy_seconds" in part
    ]
    heads = ("kept, by", "whole", "a task", "in the kernel", "start of workers", "writing", "orchestration")
    hours = ", ".join(f"{value:.3g} h on {cores} cores" for cores, value in found["hours_of_many"].items())
    title = (
        f"{found['members']:,} one-minute missions of BlueROV2: {_time(found['run_seconds'])} each, two workers "
        f"{found['speed_up']:.2f} × one; 10⁷, projected: {hours}"
    )
    return [Table(title, heads, rows)]


def _gradients(found: dict[str, Any]) -> list[Table]:
    tables = []
    for method, part in found["methods"].items():
        rows = [(name, f"{row['ratio']:.3g}", _time(row["seconds"])) for name, row in part["rows"].items()]
        rows.append(("largest relative difference, native and XLA", f"{part['difference']:.1e}", ""))
        title = f"Gradient of {found['steps']} steps, {method}"
        tables.append(Table(title, ("", "relative to the native run", "time"), rows))
    return tables


def _preparing(found: dict[str, Any]) -> list[Table]:
    rows = [
        (f"{name}: {part}", _time(seconds)) for name, parts in found["rows"].items() for part, seconds in parts.items()
    ]
    rows += [(f"coadjoint reproduce, cache {cache}", _time(t)) for cache, t in found["reproduce"].items()]
    return [Table("Fresh processes, machine code cache empty or filled", ("", "wall time"), rows)]


def _instructions(found: dict[str, Any]) -> list[Table]:
    rows = [(name, f"{row['ratio']:.3g}", f"{row['instructions']:.0f}") for name, row in found["rows"].items()]
    if "reason" in found:
        rows.append((f"not counted: {found['reason']}", "", ""))
    return [Table("Instructions per trajectory and step (AVX2, callgrind)", ("", "ratio", "instructions"), rows)]


def _precision(found: dict[str, Any]) -> list[Table]:
    tables = []
    for title, rows in found["problems"].items():
        cells = [
            (
                r["name"],
                f"{r['setting']:.3g}",
                f"{r['time']:.3g}",
                *(f"{r[q]:.1e}" for q in ("position", "energy", "momentum")),
            )
            for r in rows
        ]
        heads = ("Program", "step or tolerance", "time", "position, m", "energy", "Kelvin–Noether")
        tables.append(Table(f"Work and precision: {title}", heads, cells))
    return tables


def _orders(found: dict[str, Any]) -> list[Table]:
    from benchmarks.orders import TARGET, cheapest

    rows = [
        (
            name,
            f"{r['solves']}",
            f"{r['step']:.3g}",
            f"{r['energy']:.1e}",
            f"{r['momentum']:.1e}",
            f"{r['ratio']:.3g}",
            _time(r["seconds"]),
        )
        for name, r in found["vehicle"].items()
    ]
    heads = ("Method", "solves", "step, s", "energy", "Kelvin–Noether", "time, relative", "time")
    best = sorted(cheapest(found["top"]).items(), key=lambda item: item[1]["seconds"] if item[1] else float("inf"))
    least = best[0][1]["seconds"] if best and best[0][1] else 1.0
    told = [
        (name, f"{r['setting']:.3g}", f"{r['error']:.1e}", _time(r["seconds"]), f"{r['seconds'] / least:.3g}")
        if r
        else (name, "none tried", "", "", "")
        for name, r in best
    ]
    return [
        Table("The paper's vehicle over 500 s", heads, rows),
        Table(
            f"The fast heavy top at t = 2 s to {TARGET:g} m",
            ("Program", "step or tolerance", "error, m", "time", "relative"),
            told,
        ),
    ]


def _kirchhoff(found: dict[str, Any]) -> list[Table]:
    half = f"{found['duration'] / 2:g} s"
    heads = ("Program", "step, s", f"energy to {half}", "after", "at the end", "impulse", "moment")
    tables = []
    for title, rows in found["bodies"].items():
        cells = [
            (r["name"], f"{r['step']:g}", f"lost after {r['failed']:.3g} s", "", "", "", "")
            if "failed" in r
            else (
                r["name"],
                f"{r['step']:g}",
                *(f"{e:.1e}" for e in r["energy"]),
                f"{r['end']:+.1e}",
                f"{r['impulse']:.1e}",
                f"{r['moment']:.1e}",
            )
            for r in rows
        ]
        tables.append(Table(f"{found['duration']:g} s of {title}", heads, cells))
    missing = [(f"{name}: not installed", *[""] * 6) for name in found["missing"]]
    return [*tables, Table("Not measured", heads, missing)] if missing else tables


def _stepping(found: dict[str, Any]) -> list[Table]:
    rows = [(name, f"{row['ratio']:.3g}", _time(row["seconds"])) for name, row in found["one"].items()]
    rows += [(f"{name}: not installed, left out", "", "") for name in found["missing"]]
    rows.append(("a saved stepper from its file to the first step, process and all", "", _time(found["saved"])))
    tables = [Table("A control period of two steps, one vehicle", ("", "ratio", "a period"), rows)]
    for count, part in found["many"].items():
        rows = [
            (name, f"{row['ratio']:.3g}", _time(row["seconds"]), f"{1e-6 / row['seconds']:.3g}")
            for name, row in part.items()
        ]
        heads = ("", "ratio", "a member's period", "million periods a second")
        tables.append(Table(f"The same of {count} vehicles on one core, with moving commands", heads, rows))
    return tables


def _calls(found: dict[str, Any]) -> list[Table]:
    rows = [(name, f"{row['ratio']:.3g}", _time(row["seconds"])) for name, row in found["second"].items()]
    tails = [
        (f"{name}, {clock} time", *map(_time, part))
        for name, clocks in found["tails"].items()
        for clock, part in clocks.items()
    ]
    return [
        Table("A second co.simulate of 100 steps of a small system", ("", "ratio", "a call"), rows),
        Table(
            f"{found['calls']:,} calls, with Python's collector on",
            ("", "median", "99th percentile", "99.9th", "largest"),
            tails,
        ),
    ]


def _commands(found: dict[str, Any]) -> list[Table]:
    pythons = list(next(iter(found.values())))
    rows = [
        (name, *(" / ".join(f"{seconds:.2f}" for seconds in part[python]) for python in pythons))
        for name, part in found.items()
    ]
    return [Table("Processor time of a fresh process, cold / repeated, s", ("", *pythons), rows)]


def _environments(found: dict[str, Any]) -> list[Table]:
    rows = [(name, f"{row['ratio']:.3g}", _time(row["seconds"])) for name, row in found["one"].items()]
    tables = [Table("A period of one vehicle through Gymnasium", ("", "ratio", "a period"), rows)]
    for count, part in found["many"].items():
        rows = [
            (name, f"{row['ratio']:.3g}", _time(row["seconds"]), f"{1e-6 / row['seconds']:.3g}")
            for name, row in part.items()
        ]
        heads = ("", "ratio", "a member's period", "million periods a second")
        tables.append(Table(f"The same of {count} vehicles on one core, with rewards and new episodes", heads, rows))
    return tables


def _judging(found: dict[str, Any]) -> list[Table]:
    rows = [
        (f"{name}, {which}", f"{row['ratio']:.3f}", _time(row["seconds"]))
        for name, part in found.items()
        for which, row in part.items()
    ]
    return [
        Table(
            "10 000 steps and their set-up, code cached, with the line `accuracy` and without", ("", "ratio", ""), rows
        )
    ]


def _optimal(found: dict[str, Any]) -> list[Table]:
    heads = (
        "",
        "ratio",
        "stated and solved",
        "solver alone",
        "iterations",
        "cost",
        "violation",
        "|RRᵀ − e|",
        "momentum",
    )
    tables = []
    for steps, part in found.items():
        rows = [
            (
                name, f"{row['ratio']:.3g}", _time(row["seconds"]), _time(row["solver"]), str(row["iterations"]),
                f"{row['cost']:.9f}", f"{row['violation']:.0e}", f"{row['orthogonal']:.0e}",
                f"{row['momentum']:.0e}" if "momentum" in row else "",
            )
            for name, row in part.items()
        ]  # fmt: skip
        tables.append(Table(f"A rigid body turned with least effort, {steps} steps", heads, rows))
    return tables


def _control(found: dict[str, Any]) -> list[Table]:
    rows = [(name, f"{row['ratio']:.3g}", _time(row["seconds"])) for name, row in found["solves"].items()]
    calls = [(name, f"{row['ratio']:.3g}", _time(row["seconds"])) for name, row in found["controllers"].items()]
    heads = ("", "ratio", "processor time")
    optima = [
        (name, f"{row['first']:.6f}", f"{row['best']:.6f}", f"{row['worst']:.6f}", f"{row['found']} of {row['tried']}")
        for name, row in found["optima"].items()
    ]
    return [
        Table("A turn of least effort, 50 steps on SO(3)", heads, rows),
        Table(f"Predictive control, {found['stages']} steps on SO(3)", heads, calls),
        Table("Local optima", ("guesses=8", "first guess", "best", "worst", "led to an optimum"), optima),
    ]


def _estimation(found: dict[str, Any]) -> list[Table]:
    def ratio(row: dict[str, float]) -> str:
        return f"{row['ratio']:.3g}" if "ratio" in row else ""

    calls = [(name, _time(row["seconds"]), ratio(row)) for name, row in found["calls"].items()]
    logs = [(name, _time(row["seconds"]), ratio(row), f"{row['off']:.1f}") for name, row in found["identified"].items()]
    tables = [
        Table("A call of a filter", ("", "processor time", "ratio"), calls),
        Table("Six parameters of a log, from 30 % off", ("", "processor time", "ratio", "worst error / σ"), logs),
    ]
    for name in ("inertial unit", "model"):
        rows = [
            (
                label,
                f"{row['errors']:.0f}",
                _time(row["seconds"]),
                f"{row['seconds'] * found['steps']:.3g} s",
                f"{row['ratio']:.3g}",
                f"{row['off']:.4f} m",
            )
            for label, row in found[name].items()
        ]
        title = f"A filter by {'an ' if name != 'model' else 'the vehicle’s '}{name}, {found['seconds']} s at 100 Hz"
        tables.append(Table(title, ("", "errors", "a step", "the log", "ratio", "RMS off"), rows))
    return tables


def _predictive(found: dict[str, Any]) -> list[Table]:
    tables = []
    for part in found.values():
        rows = [
            (f"{phase}, {kind} time", _time(part[kind][phase][0]), _time(part[kind][phase][1]))
            for kind in ("processor", "wall")
            for phase in ("preparation", "feedback", "iteration")
        ]
        title = (
            f"BlueROV2 Heavy in a tide, {part['stages']} stages of {part['states']} states and 8 thrusts: within "
            f"{100 * part['distance']:.1f} cm and {part['angle']:.2f}°, {part['solved']:.1%} solved"
        )
        tables.append(Table(title, ("", "median", "99th percentile"), rows))
    return tables


_TABLES = {
    "logs": _logs,
    "estimation": _estimation,
    "sweeps": _sweeps,
    "predictive": _predictive,
    "optimal": _optimal,
    "control": _control,
    "judging": _judging,
    "stepping": _stepping,
    "calls": _calls,
    "commands": _commands,
    "environments": _environments,
    "one": _one,
    "many_1": _many,
    "many_2": _many,
    "gradients": _gradients,
    "preparing": _preparing,
    "instructions": _instructions,
    "precision": _precision,
    "orders": _orders,
    "kirchhoff": _kirchhoff,
}
