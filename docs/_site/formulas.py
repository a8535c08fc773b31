"""Equations in letters, as μ_{k+1} = Ad*_F μ_k: blocks become MathML, and in running text what stands after _ and ^ is
lowered and raised.

They need no program in the browser and no fonts of their own. In running text only what cannot be a name of Python is
taken for a formula: the base is one letter, a sign, or one of `BASES`.
"""

from __future__ import annotations

import re
from typing import Any

import mathml
from docstrings import is_python
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

BASES = {"ad", "Ad", "max", "min", "lim", "exp", "dτ", "dσ", "δx", "δu", "δz"}
GROUP = r"\{(?:[^{}]|\{[^{}]*\})*\}"
INDEX = r"[−-]?(?:(?:[a-z]{1,8}|[A-Z]{1,8})\d*|\d+|[^\W\dA-Za-z_][\u0300-\u036f]*)|[½×⊤∗*]"
SCRIPT = re.compile(rf"(?<=[^\s,;:(\[/=+])([_^])({GROUP}|{INDEX})")
WORD = re.compile(r"[A-Za-z0-9_]+$")
Piece = tuple[str, str]


def pieces(text: str) -> list[Piece]:
    """A text as pieces ("", text), ("_", lowered) and ("^", raised)."""
    found: list[Piece] = []
    end = 0
    for script in SCRIPT.finditer(text):
        if script.start() < end or not is_formula(text, script):
            continue
        if script.start() > end:
            found.append(("", text[end : script.start()]))
        inner = script[2]
        found.append((script[1], inner[1:-1] if inner.startswith("{") else inner))
        end = script.end()
    return [*found, ("", text[end:])] if end < len(text) or not found else found


def is_formula(text: str, script: re.Match) -> bool:
    """Whether what stands before _ or ^ is the letter or sign of a formula, and not a word."""
    word = WORD.search(text[: script.start()])
    if word is None:
        return True
    base = word[0].rpartition("_")[2] if script[1] == "^" else word[0]
    if script[2] in ("dot", "bar", "hat", "axes", "names"):
        return False
    if script[1] == "_" and text[script.end() : script.end() + 1] == "_":
        return False
    single = len(base) == 1 or base in BASES
    after_sign = word.start() > 0 and not text[word.start() - 1].isascii() and len(base) <= 2
    return single or after_sign or base.isdigit()


def made(text: str) -> list[nodes.Node]:
    """The nodes of a text, with lowered and raised ones."""
    kinds = {"_": nodes.subscript, "^": nodes.superscript}
    found: list[nodes.Node] = []
    for sign, piece in pieces(text):
        if sign:
            node = kinds[sign]()
            node += made(piece)
            found.append(node)
        else:
            found.append(nodes.Text(piece))
    return found


class Formulas(SphinxTransform):
    """Draw indented blocks that are no program as mathematics, and lower and raise in running text."""

    default_priority = 880

    def apply(self, **kwargs: Any) -> None:
        for block in list(self.document.findall(nodes.literal_block)):
            if self.is_equation(block):
                drawn = f'<div class="equation" tabindex="0">{mathml.rendered(block.astext())}</div>'
                block.replace_self(nodes.raw("", drawn, format="html"))
        for text in list(self.document.findall(nodes.Text)):
            if not self.is_verbatim(text) and SCRIPT.search(text):
                found = made(str(text))
                if len(found) > 1:
                    text.parent.replace(text, found)

    @staticmethod
    def is_equation(block: nodes.literal_block) -> bool:
        """Whether a block of no language is written in the signs of mathematics; one of a docstring has its class."""
        if "equation" in block["classes"]:
            return True
        text = block.astext()
        signs = len(re.findall(r"[^\x00-\x7f─-╿·–—…°²³µ≥≤]", text))
        return block.get("language") in (None, "", "default", "none") and signs >= 3 and not is_python(text)

    @staticmethod
    def is_verbatim(text: nodes.Text) -> bool:
        node = text.parent
        while node is not None:
            if isinstance(node, nodes.literal | nodes.literal_block | nodes.FixedTextElement | nodes.subscript):
                return True
            if isinstance(node, nodes.superscript | nodes.raw | nodes.comment | nodes.title_reference):
                return True
            if node.__class__.__name__.startswith("desc_") and node.__class__.__name__ != "desc_content":
                return True
            node = node.parent
        return False


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_transform(Formulas)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
