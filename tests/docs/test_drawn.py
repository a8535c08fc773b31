"""Figures of the pages: each is made by a script, and drawn anew it shows the same data as the one on the page."""

from __future__ import annotations

import copy
import re
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs" / "figures"))
import drawn  # noqa: E402

MEASURED = {
    "audit_energy", "audit_orders", "benchmarks_heavy_top", "benchmarks_orders", "benchmarks_speed",
    "benchmarks_work_precision", "best_sawtooth", "comparison_energy", "filters_gap", "filters_late", "filters_nees",
    "glider_log", "identification", "kingfisher", "kvlcc2", "long_runs", "sections", "view_cat", "view_mission",
}  # fmt: skip
"""Not compared: of measured times, of round-off, of the audit, of other programs and data, of what lasts, and of
chaotic motion, which the last bit changes."""


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("script", drawn.SCRIPTS)
def test_a_figure_drawn_anew_shows_the_data_of_the_one_on_the_page(script: str, tmp_path: Path) -> None:
    for name, (_, shown) in drawn.draw(script, tmp_path).items():
        kept = drawn.read(ROOT / "docs" / "figures" / f"{name}.png")
        assert kept is not None
        differ = drawn.differences(kept, shown)
        assert not differ, f"{name}.png: {differ}; if that is meant: python docs/figures/drawn.py {script}"
    plt.close("all")


def test_every_figure_of_the_pages_is_compared_or_known_to_be_measured() -> None:
    there = {path.stem for path in (ROOT / "docs" / "figures").glob("*.png")}
    compared = {name for names in drawn.SCRIPTS.values() for name in names}
    examples = {path.stem for path in (ROOT / "examples").glob("*.py")}  # those too long to draw twice are tested there
    assert compared | MEASURED <= there <= compared | MEASURED | examples and not compared & MEASURED
    for name in compared:
        assert drawn.read(ROOT / "docs" / "figures" / f"{name}.png"), f"{name}.png holds no data."
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    used = {Path(p).stem for page in pages for p in re.findall(r"figures/(\w+\.png)\)", page.read_text("utf-8"))}
    assert used == there


def test_other_data_are_a_difference_and_round_off_is_none() -> None:
    figure, axes = plt.subplots()
    x = np.linspace(0, 1, 50)
    axes.plot(x, np.sin(x))
    axes.set(xlabel="time (s)")
    kept = drawn.data(figure)
    for factor, differ in ((1 + 1e-6, False), (1.05, True)):
        axes.lines[0].set_ydata(factor * np.sin(x))
        assert bool(drawn.differences(kept, drawn.data(figure))) == differ
    axes.lines[0].set_ydata(np.sin(x))
    axes.set_yscale("log")
    assert drawn.differences(kept, drawn.data(figure))
    again = copy.deepcopy(kept)
    again[0]["curves"] = []
    assert drawn.differences(kept, again)
    plt.close(figure)


def test_what_a_figure_shows_is_kept_in_its_file(tmp_path: Path) -> None:
    figure, axes = plt.subplots()
    axes.plot([0, 1, 2], [1, np.nan, 3], label="a")
    figure.savefig(tmp_path / "one.png")
    assert drawn.read(tmp_path / "one.png") is None
    drawn.keep(tmp_path / "one.png", drawn.data(figure))
    assert drawn.read(tmp_path / "one.png") == drawn.data(figure)
    assert plt.imread(tmp_path / "one.png").shape[2] == 4
    plt.close(figure)
