"""The page that compares: its figures are those of the pages that measure."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "comparison.md").read_text("utf-8")
NUMBER = re.compile(r"\d+(?: \d{3})*(?:\.\d+)?(?:e-\d+)?")


def measured() -> list[tuple[str, list[str]]]:
    """(name of a page, cells with figures) of each row of the table of measurements."""
    table = PAGE.partition("### Measured next to each other")[2].partition("\n## ")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines() if line.startswith("| ")]
    found, page = [], ""
    for _, _, here, there, where in rows[1:]:
        link = re.search(r"\((\w+)\.md", where)
        page = link[1] if link else "comparison" if where == "below" else page
        found.append((page, [here, there]))
    return found


@pytest.mark.parametrize(("page", "cells"), measured())
def test_each_measured_figure_stands_on_the_page_that_measures_it(page: str, cells: list[str]) -> None:
    text = (DOCS / f"{page}.md").read_text("utf-8")
    text = text.partition("\n## ")[2].partition("\n## ")[2] if page == "comparison" else text
    there = set(NUMBER.findall(text))
    for cell in cells:
        figures = NUMBER.findall(re.sub(r"RK4|Suzuki-4", "", cell))
        assert set(figures) <= there, f"{page}.md has no {sorted(set(figures) - there)}"
