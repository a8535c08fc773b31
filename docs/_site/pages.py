"""What Sphinx needs and GitHub does not: the order of the pages, and the text of scripts that a page shows.

The order of the pages is that of the links of docs/index.md, under its bold headings. A page that has a folder of its
name, as docs/theorems.md has docs/theorems/, comes with the pages of that folder, in the order of its links. On
docs/examples.md a line that is nothing but a link to a script has the script below it, and some a notebook.
"""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath

from notebooks import NAMES
from sphinx.application import Sphinx

LINK = re.compile(r"\[([^\]]*)\]\((?!https?:|mailto:)([^)#\s]+\.md)(?:#[^)]*)?\)")
CAPTION = re.compile(r"^\*\*([^*\n]+)\*\*", re.MULTILINE)
SCRIPT = re.compile(r"^\[(examples/\w+\.(\w+))\]\(\.\./\1\)$", re.MULTILINE)
INDEX, EXAMPLES = "docs/index", "docs/examples"


def linked(text: str, folder: PurePosixPath) -> dict[str, str]:
    """The pages that a text links to, by their names in Sphinx, in order, each with the words of its first link."""
    found: dict[str, str] = {}
    for words, target in LINK.findall(text):
        words = words[:1].upper() + words[1:]
        found.setdefault(normal(folder / target).removesuffix(".md"), re.sub(r"[`*]", "", words))
    return found


def normal(path: PurePosixPath) -> str:
    """docs/../README.md is README.md."""
    parts: list[str] = []
    for part in path.parts:
        if part == ".." and parts:
            parts.pop()
        else:
            parts.append(part)
    return "/".join(parts)


def chapters(text: str) -> list[tuple[str, str]]:
    """The text of the index under each of its bold headings."""
    pieces = CAPTION.split(text)
    return [(caption.strip(), body) for caption, body in zip(pieces[1::2], pieces[2::2], strict=True)]


def listing(caption: str, pages: dict[str, str]) -> str:
    """A table of contents that only the side bar shows."""
    lines = ["", "```{toctree}", ":hidden:", *([f":caption: {caption}"] if caption else []), ""]
    return "\n".join([*lines, *(f"{words} </{name}>" for name, words in pages.items()), "```", ""])


def with_contents(app: Sphinx, name: str, source: list[str]) -> None:
    """Add the pages below a page, from its own links."""
    page, text = PurePosixPath(name), source[0]
    if name == INDEX:
        known: set[str] = {INDEX}
        for caption, body in chapters(text):
            pages = linked(body, page.parent)
            under = {n: words for n, words in pages.items() if n not in known and is_page(app, n) and top(n)}
            known.update(under)
            source[0] += listing(caption, under) if under else ""
    else:
        folder = str(page) + "/" if page.name != "index" else str(page.parent) + "/"
        pages = linked(text, page.parent)
        under = {n: words for n, words in pages.items() if n.startswith(folder) and n != name and is_page(app, n)}
        source[0] += listing("", under) if under else ""


def top(name: str) -> bool:
    """Whether a page lies in docs/ itself or beside it; deeper ones come with the page above them."""
    return PurePosixPath(name).parent in (PurePosixPath("docs"), PurePosixPath(".")) or name.endswith("/index")


def is_page(app: Sphinx, name: str) -> bool:
    return (Path(app.srcdir) / f"{name}.md").is_file()


def with_scripts(app: Sphinx, name: str, source: list[str]) -> None:
    """Add the text of each script below the line that links to it."""
    if name == EXAMPLES:
        languages = {"py": "python", "toml": "toml"}
        for script in reversed(list(SCRIPT.finditer(source[0]))):
            options = f":language: {languages[script[2]]}\n:class: script"
            shown = f"\n\n```{{literalinclude}} /{script[1]}\n{options}\n```\n"
            if (name := PurePosixPath(script[1]).stem) in NAMES:
                shown = f'\n<a href="../notebooks/{name}.ipynb" download>As a notebook</a>{shown}'
            source[0] = source[0][: script.end()] + shown + source[0][script.end() :]


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", with_contents)
    app.connect("source-read", with_scripts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
