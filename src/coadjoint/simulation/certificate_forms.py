"""The certificate as a reader sees it: five lines, all lines, and HTML in which each line says what it means."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from typing import Any

MEANINGS = {
    "system": "the system, how many members it has, and the group on which it moves",
    "method": "the integrator, its difference map, and the order of its error in dt",
    "steps": "the steps that were done, and what ended the run before its time",
    "event": "when `until` crossed zero and ended the run",
    "events": "how often each function of `events` crossed zero",
    "step size": "the least and the largest h of a method that varies it, and the time that it reached",
    "saved": "the nodes that were saved; every number below covers all steps",
    "finished": "the members whose steps were all solved",
    "failed": "a member whose step failed, and where",
    "accuracy": "the largest local error of the judged steps, relative to what a step moves: is dt small enough?",
    "trajectory": "the distance from a run with dt/2, relative to how far the run goes",
    "conserved": "how far quantities that the mechanics conserves, or whose budget it closes, changed over all steps",
    "energy": "the Legendre energy of the momenta at the nodes, its change relative to the start or, if that is small, "
    "to the largest kinetic energy; where forces act, its budget shows the error",
    "energy, discrete": "the energy −∂Λ/∂h of the discrete Lagrangian",
    "energy budget": "the stored energy against the work of each force; the gap is of the method's order",
    "Kelvin–Noether": "momenta of directions that leave the advected parameters unchanged; round-off without forces",
    "momentum budget": "these momenta less the impulse of forces: round-off",
    "symmetry": "the momenta of motions of space that leave ℓ and the constraints unchanged",
    "balance": "the Kelvin–Noether balance of every step, Theorem 7: round-off",
    "Newton": "the residual of the discrete equations: round-off",
    "Legendre": "the residual of ∂ℓ = (μ, π) for the velocities at the nodes",
    "group defect": "the distance of g from its group: round-off",
    "constraints": "the largest |φ| of the holonomic constraints",
    "constraint rates": "the largest |φ̇| and |A·(ξ, ν) − b| of the constraints",
    "solved": "how XLA solves the equations of a step",
    "iterations": "Newton's iterations; more than five a step mean that dt is large",
    "time": "the time in the kernel, the speed, and the time of set-up",
    "warning": "what the run shows that you should know or change",
}
"""The meaning of each line, by its title; other lines are quantities that the system watches."""

FORMS = ("certificate", "card")
"""The attributes of files that hold the short and the long form; files of earlier versions have the long form alone."""


@dataclass(frozen=True, repr=False)
class Certificate:
    """The certificate of a run: `print(run.certificate)` has five lines, `print(run.certificate.long())` all of them.

    The five lines are the system with its method, the steps, the accuracy, the conserved quantities, and the time;
    warnings follow them. Notebooks show both forms, with the meaning of each line where the pointer rests on it.
    """

    short: str
    complete: str

    @classmethod
    def held(cls, attributes: Any) -> Certificate | None:
        """The certificate in the attributes of a file or in a summary; None without one."""
        short, complete = (attributes.get(name) for name in FORMS)
        return None if complete is None else cls(str(short or complete), str(complete))

    def asdict(self) -> dict[str, str]:
        """Both forms under the names that files have for them."""
        return dict(zip(FORMS, (self.short, self.complete), strict=True))

    def long(self) -> str:
        """A line for each monitored quantity, as text."""
        return self.complete

    def __str__(self) -> str:
        return self.short

    def __repr__(self) -> str:
        return self.short

    def _repr_html_(self) -> str:
        """Both forms, the long one folded."""
        if self.short == self.complete:
            return _table(self.short)
        return f"{_table(self.short)}<details><summary>all lines</summary>{_table(self.complete)}</details>"


def aligned(lines: list[tuple[str, str]]) -> str:
    """Titles and texts, one a line."""
    width = max(len(title) for title, _ in lines)
    return "\n".join(f"{title:<{width}}  {text}" for title, text in lines)


def rows(text: str) -> list[tuple[str, str]]:
    """Titles and texts of a certificate; the title is empty in lines of another form."""
    halves = [line.partition("  ") for line in text.splitlines()]
    return [(title, rest.strip()) if rest.strip() else ("", title) for title, _, rest in halves]


def linked(text: str) -> str:
    """A certificate as HTML in which each title leads to its meaning in `glossary`."""
    found = []
    for line in text.splitlines():
        title, gap, rest = line.partition("  ")
        known = f'<a href="#{_anchor(title)}">{escape(title)}</a>' if title in MEANINGS else escape(title)
        found.append(f"{known}{gap}{escape(rest)}")
    return "\n".join(found)


def glossary(texts: Iterable[str]) -> str:
    """A list of the meanings of all lines in some certificates, as HTML."""
    titles = dict.fromkeys(title for text in texts for title, _ in rows(text) if title in MEANINGS)
    found = (f'<dt id="{_anchor(title)}">{title}</dt><dd>{escape(MEANINGS[title])}</dd>' for title in titles)
    return f"<dl>{''.join(found)}</dl>" if titles else ""


def _anchor(title: str) -> str:
    return "line-" + "-".join(title.replace(",", "").lower().split())


def _table(text: str) -> str:
    found = []
    for title, rest in rows(text):
        meaning = f' title="{escape(MEANINGS[title])}"' if title in MEANINGS else ""
        head = f'<th style="text-align:left;vertical-align:top;white-space:nowrap"{meaning}>{escape(title)}</th>'
        found.append(f'<tr>{head}<td style="text-align:left">{escape(rest)}</td></tr>')
    return f"<table>{''.join(found)}</table>"
