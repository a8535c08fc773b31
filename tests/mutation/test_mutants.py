"""The sample of errors: each operator, what is drawn, and what a small package's tests catch of it."""

from __future__ import annotations

import ast
import dataclasses
import importlib.util
import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import mutants
import pytest
from executed import MODULE, Places, digest
from known import Known

PACKAGE = Path(__file__).parents[2] / "src" / "coadjoint"

OPERATORS = [
    ("sign", "y = a + b", ["y = a - b"]),
    ("sign", "y = (a) - (b)", ["y = (a) + (b)"]),
    ("sign", "y = -x @ 'é'", ["y = x @ 'é'"]),
    ("index", "y = x[1, -1]", ["y = x[2, -1]", "y = x[1, -2]"]),
    ("index", "y = x[2:k]", ["y = x[3:k]"]),
    ("transpose", "y = A.T", ["y = A"]),
    ("transpose", "y = np.swapaxes(A, 1, 2)", ["y = (A)"]),
    ("transpose", "y = A.transpose(1, 0)", ["y = A"]),
    ("constant", "y = f(2, 0.5, True)", ["y = f(3, 0.5, True)", "y = f(2, 1.0, True)", "y = f(2, 0.5, False)"]),
    ("comparison", "y = a < b", ["y = a <= b"]),
    ("comparison", "y = a not in b", ["y = a in b"]),
    ("comparison", "y = a is None", ["y = a is not None"]),
    ("extremum", "y = np.argmax(x)", ["y = np.argmin(x)"]),
    ("guard", "if x < 0: raise E", ["if False: raise E"]),
    ("guard", "_check(x)", ["pass"]),
    ("logic", "y = a and b", ["y = a or b"]),
    ("logic", "y = not a", ["y = a"]),
    ("logic", "y = a if c else b", ["y = a if not (c) else b"]),
    ("order", "y = f(a, b, c)", ["y = f(b, a, c)"]),
    ("order", "y = A @ B", ["y = B @ A"]),
]


@pytest.mark.cases(6)
@pytest.mark.parametrize(("operator", "line", "changed"), OPERATORS, ids=[line for _, line, _ in OPERATORS])
def test_an_operator_makes_its_errors_of_a_line(operator, line, changed):
    text = f"# é\n{line}\n"
    made = [mutant for mutant in mutants.mutants("file.py", text) if mutant.operator == operator]
    assert [mutant.after for mutant in made] == changed
    assert all(mutants.valid(mutant, text) and mutant.line == 2 for mutant in made)


@pytest.mark.parametrize(
    "text",
    [
        '"""y = 1 + 2"""',
        "zip(a, b, strict=True)",
        "x: Array[1]",
        "y = f'{a + 1}'",
        "@cache(1)\ndef f(): ...",
        "if TYPE_CHECKING:\n    a(1)",
    ],
)
def test_texts_annotations_decorators_and_strict_pairs_stay(text):
    assert mutants.mutants("file.py", text) == []


def test_an_error_changes_one_line_and_keeps_the_number_of_lines():
    text = (PACKAGE / "groups" / "rigid_motions.py").read_text()
    found = mutants.mutants("groups/rigid_motions.py", text)
    for mutant in found[::10]:
        lines, new = text.splitlines(), mutants.changed(text, mutant.edit).splitlines()
        assert [i + 1 for i, (a, b) in enumerate(zip(lines, new, strict=True)) if a != b] == [mutant.line]
        assert mutant.lines[0] <= mutant.line <= mutant.lines[1]


def test_every_kind_is_found_in_the_library():
    kinds = Counter()
    for name in ("spaces/submanifold.py", "mechanics/check.py", "simulation/result.py", "sweeps/numbers.py"):
        kinds.update(mutant.operator for mutant in mutants.mutants(name, (PACKAGE / name).read_text()))
    assert set(kinds) == {operator for operator, _, _ in OPERATORS}


