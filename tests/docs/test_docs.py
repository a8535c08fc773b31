"""Every Python block of the README and of the pages runs: those of a page in order, in one namespace."""

from __future__ import annotations

import operator
import re
import subprocess
import sys
import tomllib
import warnings
from pathlib import Path
from typing import Any, get_args

import matplotlib
import matplotlib.pyplot
import pytest
from markdown_it import MarkdownIt
from printed import disagreement

import coadjoint as co
from coadjoint.cli.main import every_command
from coadjoint.sections import keys
from coadjoint_vehicles.files.file import BodySection
from coadjoint_vehicles.files.kinds import kinds

matplotlib.use("Agg")
ROOT = Path(__file__).parents[2]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```python\n(.*?)^```$(?:\s*^```text\n(.*?)^```$)?", re.MULTILINE | re.DOTALL)
"""A block that runs, and what the page shows of its output directly below."""
WITH_CODE = [page for page in PAGES if BLOCK.search(page.read_text(encoding="utf-8"))]
LINK = re.compile(r"\]\((?!https?:|mailto:)([^)#]*)#?([^)]*)\)")
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: page.name)
def test_every_python_block_of_a_page_runs_and_prints_what_the_page_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = page.read_text(encoding="utf-8")
    fences = [line.strip() for line in text.splitlines() if line.startswith("```")]
    assert len(fences) % 2 == 0, f"{page.name} has a block that is not closed."
    namespace: dict[str, object] = {"__name__": "__main__"}
    other = []
    for block in BLOCK.finditer(text):
        before = text[: block.start(1)].count("\n")
        # The empty lines make a traceback point at the line of the page.
        code = compile("\n" * before + block.group(1), str(page), "exec")
        exec(code, namespace)
        printed = "".join(capsys.readouterr())
        line = disagreement(block.group(2) or "", printed)
        other += [] if line is None else [f"{page.name}, line {before}, shows {line!r}, but prints:\n{printed}"]
    assert not other, "\n".join(other)
    matplotlib.pyplot.close("all")


def test_a_printed_line_agrees_but_for_times_and_last_digits() -> None:
    shown = "order 2  energy 4.2e-07\n…\ntime 0.5 s, 10 steps/s\n[ 0.25 -0.1]"
    printed = "order 2  energy 4.21e-07\nbetween\ntime 0.7 s, 8 steps/s\n[0.2501 -0.1001]"
    assert disagreement(shown, printed) is None
    assert disagreement(shown, printed.replace("order 2", "order 3")) == "order 2  energy 4.2e-07"
    assert disagreement(shown, printed.replace("0.2501", "0.26")) == "[ 0.25 -0.1]"


