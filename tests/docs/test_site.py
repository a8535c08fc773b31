"""The documentation site: what it adds to the pages, and that a link that leads nowhere fails the build."""

from __future__ import annotations

import re
import subprocess
import sys
from collections import Counter
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from xml.etree.ElementTree import Element, fromstring

import pytest

import coadjoint as co
from coadjoint.simulation.certificate_forms import MEANINGS

ROOT = Path(__file__).parents[2]
needs_sphinx = pytest.mark.skipif(
    any(find_spec(name) is None for name in ("sphinx", "myst_parser", "furo")), reason="needs coadjoint[docs]"
)
sys.path.insert(0, str(ROOT / "docs" / "_site"))
import mathml  # noqa: E402
import reference  # noqa: E402

if find_spec("sphinx") is not None:
    import docstrings
    import formulas


def build(pages: Path, out: Path) -> subprocess.CompletedProcess:
    """The site of a folder of pages, with the settings of docs/conf.py and warnings as errors."""
    asked = ["-q", "-W", "--keep-going", "-b", "html", "-c", ROOT / "docs", pages, out]
    return subprocess.run([sys.executable, "-m", "sphinx", *map(str, asked)], capture_output=True, text=True)


@pytest.mark.long
@pytest.mark.cases(1)
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
    (tmp_path / "docs" / "other.md").write_text("# Other\n\n## A heading\n\nWords below *it*.\n")
    (tmp_path / "docs" / "index.md").write_text(f"# Pages\n\n**Start here**\n\n- [other](other.md)\n\n{text}\n")
    done = build(tmp_path, tmp_path / "out")
    if link == "good":
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "out" / "docs" / "other.html").is_file()
        searched = (tmp_path / "out" / "search.html").read_text(encoding="utf-8")
        assert searched.index("searchtexts.js") < searched.index("static/search.js")
        texts = (tmp_path / "out" / "_static" / "searchtexts.js").read_text(encoding="utf-8")
        assert '["a-heading","Words below it."]' in texts and "searchtexts.js" not in text
    else:
        assert done.returncode != 0
        assert re.search(r"docs/index.md:\d+: WARNING: .*(another.md|no-heading|none.py)", done.stderr)


def test_the_page_of_examples_shows_every_example() -> None:
    page = (ROOT / "docs" / "examples.md").read_text(encoding="utf-8")
    shown = re.findall(r"^\[examples/([\w.]+)\]\(\.\./examples/\1\)$", page, re.MULTILINE)
    assert sorted(shown) == sorted(path.name for path in (ROOT / "examples").iterdir() if path.is_file())


def test_the_reference_has_every_public_name_once() -> None:
    packages = [co, *(getattr(co, name) for name in co.__all__)]
    packages += [getattr(co.vehicles, name) for name in co.vehicles.__all__]
    packages = [one for one in packages if isinstance(one, ModuleType) and hasattr(one, "__all__")]
    public = {f"{one.__name__}.{name}": getattr(one, name) for one in packages for name in one.__all__}
    public = {name: value for name, value in public.items() if not isinstance(value, ModuleType)}
    found = reference.documented(ROOT / "docs" / "api")
    described = Counter(id(value) for value in found.values())
    missing = [name for name, value in public.items() if id(value) not in described]
    assert len(public) > 250 and not missing, f"docs/api says nothing of {missing}."
    assert max(described.values()) == 1


@needs_sphinx
def test_a_docstring_becomes_text_lists_programs_and_equations() -> None:
    text = """Λ* = hℓ of `co.System`s, a|b.

        run = co.simulate(top, …)

        min Σ_k h/2 L(x_k)   subject to
          r = 0

    size: m, at least 1. form: a function.

    Arguments:
        a, b: numbers. c: another,
            on two lines.
    """
    found = docstrings.restructured(docstrings.dedent("    " + text), frozenset({"size", "form", "a", "b", "c"}))
    assert found.startswith("Λ\\* = hℓ of ``co.System``\\ s, a\\|b.")
    assert ".. code-block:: python\n    :force:\n\n    run = co.simulate(top, …)" in found
    assert ".. parsed-literal::\n    :class: equation\n\n    min Σ\\_k h/2 L(x\\_k)" in found
    assert "``size``\n    m, at least 1.\n``form``\n    a function." in found
    assert "``a``, ``b``\n    numbers.\n``c``\n    another, on two lines." in found