def test_a_sample_is_that_of_its_seed_and_takes_no_line_twice():
    first, again, other = (mutants.draw(PACKAGE, seed, 6, ["runs"]) for seed in (1, 1, 2))
    assert first == again != other
    assert len({(mutant.file, mutant.line) for mutant in first}) == 6
    for mutant in first:
        text = (PACKAGE / mutant.file).read_text()
        assert ast.dump(ast.parse(mutants.changed(text, mutant.edit))) != ast.dump(ast.parse(text))


def test_shares_are_by_size_with_a_least_number_for_each():
    assert mutants.shares({"a": 90, "b": 9, "c": 1}, 16, 2) == {"a": 11, "b": 3, "c": 2}


LIBRARY = """\
LIMIT = 3


def clipped(x):
    if x > LIMIT:
        return LIMIT
    return x
"""


@pytest.fixture
def followed(tmp_path):
    """A root with a function, and what two files of tests were seen to execute of it."""
    for name, text in {"src/clip.py": LIBRARY, "tests/test_a.py": "a", "tests/test_b.py": "b"}.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    places = Places(tmp_path / "src")
    function = places.place("clip.py", 5)[0]

    def executed(test, seconds, *lines):
        file = f"tests/test_{test[0]}.py"
        return {"test": f"{file}::{test}", "digest": digest(test[0]), "seconds": seconds, "lines": {function: lines}}

    tests = [executed("a1", 2.0, 0, 2), executed("a2", 0.5, 0, 1), executed("b1", 1.0, 0, 1), executed("b2", 0.1)]
    names = {file: [t["test"] for t in tests if t["test"].startswith(f"tests/test_{file}")] for file in "ab"}
    heads = [
        {"file": f"tests/test_{file}.py", "digest": digest(file), "default": names[file], "seconds": 0.2}
        for file in "ab"
    ]
    record = tmp_path / "tests.jsonl"
    record.write_text("".join(json.dumps(entry) + "\n" for entry in [*heads, *tests]) + '{"file": "tests/te')
    return tmp_path, record, places


def at(line: int) -> mutants.Mutant:
    """An error in a line."""
    return next(mutant for mutant in mutants.mutants("clip.py", LIBRARY) if mutant.line == line)


def test_the_tests_that_execute_a_line_come_first_and_the_cheap_ones_of_them(followed):
    root, record, places = followed
    known = Known(record, root, ["clip.py"])
    assert known.missing == []
    inner = dataclasses.replace(at(5), line=6, lines=(6, 6))
    assert [name[-2:] for name in known.executing(inner, places)] == ["a2", "b1", "b2", "a1"]


def test_a_line_that_no_test_executes_has_none_and_one_that_imports_execute_has_all(followed):
    root, record, _ = followed
    known = Known(record, root, ["clip.py"])
    (root / "src" / "clip.py").write_text(LIBRARY + "\n\ndef unused(x):\n    return -x\n")
    fresh = Places(root / "src")
    unused = dataclasses.replace(at(5), line=11, lines=(11, 11))
    assert known.executing(unused, fresh) == []
    constant = dataclasses.replace(at(5), line=1, lines=(1, 1))
    assert fresh.place("clip.py", 1)[0].endswith(MODULE) and len(known.executing(constant, fresh)) == 4


def test_a_function_that_was_changed_since_is_known_by_its_name(followed):
    root, record, _ = followed
    (root / "src" / "clip.py").write_text(LIBRARY.replace("x > LIMIT", "x >= LIMIT"))
    found = Known(record, root, ["clip.py"]).executing(at(5), Places(root / "src"))
    assert [name[-2:] for name in found] == ["b2", "a2", "b1", "a1"]


def test_a_file_of_tests_that_was_changed_is_followed_again(followed):
    root, record, _ = followed
    (root / "tests" / "test_b.py").write_text("changed")
    known = Known(record, root, ["clip.py"])
    assert known.missing == ["tests/test_b.py"] and not any("test_b" in name for name in known.tests)


