"""The documentation site: what it adds to the pages, and that a link that leads nowhere fails the build."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
needs_sphinx = pytest.mark.skipif(
    any(find_spec(name) is None for name in ("sphinx", "myst_parser", "furo")), reason="needs coadjoint[docs]"
)


def build(pages: Path, out: Path) -> subprocess.CompletedProcess:
    """The site of a folder of pages, with the settings of docs/conf.py and warnings as errors."""
    asked = ["-q", "-W", "--keep-going", "-b", "html", "-c", ROOT / "docs", pages, out]
    return subprocess.run([sys.executable, "-m", "sphinx", *map(str, asked)], capture_output=True, text=True)


@needs_sphinx
@pytest.mark.parametrize("link", ["good", "page", "heading", "file"])
def test_a_link_that_leads_nowhere_fails_the_build(tmp_path: Path, link: str) -> None:
    text = {
        "good": "[other](other.md#a-heading), [script](../examples/one.py) and `co.simulate`",
        "page": "[other](another.md)",
        "heading": "[other](other.md#no-heading)",
        "file": "[script](../examples/none.py)",
    }[link]
    (tmp_path / "docs").mkdir()
    (tmp_path / "examples").mkdir()
    (tmp_path / "examples" / "one.py").write_text("print(1)\n")
    (tmp_path / "docs" / "other.md").write_text("# Other\n\n## A heading\n")
    (tmp_path / "docs" / "index.md").write_text(f"# Pages\n\n**Start here**\n\n- [other](other.md)\n\n{text}\n")
    done = build(tmp_path, tmp_path / "out")
    if link == "good":
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "out" / "docs" / "other.html").is_file()
    else:
        assert done.returncode != 0
        assert re.search(r"docs/index.md:\d+: WARNING: .*(another.md|no-heading|none.py)", done.stderr)


def test_the_page_of_examples_shows_every_example() -> None:
    page = (ROOT / "docs" / "examples.md").read_text(encoding="utf-8")
    shown = re.findall(r"^\[examples/([\w.]+)\]\(\.\./examples/\1\)$", page, re.MULTILINE)
    assert sorted(shown) == sorted(path.name for path in (ROOT / "examples").iterdir() if path.is_file())
