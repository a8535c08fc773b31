"""The commit with which a change is compared, and the tests of what changed and of what imports it directly."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / ".ci"))
import changes  # noqa: E402

HOUR = 3600
NOW = 1_800_000_000
FILES = {
    "src/coadjoint/__init__.py": (
        "if TYPE_CHECKING:\n    from coadjoint import low as low\n    from coadjoint.low import Body as Body\n"
    ),
    "src/coadjoint/units.py": "",
    "src/coadjoint/low/__init__.py": "from coadjoint.low.body import Body\n",
    "src/coadjoint/low/body.py": "import coadjoint.units\nclass Body: ...\n",
    "src/coadjoint/middle/__init__.py": "",
    "src/coadjoint/middle/motion.py": "def move():\n    from coadjoint.low import Body\n",
    "src/coadjoint/middle/inner/__init__.py": "",
    "src/coadjoint/middle/inner/part.py": "",
    "src/coadjoint/middle/inner/data.toml": "",
    "src/coadjoint/high/__init__.py": "from coadjoint.middle import motion\n",
    "tests/conftest.py": "",
    "tests/helper.py": "",
    "tests/other.py": "from helper import x\n",
    "tests/test_units.py": "",
    "tests/low/test_body.py": "import other\n",
    "tests/middle/test_motion.py": "",
    "tests/high/cases.json": "",
    "tests/high/test_high.py": "",
    "tests/truth/test_body_in_space.py": "import coadjoint as co\nco.Body()\n",
    "tests/truth/test_body_of_package.py": "import coadjoint as co\nco.low.Body()\n",
    "tests/truth/test_nothing.py": "import coadjoint as co\nco.Mind()\n",
    "tests/docs/test_pages.py": "",
    "tests/ci/test_parts.py": "",
}
ABOVE = ["middle/test_motion", "truth/test_body_in_space", "truth/test_body_of_package"]
"""The tests of what imports the package `low`."""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.fixture
def git(root: Path, monkeypatch: pytest.MonkeyPatch):
    """A repository with three commits, 30, 20 and 1 hours old, and a function that runs git there."""
    for name in ("BASE", *(name for name in os.environ if name.startswith("GIT_"))):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", os.devnull)
    monkeypatch.setenv("GIT_CONFIG_SYSTEM", os.devnull)

    def run(*words: str, hours: int = 1) -> str:
        date = f"{NOW - hours * HOUR} +0000"
        who = ("-c", "user.name=A", "-c", "user.email=a@example.org")
        environment = {**os.environ, "GIT_AUTHOR_DATE": date, "GIT_COMMITTER_DATE": date}
        done = subprocess.run(
            ["git", *who, *words], cwd=root, env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    run("init", "--quiet", "--initial-branch=main")
    run("add", ".")
    for hours in (30, 20, 1):
        run("commit", "--quiet", "--allow-empty", "--message", f"{hours} hours ago", hours=hours)
    return run


def test_the_base_is_what_BASE_says(git, root, monkeypatch):
    monkeypatch.setenv("BASE", "main~2")
    found = changes.base(root, NOW)
    assert found.commit == git("rev-parse", "main~2") and "BASE gives" in found.why


def test_a_BASE_that_is_no_commit_is_an_error(git, root, monkeypatch):
    monkeypatch.setenv("BASE", "nowhere")
    with pytest.raises(ValueError, match="BASE must be a commit of this repository, but is nowhere"):
        changes.base(root, NOW)


def test_the_base_is_where_the_branch_leaves_origin_main(git, root):
    git("update-ref", "refs/remotes/origin/main", "main~1")
    found = changes.base(root, NOW)
    assert found.commit == git("rev-parse", "main~1") and "leaves origin/main" in found.why


@pytest.mark.parametrize("ahead", [True, False])
def test_an_origin_main_that_contains_head_is_of_no_use_and_the_newest_old_commit_is_taken(git, root, ahead):
    if ahead:
        git("update-ref", "refs/remotes/origin/main", "main")
    found = changes.base(root, NOW)
    assert found.commit == git("rev-parse", "main~1") and "older than six hours" in found.why
    assert ("origin/main contains HEAD" in found.why) == ahead


def test_where_all_commits_are_new_or_none_is_there_everything_counts_as_changed(git, root, tmp_path_factory):
    assert changes.base(root, NOW - 28 * HOUR).commit is None
    elsewhere = tmp_path_factory.mktemp("archive")
    found = changes.base(elsewhere, NOW)
    assert found.commit is None and "everything counts as changed" in found.why


def test_changed_files_are_those_committed_edited_new_and_deleted_since_the_base(git, root):
    (root / "tests/helper.py").write_text("x = 1\n")
    git("commit", "--quiet", "--all", "--message", "x")
    (root / "src/coadjoint/units.py").write_text("y = 1\n")
    (root / "tests/test_units.py").unlink()
    (root / "new.md").write_text("")
    expected = {"tests/helper.py", "src/coadjoint/units.py", "tests/test_units.py", "new.md"}
    assert changes.changed(git("rev-parse", "main~2"), root) == expected


@pytest.mark.cases(6)
@pytest.mark.parametrize(
    ("file", "packages", "own", "importing"),
    [
        ("src/coadjoint/low/body.py", ["low"], ["low/test_body"], ["middle/test_motion", "truth/test_body_in_space"]),
        (
            "src/coadjoint/low/deleted.py",
            ["low"],
            ["low/test_body"],
            ["middle/test_motion", "truth/test_body_in_space"],
        ),
        ("src/coadjoint/middle/motion.py", ["middle"], ["middle/test_motion"], ["high/test_high"]),
        ("src/coadjoint/middle/inner/data.toml", ["middle.inner"], ["middle/test_motion"], []),
        ("src/coadjoint/units.py", ["units"], ["test_units"], ["low/test_body"]),
        ("tests/high/test_high.py", [], ["high/test_high"], []),
        ("tests/high/cases.json", [], ["high/test_high"], []),
        ("tests/helper.py", [], ["low/test_body"], []),
        ("tests/deleted/test_deleted.py", [], [], []),
        ("docs/index.md", [], ["docs/test_pages"], []),
        ("README.md", [], ["docs/test_pages"], []),
        (".ci/run", [], ["ci/test_parts"], []),
        ("LICENSE", [], [], []),
    ],
)
def test_the_tests_are_those_of_the_changed_package_and_of_those_that_import_it(root, file, packages, own, importing):
    found = changes.chosen([file], root)
    assert found.packages == packages
    assert found.own == [f"tests/{name}.py" for name in own]
    assert found.importing == [f"tests/{name}.py" for name in importing]


@pytest.mark.parametrize("file", ["tests/conftest.py", "pyproject.toml"])
def test_what_all_tests_depend_on_changes_all(root, file):
    assert changes.chosen([file], root).own == changes.every_test(root)


def test_tests_of_what_changed_are_not_repeated_as_those_of_what_imports_it(root):
    found = changes.chosen(["src/coadjoint/low/body.py", "src/coadjoint/middle/motion.py"], root)
    assert found.own == ["tests/low/test_body.py", "tests/middle/test_motion.py"]
    truth = [f"tests/truth/test_body_{name}.py" for name in ("in_space", "of_package")]
    assert found.importing == ["tests/high/test_high.py", *truth]


def test_every_package_of_the_library_has_tests():
    folders = {path.parent for path in (ROOT / "src/coadjoint").rglob("*.py")} - {ROOT / "src/coadjoint"}
    names = [".".join(folder.relative_to(ROOT / "src/coadjoint").parts) for folder in folders]
    assert not [name for name in names if not changes.tests_of(name)]