def test_a_file_whose_following_ended_before_its_tests_were_known_is_followed_again(followed):
    root, record, places = followed
    entries = [json.loads(line) for line in record.read_text().splitlines()[:-1]]
    del entries[1]["default"]
    record.write_text("".join(json.dumps(entry) + "\n" for entry in entries))
    known = Known(record, root, ["clip.py"])
    assert known.missing == ["tests/test_b.py"]
    assert {name.split("::")[0] for name in known.executing(at(5), places)} == {"tests/test_a.py"}


def test_tests_run_in_groups_until_their_time_is_spent(followed):
    root, record, _ = followed
    known = Known(record, root)
    names = [f"tests/test_{name[0]}.py::{name}" for name in ("b2", "a2", "b1", "a1")]
    groups = list(known.batches(names, (0.5, 2.0), 100.0))
    assert [group for group, _ in groups] == [names[:2], names[2:]]
    assert [cost for _, cost in groups] == pytest.approx([1.0, 3.4])
    assert [group for group, _ in known.batches(names, (0.5, 2.0), 0.9)] == [names[:2]]


TOY = {
    "src/toy/__init__.py": "",
    "src/toy/numbers.py": """\
def largest(a, b):
    return max(a, b)


def clipped(x):
    if x > limit():
        x = limit()
    return x


def limit():
    return int("3")


def unused(x):
    return x + x
""",
    "src/toy/child.py": "import toy.numbers\nassert -toy.numbers.limit() < 0\n",
    "tests/test_toy.py": """\
import subprocess, sys

from toy.numbers import clipped, largest


def test_largest():
    assert largest(1, 2) == 2


def test_clipped():
    assert clipped(5) == 3


def test_child():
    assert subprocess.run([sys.executable, "-m", "toy.child"]).returncode == 0
""",
}


@pytest.fixture(scope="module")
def toy(tmp_path_factory):
    root = tmp_path_factory.mktemp("toy")
    for name, text in TOY.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    command = [sys.executable, str(Path(__file__).parent), "--root", str(root), "--package", "toy", "--count", "5"]
    command += ["--least", "0.9", "--processes", "2"]
    quick = os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=quick, check=False)
    assert done.returncode == 1, done.stdout + done.stderr  # fewer are caught
    entries = map(json.loads, (root / "build" / "mutation" / "toy" / "seed-7.jsonl").read_text().splitlines())
    return done.stdout, {after: (word, by) for _, _, after, word, by in entries}


def test_the_share_that_is_caught_is_of_those_that_are_not_equivalent(monkeypatch):
    spec = importlib.util.spec_from_file_location("sampling_errors", Path(__file__).with_name("__main__.py"))
    program = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, program)
    spec.loader.exec_module(program)
    words = ["killed"] * 3 + ["survived", "not executed", "equivalent", "equivalent"]
    assert program.caught({number: program.Verdict(word) for number, word in enumerate(words)}) == 3 / 5
    assert program.caught({}) == 0


@pytest.mark.long
def test_an_error_that_a_test_notices_is_killed_by_it(toy):
    word, by = toy[1]["return min(a, b)"]
    assert word == "killed" and by.startswith("tests/test_toy.py::test_largest — assert 1 == 2")


@pytest.mark.long
def test_an_error_at_a_limit_that_no_test_reaches_survives(toy):
    assert toy[1]["if x >= limit():"][0] == "survived"


@pytest.mark.long
def test_a_line_that_no_test_executes_is_named(toy):
    assert toy[1]["return x - x"] == ("not executed", "")


@pytest.mark.long
def test_an_error_in_a_line_of_a_child_process_is_killed(toy):
    assert {word for after, (word, _) in toy[1].items() if after.startswith("assert")} == {"killed"}


@pytest.mark.long
def test_the_table_ends_with_the_share_that_is_caught(toy):
    assert "errors that are not equivalent are caught" in toy[0].splitlines()[-1]