@pytest.mark.long
def test_recipes_with_other_libraries_run_where_they_are_installed(tmp_path: Path) -> None:
    """In a process of its own, because it sets JAX to float64."""
    for name in ("optimistix", "blackjax"):
        pytest.importorskip(name)
    text = (ROOT / "docs" / "recipes.md").read_text(encoding="utf-8")
    program = "\n".join(re.findall(r"^```py\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.long
def test_the_page_of_optimal_motion_comes_from_a_lagrangian_to_an_optimum_in_25_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "control.md").read_text(encoding="utf-8")
    block = BLOCK.search(text)
    assert block is not None and len(block.group(1).splitlines()) <= 25
    namespace: dict[str, Any] = {}
    exec(block.group(1), namespace)
    matplotlib.pyplot.close("all")
    optimum = namespace["optimum"]
    assert capsys.readouterr().out.splitlines()[0] in text  # the line of its cost, as the page prints it
    assert abs(optimum.cost - 6 * 3.0**2 * 2.5**2 / 5.0**3) < 2e-3 * optimum.cost
    assert abs(optimum.inputs["torque"]).max() < 2.0 and optimum.inputs["torque"].shape == (50, 3)


def anchors(page: Path) -> set[str]:
    """What the headings of a page are called in links."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in HEADING.findall(text)}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_of_a_page_leads_to_a_file_and_a_heading(page: Path) -> None:
    missing = []
    for target, anchor in LINK.findall(page.read_text(encoding="utf-8")):
        file = page.parent / target if target else page
        if not file.exists() or (anchor and anchor not in anchors(file)):
            missing.append(f"{target}#{anchor}")
    assert not missing, f"{page.name} links to {missing}."


def test_the_readme_has_its_example_and_both_commands() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert ROOT / "README.md" in WITH_CODE
    shell = re.findall(r"^```(?:sh|bash)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert sum("coadjoint reproduce" in block and block.count("\n") == 1 for block in shell) == 1
    assert sum("pytest" in block and block.count("\n") == 1 for block in shell) == 1


def test_cards_on_pages_have_the_line_on_accuracy() -> None:
    """A card of an older version would let a reader look for a line in vain; ensembles are not judged."""
    without = []
    for page in PAGES:
        blocks = re.findall(r"^```text\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
        cards = [block for block in blocks if re.match(r"system [^×]*\nmethod ", block)]
        without += [page.name for card in cards if not re.search("^accuracy ", card, re.MULTILINE)]
    assert not without, f"Cards without the line `accuracy` are on {without}."


def test_the_index_leads_to_every_page() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    pages = {page.name for page in (ROOT / "docs").glob("*.md")} - {"index.md"}
    linked = {target for target, _ in LINK.findall(index) if target.endswith(".md")}
    pages |= {f"{page.parent.name}/index.md" for page in (ROOT / "docs").glob("*/index.md")}
    assert not pages - linked, f"docs/index.md has no link to {sorted(pages - linked)}."


def test_every_file_that_contributing_names_exists() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = {name for name in re.findall(r"`([\w./]+/[\w.]*)`", text) if "NAME" not in name}
    assert len(named) > 30
    homes = (ROOT, ROOT / "src", ROOT / "src" / "coadjoint", ROOT / "vehicles" / "src")
    missing = [name for name in sorted(named) if not any((home / name).exists() for home in homes)]
    assert not missing, f"CONTRIBUTING.md names {missing}."


def test_every_package_is_on_the_page_of_architecture_and_imports_only_from_those_above_it() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    packages = re.findall(r"^\*\*`(\w+)/`\*\*", page, re.MULTILINE)
    source = ROOT / "src" / "coadjoint"
    assert sorted(packages) == sorted(folder.parent.name for folder in source.glob("*/__init__.py"))
    upward = []
    for file in (file for package in packages for file in (source / package).rglob("*.py")):
        place = packages.index(file.relative_to(source).parts[0])
        for other in re.findall(r"^(?:from|import) coadjoint\.(\w+)", file.read_text(encoding="utf-8"), re.MULTILINE):
            if other in packages and packages.index(other) > place:
                upward.append(f"{file.relative_to(source)} imports {other}")
    assert not upward


def test_every_dependency_has_its_reason() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    names = {re.split(r"[\[<>=~! ]", requirement)[0] for requirement in project["dependencies"]}
    page = (ROOT / "docs" / "installation.md").read_text(encoding="utf-8")
    missing = [name for name in sorted(names) if f"| [{name}](" not in page and f", [{name}](" not in page]
    assert not missing, f"docs/installation.md gives no reason for {missing}."


def test_the_page_of_commands_names_every_command() -> None:
    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    commands = [metadata.name for kind in get_args(every_command()) for metadata in kind.__metadata__]
    missing = [name for name in commands if f"    coadjoint {name} " not in page]
    assert not missing, f"docs/commands.md says nothing of {missing}."


def test_the_page_of_vehicles_names_every_kind_of_part_and_every_key_of_a_body() -> None:
    page = (ROOT / "docs" / "vehicles.md").read_text(encoding="utf-8")
    missing = [kind for kind in kinds("parts") if f"\n| `{kind}` | " not in page]
    missing += [name for name in keys(BodySection) if f"`{name}`" not in page and f"{name} = " not in page]
    assert not missing, f"docs/vehicles.md says nothing of {missing}."


TYPED = re.compile(r"(?<![\w.])((?:[a-z]\w*\.)*)([A-Z]\w+)(\()?")
"""A class in code within a line: the packages before it, its name, and whether it is called."""
TABLES = ("choosing", "energy", "groups_and_spaces", "hamiltonian", "recipes", "theory", "tutorial")
"""Pages whose tables list classes, as one types them."""


def is_found(name: str) -> bool:
    """Whether `name` is one of coadjoint as `co`, without a warning."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            return operator.attrgetter(name.removeprefix("co."))(co) is not None
    except (AttributeError, DeprecationWarning):
        return False


def not_typed(text: str, tables: bool) -> list[str]:
    """Classes in code within the lines of a page that cannot be typed so: `co.Dual()`, `Dual()`, and `SO3` in tables.

    A class without `co.` is one of the packages of groups, spaces, difference maps and methods.
    """
    known = {name for one in (co.groups, co.spaces, co.difference_maps, co.methods) for name in one.__all__}
    wrong = []
    for line in re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL).splitlines():
        for span in re.findall(r"`([^`]+)`", line):
            for packages, name, call in TYPED.findall(span):
                if packages.startswith("co."):
                    wrong += [] if is_found(packages + name) else [span]
                elif not packages and name in known and ((tables and line.startswith("|")) or call):
                    wrong += [span] if (tables and line.startswith("|")) or name not in co.__all__ else []
    return wrong


def test_classes_in_tables_and_calls_of_pages_are_written_as_one_types_them() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    wrong = {page.name: not_typed(page.read_text(encoding="utf-8"), page.stem in TABLES) for page in pages}
    wrong = {page: names for page, names in wrong.items() if names}
    assert not wrong, f"Write `co.methods.KahanLi6`, with `co.` and its package, for {wrong}."


def test_a_name_that_warns_or_fails_on_a_page_is_found() -> None:
    text = "`co.Dual()`, `Points()`, `SO3()`, `Points`, `co.Nothing`, `co.spaces.Dual()`, `co.SO3`\n| `SO3` |\n"
    assert not_typed(text, tables=True) == ["co.Dual()", "Points()", "co.Nothing", "SO3"]
    assert not_typed(text, tables=False) == ["co.Dual()", "Points()", "co.Nothing"]


def test_no_page_has_text_slanted_by_the_sign_of_an_index() -> None:
    """Ad*_g … Ad*_{h} without backslashes is shown as Ad*, and then all up to the second sign slanted."""
    slanted = []
    for page in PAGES:
        lines = MarkdownIt().enable("table").parse(page.read_text(encoding="utf-8"))
        marks = [one.markup for line in lines for one in line.children or () if one.type == "em_open"]
        slanted += [page.name] if "_" in marks else []
    assert not slanted, f"Write \\*\\_ for *_ in {slanted}."
