"""Results of the search with the words around what was found, in a site that is read from a disk, too.

Sphinx's own summaries fetch each page, which browsers refuse from a disk. So the text of all sections lies in a script
that the page of the search loads, and docs/_static/search.js shows the part of it that has the words.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

TEXTS, SHOWN = "searchtexts.js", "search.js"


def sections(document: nodes.document) -> list[tuple[str, str]]:
    """The anchor of each section and its text, without that of sections in it and of what only the builder reads."""
    return [(section["ids"][0], own(section)) for section in document.findall(nodes.section)]


def own(section: nodes.section) -> str:
    kept = [child for child in section.children if not isinstance(child, nodes.section | nodes.title)]
    pieces = [_words(child) for child in kept if not isinstance(child, nodes.Invisible)]
    return re.sub(r"\s+", " ", " ".join(pieces)).strip()


def _words(node: nodes.Node) -> str:
    """The words of a node, of a table with a space between cells."""
    texts = (text for text in node.findall(nodes.Text) if not isinstance(text.parent, nodes.raw | nodes.comment))
    blocks = (nodes.entry, nodes.list_item, nodes.paragraph, nodes.term)
    return "".join(f"{text.astext()}{' ' if isinstance(text.parent, blocks) else ''}" for text in texts)


def write(app: Sphinx, error: Exception | None) -> None:
    if error is None and app.builder.format == "html":
        found = {name: sections(app.env.get_doctree(name)) for name in sorted(app.env.found_docs)}
        script = "const PAGE_TEXTS = " + json.dumps(found, ensure_ascii=False, separators=(",", ":")) + ";\n"
        (Path(app.outdir) / "_static" / TEXTS).write_text(script, encoding="utf-8")


def load(app: Sphinx, name: str, template: str, context: dict[str, Any], document: nodes.document | None) -> None:
    if name == "search":
        app.add_js_file(TEXTS)
        app.add_js_file(SHOWN)


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("html-page-context", load)
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
