"""Choose audits by name, run them, and show their results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from coadjoint.audit.audit import QUICK_STEPS, STEPS, audit
from coadjoint.audit.findings import Audit
from coadjoint.audit.page import write
from coadjoint.audit.shipped import MAPS, SHIPPED, Shipped
from coadjoint.audit.systems import PROBLEMS, QUICK, AuditSystem
from coadjoint.audit.tables import COLUMNS, rows
from coadjoint.checks import letters, unknown
from coadjoint.cli import terminal
from coadjoint.errors import ArgumentError


def chosen_methods(names: Sequence[str]) -> tuple[Shipped, ...]:
    """The methods of these names, all without names; `Suzuki4` stands for it over every base. Raises ArgumentError."""
    families: dict[str, list[Shipped]] = {}
    for shipped in SHIPPED:
        for name in {shipped.name, shipped.name.partition("(")[0]}:
            families.setdefault(letters(name), []).append(shipped)
    for name in names:
        if letters(name) not in families:
            raise ArgumentError(unknown(f"method `{name}`", "The audit", name, [known.name for known in SHIPPED]))
    wanted = [shipped for name in names for shipped in families[letters(name)]]
    return tuple(shipped for shipped in SHIPPED if not names or shipped in wanted)


def chosen_systems(names: Sequence[str], quick: bool) -> tuple[AuditSystem, ...]:
    """The systems of these names; all without names, four with `quick`. Raises ArgumentError."""
    plain = {letters(name): problem for name, problem in PROBLEMS.items()}
    for name in names:
        if letters(name) not in plain:
            raise ArgumentError(unknown(f"system `{name}`", "The audit", name, list(PROBLEMS)))
    wanted = [plain[letters(name)].name for name in names] or (QUICK if quick else list(PROBLEMS))
    return tuple(problem for name, problem in PROBLEMS.items() if name in wanted)


def execute(methods: Sequence[str], systems: Sequence[str], quick: bool, progress: bool | None) -> Audit:
    """The audit of these methods on these systems; `quick`: over one map, with shorter long runs."""
    maps = {"Cayley": MAPS["Cayley"]} if quick else MAPS
    steps = QUICK_STEPS if quick else STEPS
    return audit(chosen_methods(methods), maps, chosen_systems(systems, quick), steps=steps, progress=progress)


def show(found: Audit, out: Path | None, command: str) -> list[Path]:
    """Print the table on the terminal and failed claims on stderr; write the files if a folder is given."""
    terminal.table(COLUMNS, rows(found))
    for failure in found.failures:
        terminal.complain(failure)
    claims = [finding.shown for cell in found.cells for finding in cell.findings]
    terminal.line(f"{sum(claims)} of {len(claims)} claims shown, in {found.seconds:.0f} s.")
    written = [] if out is None else write(found, out, command)
    if written:
        terminal.line("Written: " + ", ".join(map(str, written)) + ".")
    return written
