"""Pages are written by the rules of prose.toml: short paragraphs, and plain words in place of private ones."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RULES = tomllib.loads((Path(__file__).parent / "prose.toml").read_text(encoding="utf-8"))
PAGES = [*sorted(ROOT.glob("*.md")), ROOT / "vehicles/README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES += sorted((ROOT / ".github").rglob("*.md"))
BLOCK = re.compile(r"^```[\s\S]*?^```$|^ {4}.*$|^\|.*$", re.MULTILINE)


def prose(text: str) -> str:
    """The text without blocks of code, formulas and tables, and … for code in a line."""
    return re.sub(r"`[^`\n]*`", "…", BLOCK.sub("\n\n", text))


def paragraphs(text: str) -> list[str]:
    """What stands between empty lines; each point of a list is one."""
    return [piece for piece in re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )", prose(text)) if piece.strip()]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_paragraphs_are_short_and_words_are_plain(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    long = [piece.strip()[:60] for piece in paragraphs(text) if len(piece.split()) > RULES["paragraph"]]
    assert not long, f"{page.name}: paragraphs of more than {RULES['paragraph']} words begin with {long}."
    line = " ".join(prose(text).split())
    found = [
        f"“{word}”: {instead}" for word, instead in RULES["instead"].items() if re.search(rf"\b{word}\b(?!-)", line)
    ]
    assert not found, f"{page.name} has {found}."


def test_a_long_paragraph_and_a_private_word_are_found() -> None:
    text = "Short.\n\n" + "word " * 91 + "\n\n- a point\n- another `of code`\n\n```python\nlong = 1\n```\n"
    assert [len(piece.split()) for piece in paragraphs(text)] == [1, 91, 3, 3]
