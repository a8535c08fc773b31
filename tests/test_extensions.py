"""What packages above add to a room: found without naming them, refused where a name is taken."""

from __future__ import annotations

import subprocess
import sys
from types import ModuleType

import pytest

import coadjoint
from coadjoint.errors import ArgumentError
from coadjoint.extensions import Registry, import_string


def extension(monkeypatch: pytest.MonkeyPatch, **tables: object) -> None:
    """A module of that name, with these tables, added for one test."""
    made = ModuleType("a_package_above")
    made.__dict__.update(tables)
    monkeypatch.setitem(sys.modules, "a_package_above", made)
    monkeypatch.setattr(coadjoint, "EXTENSIONS", [*coadjoint.EXTENSIONS, "a_package_above"])


def test_a_registry_has_its_own_entries_and_then_those_of_extensions(monkeypatch: pytest.MonkeyPatch) -> None:
    extension(monkeypatch, BELLS={"small": "math:cos"})
    bells: Registry[str] = Registry("BELLS", {"large": "math:sin"})
    assert list(bells) == ["large", "small"]
    assert import_string(bells["small"])(0.0) == 1.0


def test_a_name_that_is_taken_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    extension(monkeypatch, BELLS={"large": "math:cos"})
    with pytest.raises(ArgumentError, match="a_package_above adds `large` to BELLS"):
        list(Registry("BELLS", {"large": "math:sin"}))


@pytest.mark.long
def test_the_core_runs_without_loading_the_vehicles() -> None:
    code = (
        "import sys, coadjoint as co\n"
        "entry = co.models.heavy_top\n"
        "top = entry.make(mass=1.0, center_of_mass=(0, 0, 1), inertia=(1, 1, 1), gravity=1.0, inertia_about='pivot')\n"
        "co.simulate(top, top.state(xi=[0, 0, 5], a0=[0, 0, 1]), dt=0.01, steps=2)\n"
        "assert not [name for name in sys.modules if name.startswith('coadjoint.vehicles')]\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
