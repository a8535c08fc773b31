"""A finding of the audit: a claim, the measurement, and whether the measurement confirms the claim."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

from coadjoint.audit.long_run import LongRun
from coadjoint.audit.order import Convergence

Claim = Literal["order", "symmetric", "symplectic", "momentum", "energy", "constraints"]


@dataclass(frozen=True)
class Finding:
    """A claim with its measurement: shown if `measured` is within `allowed` (of the claimed order, or of zero).

    `failure`: why nothing could be measured; a claim that cannot be measured is not shown.
    """

    claim: Claim
    claimed: int | str
    measured: float
    allowed: float
    failure: str = ""

    @property
    def shown(self) -> bool:
        away = self.measured - self.claimed if isinstance(self.claimed, int) else self.measured
        return not self.failure and abs(away) <= self.allowed


@dataclass(frozen=True)
class Cell:
    """A method over a map on a system: the order it claims, its findings, and the curves that they come from.

    `refusal`: the sentence by which this map or this system is not taken. Nothing is claimed there.
    """

    method: str
    map: str
    system: str
    order: int
    findings: tuple[Finding, ...]
    refusal: str = ""
    convergence: Convergence | None = field(default=None, compare=False)
    long_run: LongRun | None = field(default=None, compare=False)

    @property
    def shown(self) -> bool:
        return all(finding.shown for finding in self.findings)


@dataclass(frozen=True)
class Audit:
    """All cells, with the seconds that they took."""

    cells: tuple[Cell, ...]
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether every claim was shown, and every method and every map had one to show."""
        return bool(self.cells) and not self.failures

    @property
    def refusals(self) -> list[str]:
        """What methods do not take: a line for each reason, with the methods that give it."""
        return reasons((cell.method, cell.refusal) for cell in self.cells if cell.refusal)

    @property
    def failures(self) -> list[str]:
        """A sentence for every claim that was not shown, and for every method and map that was refused everywhere."""
        found = [_sentence(cell, found) for cell in self.cells for found in cell.findings if not found.shown]
        for name in ("method", "map"):
            taken = {getattr(cell, name) for cell in self.cells if not cell.refusal}
            why = {getattr(cell, name): cell.refusal for cell in self.cells if getattr(cell, name) not in taken}
            found += [f"{what} has shown nothing, as it was refused everywhere: {said}" for what, said in why.items()]
        return found


def reasons(refusals: Iterable[tuple[str, str]]) -> list[str]:
    """Methods by what they say, without their names and what they got: "Galerkin, MuntheKaas: needs a flat space"."""
    found: dict[str, dict[str, None]] = {}
    for method, sentence in refusals:
        found.setdefault(_GOT.sub("", _SUBJECT.sub("", sentence)), {})[method] = None
    return [f"{', '.join(methods)}: {reason}" for reason, methods in found.items()]


_SUBJECT = re.compile(r"^(?:co\.)?[A-Z]\w{2,}(?:\(.*?\))? (?=(?:takes|needs|has|is|holds) )")
_GOT = re.compile(r",? but got .*?(?=: |\.?$)")


def _sentence(cell: Cell, found: Finding) -> str:
    where = f"{cell.method} over {cell.map} on {cell.system}"
    if found.failure:
        return f"{where}: {found.claim} could not be measured: {found.failure}."
    if found.claim == "order":
        return f"{where}: order {found.claimed} is claimed, {found.measured:.2f} was measured."
    return f"{where}: {found.claim} is off by {found.measured:.1e}, more than {found.allowed:.1e}."
