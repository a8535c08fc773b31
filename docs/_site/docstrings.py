"""Docstrings as they are written here, in plain text, turned into reStructuredText.

Plain text has paragraphs, code in `backticks`, indented blocks, which are Python or equations, a list under
`Arguments:`, and sentences such as `size: m, at least 1.` that explain an argument within a paragraph.
"""

from __future__ import annotations

import ast
import inspect
import re
from contextlib import suppress
from textwrap import dedent
from typing import Any

from sphinx.application import Sphinx

CODE = re.compile(r"`([^`\n]+(?:\n[^`\n]+)?)`")
MARKUP = re.compile(r"([\\*_|])")
LISTS = re.compile(r"^(\(?(?:\w|\d+|[ivx]+)[.)]|[-+•–—*]) ")
HEAD = re.compile(r"^(Arguments|Returns|Raises|Fields):$")
ITEM = re.compile(r"^    (\**\w+(?:, \**\w+)*): ?(.*)$")


def restructured(text: str, names: frozenset[str] = frozenset()) -> str:
    """A docstring as reStructuredText; `names` are the arguments and fields that it may explain within a paragraph."""
    pieces = []
    for block in re.split(r"\n\s*\n", dedent(text).strip("\n")):
        lines = block.splitlines()
        if HEAD.match(lines[0]):
            pieces.append(described(items(lines[1:], names)))
        elif lines[0].startswith("    "):
            pieces.append(displayed(dedent(block)))
        elif explained := sentences(" ".join(line.strip() for line in lines), names):
            pieces.append(described(explained))
        else:
            pieces.append(paragraph("\n".join(line.strip() for line in lines)))
    return "\n\n".join(pieces)


def items(lines: list[str], names: frozenset[str]) -> list[tuple[str, str]]:
    """The arguments of a list, each with its text; an argument that another's text explains is one more."""
    found: list[list[str]] = []
    for line in lines:
        if begins := ITEM.match(line):
            found.append([begins[1], begins[2]])
        elif found:
            found[-1][1] += " " + line.strip()
        else:
            found.append(["", line.strip()])
    pairs = []
    for name, text in found:
        whole = f"{name}: {text}"
        pairs += sentences(whole, names) or [(name, text)]
    return pairs


def sentences(text: str, names: frozenset[str]) -> list[tuple[str, str]]:
    """`size: m. form: a function.` as pairs, if the text begins by explaining one of the names; otherwise nothing."""
    starts = [m for m in re.finditer(r"(?:^|(?<=[.;] ))(\**\w+(?:, \**\w+)*): ", text) if is_known(m[1], names)]
    if not starts or starts[0].start() != 0:
        return []
    ends = [m.start() for m in starts[1:]] + [len(text)]
    return [(m[1], text[m.end() : end].strip().rstrip(";")) for m, end in zip(starts, ends, strict=True)]


def is_known(written: str, names: frozenset[str]) -> bool:
    return all(name.lstrip("*") in names for name in written.split(", "))


def described(pairs: list[tuple[str, str]]) -> str:
    """A list of definitions."""
    lines = []
    for name, text in pairs:
        term = ", ".join(f"``{one}``" for one in name.split(", ")) if name else "\\ "
        lines += [term, f"    {paragraph(text) if text else '…'}"]
    return "\n".join(lines)


def displayed(block: str) -> str:
    """An indented block: Python where it can be read as Python, an equation otherwise."""
    inside = "\n".join(f"    {line}" for line in block.splitlines())
    if is_python(block):
        return f".. code-block:: python\n    :force:\n\n{inside}"
    return f".. parsed-literal::\n    :class: equation\n\n{plain(inside)}"


def is_python(block: str) -> bool:
    """Whether a block is Python; `…` stands for what is left out, and a name alone is no program."""
    text = re.sub(r"…", "0", block)
    try:
        tree = ast.parse(text)
    except SyntaxError:
        return (
            text.lstrip().startswith((">>>", "def ", "co.", "import "))
            or re.match(r"\s*\w+ = \w+\.\w+\(", text) is not None
        )
    return any(isinstance(node, ast.Call | ast.Import | ast.FunctionDef | ast.Attribute) for node in ast.walk(tree))


def paragraph(text: str) -> str:
    """Text with its code marked as such, and nothing else taken for markup."""
    text = LISTS.sub(lambda m: "\\" + m[0], text)
    pieces, end = [], 0
    for code in CODE.finditer(text):
        pieces.append(plain(text[end : code.start()]))
        before = "\\ " if text[: code.start()][-1:].strip() and text[code.start() - 1] not in "([{-/" else ""
        after = "\\ " if re.match(r"[^\s.,;:!?)\]}/-]", text[code.end() :]) else ""
        pieces.append(f"{before}``{' '.join(code[1].split())}``{after}")
        end = code.end()
    return "".join([*pieces, plain(text[end:])])


def plain(text: str) -> str:
    return MARKUP.sub(r"\\\1", text).replace("`", "\\`")


def argument_names(thing: Any) -> frozenset[str]:
    """The arguments of a function or a class, and the fields and members of a class."""
    found: set[str] = set()
    with suppress(TypeError, ValueError):
        found.update(inspect.signature(thing).parameters)
    if inspect.isclass(thing):
        found.update(name for name in dir(thing) if not name.startswith("_"))
        found.update(name for kind in thing.__mro__ for name in getattr(kind, "__annotations__", {}))
    return frozenset(found)


def rewrite(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    lines[:] = restructured("\n".join(lines), argument_names(thing)).splitlines()


def readable(app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str, returns: Any) -> Any:
    """Fields that are made anew have `<factory>` for a default, which is no Python."""
    return (signature.replace("<factory>", "..."), returns) if signature else None


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", rewrite)
    app.connect("autodoc-process-signature", readable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
