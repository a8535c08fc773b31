"""api.json is the public interface, and what goes or changes in it is named in CHANGELOG.md."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / ".ci"))
import interface

HOW = "Run `python .ci/interface.py`, and name in CHANGELOG.md what is gone or changed."
PACKAGES = {name: import_module(name) for name in interface.packages()}
WRITTEN = json.loads(interface.FILE.read_text("utf-8"))


def test_the_public_names_are_those_of_the_file() -> None:
    """Without loading them; `.ci/run` compares signatures, keys, commands and all else."""
    found = {name: sorted(package.__all__) for name, package in PACKAGES.items()}
    assert found == {package: sorted(names) for package, names in WRITTEN["names"].items()}, HOW


@pytest.mark.long
def test_the_file_is_the_public_interface() -> None:
    assert interface.interface() == WRITTEN, HOW


def test_what_is_gone_or_changed_must_be_named() -> None:
    before = {"names": {"co": {"f": "(a)", "g": "(b)", "A": {"()": "(x)", "m": "(self)"}}}, "dataset": ["q", "mu"]}
    now = {"names": {"co": {"f": "(a, b)", "A": {"()": "(y)"}, "new": "()"}}, "dataset": ["q"]}
    text = "- `co.f` takes `b`; `co.A` takes y."
    assert interface.unmentioned(before, now, text) == ["/names/co/g", "/names/co/A/m", "/dataset/mu"]
    assert interface.unmentioned(before, now, "- `f`, `A`, `A.m`, `g` and mu.") == []
    assert interface.unmentioned(before, before, "") == []


def test_of_a_class_that_went_its_name_is_asked_for_alone() -> None:
    before = {"names": {"co": {"A": {"()": "(x)", "m": "(self)"}, "Ab": {"()": "()"}}}}
    assert interface.unmentioned(before, {"names": {"co": {"Ab": {"()": "()"}}}}, "") == ["/names/co/A/()"]
    assert interface.unmentioned(before, {"names": {"co": {"Ab": {"()": "()"}}}}, "- `A` is gone.") == []


@pytest.mark.parametrize(
    ("before", "now", "same"),
    [
        ("(a, *, c=(1, 2))", "(a, b=0, *, c=(1, 2), d=None)", True),
        ("(a)", "(a, *, b=1)", True),
        ("classmethod(cls, a)", "classmethod(cls, a, b=1)", True),
        ("(a)", "(a, b)", False),
        ("(a=1)", "(a=2)", False),
        ("(a=1)", "(b=0, a=1)", False),
        ("(a, b=1)", "(a)", False),
        ("(a)", "", False),
        ("(self)", "property", False),
    ],
)
def test_further_arguments_with_defaults_are_no_change(before: str, now: str, same: bool) -> None:
    assert (interface.unmentioned({"f": before}, {"f": now}, "") == []) == same


def test_names_that_still_work_with_a_warning_are_known() -> None:
    assert {"SLn", "Adjoint", "save_fmu"} <= interface.moved()
    assert not interface.moved() & set(WRITTEN["names"]["coadjoint"])


@dataclass
class Shape:
    """A class with each kind of member."""

    size: float = 1.0
    parts: list[int] = field(default_factory=list)

    @property
    def area(self) -> float:
        """Its area."""
        return self.size**2

    @classmethod
    def of(cls, size: float, how: object = sorted) -> Shape:
        """One of a size."""
        return cls(size)

    def _own(self) -> None: ...


def test_a_class_is_its_members_and_a_default_is_text_without_addresses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interface, "OWN", (Shape.__module__.partition(".")[0],))
    assert interface.described(Shape) == {
        "()": "(size=1.0, parts=a default())",
        "area": "property",
        "of": "classmethod(cls, size, how=<built-in function sorted>)",
        "parts": "field",
        "size": "field",
    }
    assert interface.shown(object()) == "<object>" and interface.shown(interface.text) == "text"


def test_the_exit_statuses_are_those_that_the_command_describes() -> None:
    described = str(import_module("coadjoint.cli.main").main.__doc__)
    assert {*re.findall(r"\b(\d+):", described)} == {*interface.STATUSES}
