"""A report of a folder of results: one self-contained page, for readers without the library."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

from coadjoint.report.numbers import Sourced, shown
from coadjoint.simulation.certificate_forms import FORMS, Certificate, glossary, linked

_STYLE = """
:root { --ground: #ffffff; --ink: #14222e; --faint: #52636f; --line: #c5d1da; --shade: #f2f6f9; }
@media (prefers-color-scheme: dark) { :root { --ground: #0d1822; --ink: #e6edf3; --faint: #a3b3c0; --line: #33485a;
  --shade: #14222e; color-scheme: dark; } }
body { margin: 0 auto; max-width: 60rem; padding: 1rem; background: var(--ground); color: var(--ink);
  font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.6rem; margin: .5rem 0; } h2 { font-size: 1.25rem; margin: 2rem 0 .5rem; } h3 { font-size: 1rem; }
pre { background: var(--shade); padding: .75rem; overflow-x: auto; font-size: .85rem; white-space: pre-wrap; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-size: .85rem; }
th, td { text-align: left; vertical-align: top; padding: .2rem .75rem .2rem 0; border-bottom: 1px solid var(--line);
  overflow-wrap: anywhere; }
td:first-child { min-width: 9rem; } td.note { color: var(--faint); }
figure { margin: 1rem 0; background: #ffffff; color: #14222e; } figure svg { width: 100%; height: auto; }
figcaption { padding: .25rem .5rem; } .warning { border-left: 4px solid #b35900; padding-left: .75rem; }
@media print { body { max-width: none; } h2 { break-after: avoid; } figure { break-inside: avoid; } }
"""


@dataclass(frozen=True)
class Contents:
    """The contents of a report.

    certificates: those of the runs by their names. summary: the numbers of summary.json. figures: (title, caption, SVG
    text). numbers: their sources. settings: the text of the run file. files: (name, bytes, SHA-256). state: whether
    they are unchanged. player: HTML of the scene, if any.
    """

    title: str
    command: str
    certificates: Mapping[str, Certificate]
    summary: Mapping[str, Any]
    figures: Sequence[tuple[str, str, str]] = ()
    numbers: Mapping[str, Sequence[Sourced]] = field(default_factory=dict)
    settings: str = ""
    files: Sequence[tuple[str, int, str]] = ()
    state: str = ""
    player: str = ""


def page(held: Contents) -> str:
    """The report as HTML, without any network access."""
    sections = [
        ("Certificate", "".join(_certificate(held))),
        ("In space", held.player),
        ("Figures", "".join(_figure(*figure) for figure in held.figures)),
        ("Results", _table(("number", "value"), results(held.summary), _computed(held.summary))),
        ("Where the numbers are from", "".join(_sources(held))),
        ("What the lines of the certificate mean", glossary(one.long() for one in held.certificates.values())),
        ("How to run it again", _again(held)),
    ]
    body = "\n".join(f"<section><h2>{title}</h2>\n{text}</section>" for title, text in sections if text)
    policy = (
        "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; frame-src 'self'"
    )
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>{escape(held.title)}</title><style>{_STYLE}</style></head>
<body><main><h1>{escape(held.title)}</h1>
{body}
</main></body></html>
"""


def results(summary: Mapping[str, object], prefix: str = "") -> list[tuple[str, str]]:
    """The numbers of a summary one by one, under joined names; texts that appear elsewhere are left out."""
    found: list[tuple[str, str]] = []
    for key, value in summary.items():
        if isinstance(value, Mapping):
            found += results(value, f"{prefix}{key}.") if key != "versions" else []
        elif key not in (*FORMS, "warnings", "notes", "figures", "failure") and value not in (None, ""):
            found.append((prefix + key, shown(value)))
    return found


def _certificate(held: Contents) -> Iterator[str]:
    for name, certificate in held.certificates.items():
        yield f"<h3>{escape(name)}</h3>" if len(held.certificates) > 1 else ""
        yield f"<pre>{linked(certificate.long())}</pre>"
    for sentence in [*held.summary.get("warnings", []), held.summary.get("failure")]:
        if sentence:
            yield f'<p class="warning">{escape(str(sentence))}</p>'
    for sentence in held.summary.get("notes", []):
        yield f"<p>{escape(str(sentence))}</p>"


def _figure(title: str, words: str, svg: str) -> str:
    points = float(svg.partition('width="')[2].partition("pt")[0] or 500.0)
    attributes = f'role="img" aria-label="{escape(f"{title}: {words}")}" style="max-width:{1.9 * points:.0f}px"'
    named = svg[svg.index("<svg") :].replace("<svg", f"<svg {attributes}", 1)
    return f"<figure>{named}<figcaption><b>{escape(title)}</b>: {escape(words)}</figcaption></figure>"


def _computed(summary: Mapping[str, Any]) -> str:
    by = ", ".join(f"{name} {number}" for name, number in summary.get("versions", {}).items())
    return "All of them were computed by this run" + (f", with {by}." if by else ".")


def _sources(held: Contents) -> Iterator[str]:
    for title, rows in held.numbers.items():
        lines = [(row.name, row.value, row.unit, row.source, row.note) for row in rows]
        heads = ("number", "value", "unit", "source", "note")
        used = [i for i in range(5) if i < 2 or any(line[i] for line in lines)]
        yield f"<h3>Numbers {escape(title)}</h3>"
        yield _table([heads[i] for i in used], [[line[i] for i in used] for line in lines])


def _again(held: Contents) -> str:
    found = [f"<p>{escape(held.state)}</p>"] if held.state else []
    found.append(f"<pre>{escape(held.command)}</pre>")
    if held.settings:
        found.append(f"<h3>run.toml</h3><pre>{escape(held.settings)}</pre>")
    if held.files:
        rows = [(name, f"{size:,}", check) for name, size, check in held.files]
        found.append("<h3>Files</h3>" + _table(("file", "bytes", "SHA-256"), rows))
    return "".join(found)


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "") -> str:
    if not rows:
        return ""
    top = "".join(f'<th scope="col">{escape(head)}</th>' for head in heads)
    lines = "".join("<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>\n" for row in rows)
    intro = f"<p>{escape(caption)}</p>" if caption else ""
    return f'{intro}<div class="wide"><table><thead><tr>{top}</tr></thead><tbody>\n{lines}</tbody></table></div>'
