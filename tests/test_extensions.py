"""What packages above add to a table: found without naming them, refused where a name is taken."""

from __future__ import annotations

import importlib
import os
import pickle
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import pytest

import coadjoint
from coadjoint import earlier_names
from coadjoint.cli import main as command_line
from coadjoint.errors import ArgumentError
from coadjoint.extensions import Registry, _installed, extensions, import_string
from coadjoint.kernels.trace import library
from coadjoint.mechanics import casimirs
from coadjoint.runs import run_file

ROOT = Path(__file__).parents[1]
PROJECTS = ("pyproject.toml", "vehicles/pyproject.toml")


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


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of packages with one that names the module `package_of_somebody` in the group `coadjoint`."""
    about = tmp_path / "somebody-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: somebody\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[coadjoint]\nbells = package_of_somebody\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "package_of_somebody", raising=False)
    monkeypatch.setattr("coadjoint.extensions._installed", _installed.__wrapped__)
    return tmp_path


def test_an_installed_package_is_found_by_its_entry_point(installed: Path) -> None:
    (installed / "package_of_somebody.py").write_text('BELLS = {"small": "math:cos"}\n')
    assert extensions() == ["coadjoint_vehicles.extension", "package_of_somebody"]
    assert dict(Registry("BELLS")) == {"small": "math:cos"}


def test_an_installed_package_that_cannot_be_imported_is_one_sentence(installed: Path) -> None:
    (installed / "package_of_somebody.py").write_text("import no_such_module\n")
    with pytest.raises(
        ArgumentError, match=r"The extension package_of_somebody cannot be imported \(ModuleNotFoundErr"
    ):
        list(Registry("BELLS"))


def test_a_command_of_a_package_above_is_one_of_the_command_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    @dataclass(frozen=True)
    class Ring:
        """Rings."""

        def __call__(self) -> int:
            print("ding")
            return 0

    extension(monkeypatch, COMMANDS={"ring": "a_package_above:Ring"}, Ring=Ring)
    monkeypatch.setattr(command_line, "COMMANDS", Registry("COMMANDS"))
    assert command_line.main(["ring"]) == 0
    assert capsys.readouterr().out == "ding\n"


@pytest.mark.long
def test_the_core_runs_without_loading_the_vehicles() -> None:
    code = (
        "import sys, coadjoint as co\n"
        "entry = co.models.heavy_top\n"
        "top = entry.make(mass=1.0, center_of_mass=(0, 0, 1), inertia=(1, 1, 1), gravity=1.0, inertia_about='pivot')\n"
        "co.simulate(top, top.state(xi=[0, 0, 5], a0=[0, 0, 1]), dt=0.01, steps=2)\n"
        "assert not [name for name in sys.modules if name.startswith('coadjoint_vehicles')]\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.long
def test_the_core_alone_reproduces_the_paper(tmp_path: Path) -> None:
    """As where no other package is installed; `test_storeys` holds that nothing below the vehicles names them."""
    folder = tmp_path / "packages"
    shutil.copytree(Path(coadjoint.__file__).parent, folder / "coadjoint", ignore=shutil.ignore_patterns("__pycache__"))
    program = "import coadjoint.extensions as e, sys; e._installed = lambda: (); from coadjoint.cli.main import main; "

    def run(*words: str) -> str:
        where = {**os.environ, "PYTHONPATH": str(folder)}
        command = [sys.executable, "-c", f"{program}sys.exit(main({list(words)}))"]
        return subprocess.run(command, cwd=tmp_path, env=where, check=True, capture_output=True, text=True).stdout

    assert "Report: out/report.md" in run("reproduce", "--out", "out")
    assert "underwater_vehicle " in run("models") and "remus_100" not in run("models")
    assert "vehicles" not in run("--help")
    assert run("--version").startswith("coadjoint ")


@pytest.fixture
def no_vehicles(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where coadjoint-vehicles is not installed."""
    monkeypatch.setattr("importlib.metadata.entry_points", lambda **_: ())
    monkeypatch.setattr("coadjoint.extensions._installed", lambda: ())
    for name in [name for name in sys.modules if name.startswith(("coadjoint_vehicles", "coadjoint.vehicles"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "coadjoint_vehicles", None)
    monkeypatch.delitem(vars(coadjoint), "vehicles", raising=False)  # set where a test imported it


def test_without_the_vehicles_what_is_theirs_says_what_to_install(
    no_vehicles: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    remedy = "is of the distribution coadjoint-vehicles, which is not installed: pip install coadjoint-vehicles"
    with pytest.raises(AttributeError, match=f"^`coadjoint.vehicles` {remedy}"):
        coadjoint.vehicles  # noqa: B018
    with pytest.raises(ModuleNotFoundError, match=f"^The module coadjoint.vehicles {remedy}"):
        importlib.import_module("coadjoint.vehicles.parts")
    (tmp_path / "dive.toml").write_text('[vehicle]\nname = "remus_100"\n')
    monkeypatch.setattr(run_file, "KINDS", Registry("RUN_FILES"))
    monkeypatch.setattr(command_line, "COMMANDS", Registry("COMMANDS"))
    with pytest.raises(ArgumentError, match=remedy):
        run_file.read(tmp_path / "dive.toml")
    assert command_line.main(["vehicles"]) == 2
    assert f"The command `vehicles` {remedy}" in capsys.readouterr().err


def test_modules_of_earlier_versions_are_those_of_today() -> None:
    """Pickles name the modules of their classes."""
    earlier = importlib.import_module("coadjoint.vehicles.water.water")
    today = importlib.import_module("coadjoint_vehicles.water.water")
    assert earlier is today and today.__spec__ is not None and today.__spec__.name == "coadjoint_vehicles.water.water"
    stored = pickle.dumps(today.UniformWater((0.1, 0.0, 0.0)), protocol=0)
    stored = stored.replace(b"coadjoint_vehicles", b"coadjoint.vehicles")
    assert isinstance(pickle.loads(stored), today.UniformWater)


@pytest.mark.parametrize("name", [one for one in earlier_names.NAMES if one != "coadjoint.vehicles"])
def test_a_module_of_an_earlier_name_is_found_and_leaves_the_public_names_of_its_package(name: str) -> None:
    if name.endswith("slave"):
        pytest.importorskip("pythonfmu")
    parent, _, word = name.rpartition(".")
    package = importlib.import_module(parent)
    public = getattr(package, word, None)
    assert importlib.import_module(name) is importlib.import_module(earlier_names.NAMES[name])
    assert getattr(package, word, None) is public or public is None


def test_classes_of_earlier_names_are_those_of_today() -> None:
    pytest.importorskip("pythonfmu")
    from coadjoint.simulation.steppers.fmi_instance import FmiInstance

    assert importlib.import_module("coadjoint.simulation.steppers.slave").StepperSlave is FmiInstance
    casimir = next(iter(casimirs(coadjoint.System(coadjoint.SO3(), lambda xi: 0.5 * xi @ xi)).values()))
    stored = pickle.dumps(casimir, protocol=0).replace(b"casimir_functions", b"casimirs")
    assert type(pickle.loads(stored)) is type(casimir)
    assert coadjoint.mechanics.casimirs is casimirs


def test_files_of_the_vehicles_belong_to_the_identity_of_the_library() -> None:
    assert list(library.homes()) == ["coadjoint", "coadjoint_vehicles"]
    files = {Path(path).name for path in library._paths()}
    assert {"midpoint.py", "craft.py", "remus_100.toml"} <= files


def test_vehicles_have_the_version_of_the_library_and_need_it() -> None:
    root, above = (tomllib.loads((ROOT / name).read_text("utf-8"))["project"] for name in PROJECTS)
    assert above["version"] == root["version"] == coadjoint.__version__
    assert above["dependencies"] == [f"coadjoint=={root['version']}"]
    assert above["requires-python"] == root["requires-python"]
