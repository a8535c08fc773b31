"""`coadjoint keys`: the keys of files, and the page that is made of them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from coadjoint.cli.keys import _shared, declared_keys, page
from coadjoint.cli.main import main
from coadjoint.sections import key, read, rows
from coadjoint.units import TIME

PAGE = Path(__file__).parents[2] / "docs" / "keys.md"


@dataclass(frozen=True)
class Above:
    """A section above another. late: how long it waits, s; first, second: numbers of either. Raises nothing."""

    late: float = key("", TIME, default=0.5)
    second: int = key("", default=2)


@dataclass(frozen=True)
class Section(Above):
    """A section. until: when it ends."""

    until: float = key("", TIME, default=float("inf"))
    course: str = key("the course", words=("held", "linear"), default="held")
    from_: tuple[float, ...] = key("", default=())
    given: dict[str, object] = key("all others", rest=True, factory=dict)


def test_a_row_has_the_name_unit_default_and_meaning_that_a_field_and_its_class_declare() -> None:
    assert [tuple(row) for row in rows(Section)] == [
        ("late", "s", "0.5", "how long it waits, s"),
        ("second", "", "2", "numbers of either"),
        ("until", "s", "", "when it ends"),
        ("course", "", '"held"', 'the course: "held" or "linear"'),
        ("from", "", "", ""),
        ("NAME", "", "", "all others"),
    ]
    assert read(Section, "section", {"late_min": 1.0}).late == 60.0


def test_the_page_of_keys_is_what_the_sections_declare() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(declared_keys()), "coadjoint keys --markdown > docs/keys.md"


def test_keys_of_all_kinds_of_a_section_are_listed_once() -> None:
    kinds = {"sensors, one": rows(Above), "sensors, two": rows(Section), "late": rows(Above)}
    text = page({"run files": kinds})
    assert text.count("- `late`, s, 0.5: how long it waits, s") == 2  # of all kinds, and of the section `late`
    listed = {part.partition("\n")[0]: part for part in text.split("### ")[1:]}
    assert "`second`" in listed["`[sensors]` of run files: all kinds"]
    assert "No others." in listed["`[sensors, one]` of run files"]
    assert (
        "`until`" in listed["`[sensors, two]` of run files"] and "`late`" not in listed["`[sensors, two]` of run files"]
    )


def test_keys_that_all_kinds_share_keep_the_order_of_the_first() -> None:
    late, second, until = rows(Section)[:3]
    sections = {"sensors, one": [late, second], "sensors, two": [second, until, late], "run": [late], "water, no": []}
    assert _shared(sections) == {"sensors": [late, second]}


def test_every_key_of_every_file_has_a_meaning() -> None:
    found = {
        f"[{name}] {row.key}": row for of in declared_keys().values() for name, listed in of.items() for row in listed
    }
    assert len(found) > 250
    assert not [name for name, row in found.items() if len(row.meaning) < 3 and row.meaning == row.unit]


def test_a_section_is_listed_with_unit_default_and_meaning(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "run"]) == 0
    text = capsys.readouterr().out
    assert "[run] of run files" in text and "[run] of mission files" in text and "[output]" not in text
    assert any(line.split()[:3] == ["dt", "s", "needed"] for line in text.splitlines())
    assert main(["keys", "[mission]", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["mission files"]["mission"]
    assert {"key": "bottom", "unit": "m", "default": "", "meaning": "depth of the bottom"} in listed


def test_a_section_that_is_not_known_names_the_nearest_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "mision"]) == 2
    assert "no section `mision`: did you mean `mission`?" in capsys.readouterr().err