@needs_sphinx
@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("μ_{k+1} = Ad*_F μ_k", "μ<k+1> = Ad*<F> μ<k>"),
        ("T*_nQ, D^R_FΛ, ∂_ξℓ", "T*<n>Q, D<R><F>Λ, ∂<ξ>ℓ"),
        ("save_every, p_dot and x_y_z", "save_every, p_dot and x_y_z"),
        ("e^{ad_ξ}, O(h^{p+1})", "e<ad_ξ>, O(h<p+1>)"),
    ],
)
def test_what_stands_after_the_sign_of_an_index_is_lowered(text: str, found: str) -> None:
    assert "".join(f"<{piece}>" if sign else piece for sign, piece in formulas.pieces(text)) == found


def drawn(text: str) -> Element:
    return fromstring(mathml.rendered(text))


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("μ_{k+1} = Ad*_F μ_k", "sub(μ k+1) = subsup(Ad F ∗) sub(μ k)"),
        ("dI/dt = ⟨𝒦, ∂ℓ/∂a⋄a⟩", "frac(dI dt) = ⟨𝒦,frac(∂ℓ ∂a)⋄a⟩"),
        ("ġ = g⁻¹ξ₀²", "over(g ˙) = sup(g −1)subsup(ξ 0 2)"),
        ("½ Σ_i (a + b)/(2c)", "frac(1 2) under(∑ i) frac(a+b 2c)"),
        ("tan φ/L + D/cos ξ", "tan φ/L + frac(D cosξ)"),
        ("s_{k} of all", "sub(s k) of all"),
    ],
)
def test_an_equation_in_letters_has_its_scripts_fractions_and_accents(text: str, found: str) -> None:
    def spoken(node: Element) -> str:
        name = node.tag[1:]
        inside = [spoken(child) for child in node]
        if name in ("sub", "sup", "subsup", "frac", "over", "under"):
            return f"{name}({' '.join(inside)})"
        return (node.text or "") + "".join(inside)

    assert spoken(drawn(text)).replace(" ", "") == found.replace(" ", "")


def test_lines_of_an_equation_are_rows_and_wide_gaps_columns() -> None:
    table = drawn("Dτ(ξ)      (P32)\ndτ_ξ,   dσ   (P33)")[0]
    assert table.tag == "mtable" and [[cell.tag for cell in row] for row in table] == 2 * [["mtd", "mtd"]]
    assert [row[1][0].text for row in table] == ["(P32)", "(P33)"]


def test_every_equation_of_the_pages_is_drawn() -> None:
    """An indented block that MathML cannot hold would fail only in a browser."""
    drawings = 0
    for page in [*sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs" / "theorems").glob("*.md"))]:
        text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
        for block in re.findall(r"(?:^    \S.*\n)+", text, re.MULTILINE):
            drawings += len(drawn(block)) > 0
    assert drawings > 60


def test_programs_of_the_pages_fit_into_88_columns() -> None:
    """The site shows 88 columns at 1440 pixels; what programs print and what one types into a shell is wrapped."""
    wide = []
    for page in [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]:
        for block in re.findall(
            r"^```(?:python|py|toml)\n(.*?)^```$", page.read_text("utf-8"), re.MULTILINE | re.DOTALL
        ):
            wide += [f"{page.name}: {line}" for line in block.splitlines() if len(line) > 88]
    assert not wide, "\n".join(wide)


def test_titles_of_pages_differ_and_pictures_are_described() -> None:
    pages = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
    texts = {page: page.read_text(encoding="utf-8") for page in pages}
    titles = Counter(text.splitlines()[0] for page, text in texts.items() if page.name not in ("README.md", "index.md"))
    assert [title for title, count in titles.items() if count > 1] == []
    assert [page.name for page, text in texts.items() if re.search(r"!\[\s*\]\(", text)] == []


def test_the_glossary_explains_each_line_of_the_certificate_as_notebooks_and_reports_do() -> None:
    page = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([^|]+) \| (.+) \|$", page.partition("## Lines of the certificate")[2], re.MULTILINE)
    assert {line: meaning.replace("\\|", "|") for line, meaning in rows if line != "line"} == MEANINGS


def test_every_page_begins_with_what_its_reader_can_do_afterwards() -> None:
    pages = [*sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs" / "theorems").glob("*.md"))]
    assert [page.name for page in pages if "After this page" not in page.read_text(encoding="utf-8")[:1200]] == []
