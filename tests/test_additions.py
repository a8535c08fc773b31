"""What it takes to add a method, a monitor and a command: one short file, one place, and a file with a line."""

from __future__ import annotations

import ast
import importlib
import inspect
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any

import numpy as np
import pytest
import tyro

import coadjoint as co
from coadjoint.cli import main as command_line
from coadjoint.errors import GroupError
from coadjoint.methods import left_rectangle, midpoint
from coadjoint.simulation import monitors
from coadjoint.simulation.monitors import Watched, monitor
from imports import files

SYSTEM = co.System(co.SO3(), lambda xi: 0.5 * xi @ (np.array([1.0, 2.0, 3.0]) * xi))
START = SYSTEM.state(xi=[0.3, 1.0, -0.2])


@pytest.mark.cases(1)
@pytest.mark.parametrize("home, name", [(left_rectangle, "LeftRectangle"), (midpoint, "Midpoint")])
def test_a_method_is_one_file_of_at_most_80_lines(home: Any, name: str) -> None:
    text = inspect.getsource(home)
    assert len(text.splitlines()) <= 80
    own: dict[str, Any] = {"__name__": "own_method"}
    exec(compile(text.replace(name, "Own"), "own_method.py", "exec", dont_inherit=True), own)
    runs = [co.simulate(SYSTEM, START, dt=0.1, steps=5, method=kind()) for kind in (own["Own"], getattr(co, name))]
    assert runs[0].method.title.startswith("Own(")
    np.testing.assert_array_equal(runs[0].records.mu, runs[1].records.mu)


def test_a_monitor_is_one_function_that_says_what_cards_and_datasets_show_of_it(monkeypatch) -> None:
    @monitor(Watched("spin", "|ξ|²", "rad²/s²", line="change", title="spin"), when=lambda system, method, state: True)
    def spin(system, step, record, h, constants):
        return {"spin": record.xi @ record.xi}

    assert "spin" not in co.simulate(SYSTEM, START, dt=0.1, steps=5).dataset
    monkeypatch.setattr(monitors, "AFTER", (*monitors.AFTER, spin))
    run = co.simulate(SYSTEM, START, dt=0.1, steps=5)
    shown = run.dataset["spin"]
    np.testing.assert_allclose(shown, np.sum(np.square(run.records.xi), axis=1), rtol=1e-15)
    assert (shown.attrs["units"], shown.attrs["long_name"]) == ("rad²/s²", "|ξ|²")
    assert any(
        line.startswith("spin ") and "largest relative change" in line for line in run.certificate.long().splitlines()
    )


@dataclass(frozen=True)
class Greet:
    """Says hello."""

    name: str = "world"
    """Whom."""

    def __call__(self) -> int:
        print(f"Hello, {self.name}.")
        return 0


def test_a_command_is_its_own_file_and_a_line_of_the_command_line(monkeypatch, capsys) -> None:
    known = command_line.Command | Annotated[Greet, tyro.conf.subcommand("greet")]
    monkeypatch.setattr(command_line, "Command", known)
    assert command_line.main(["greet", "--name", "sea"]) == 0
    assert capsys.readouterr().out == "Hello, sea.\n"
    lines = [line for line in Path(inspect.getfile(command_line)).read_text().splitlines() if "Compare" in line]
    assert len(lines) == 2  # its import and its place in `Command`


def left_out() -> list[tuple[str, str, str, int]]:
    """Module, class and name of each member that a class must give, and how many arguments it takes."""
    return [
        ("coadjoint." + name.removesuffix(".py").replace("/", "."), owner.name, member.name, len(member.args.args) - 1)
        for name, path in files().items()
        if not name.startswith("vehicles/") and "must_give(self" in (text := path.read_text(encoding="utf-8"))
        for owner in ast.parse(text).body
        if isinstance(owner, ast.ClassDef)
        for member in owner.body
        if isinstance(member, ast.FunctionDef) and "must_give" in ast.dump(member.body[-1])
    ]


def test_a_member_that_a_class_leaves_out_is_named():
    found = left_out()
    assert len(found) == 37, "as many members have no definition of their own"
    for module, owner, name, count in found:
        member = inspect.getattr_static(getattr(importlib.import_module(module), owner), name)
        function = getattr(member, "fget", getattr(member, "func", member))
        with pytest.raises(GroupError, match=f"^SimpleNamespace must give `{name}`"):
            function(SimpleNamespace(), *[None] * count)
