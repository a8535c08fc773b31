"""The package in `tests/plugin` adds a model, a method, a sensor and a log format, by its tables alone."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipk

import coadjoint
from coadjoint.errors import ArgumentError, FileError
from coadjoint.extensions import Registry
from coadjoint.models import catalogue
from coadjoint.runs import methods, run_file
from coadjoint_vehicles.files.file import vehicle_from_text
from coadjoint_vehicles.files.kinds import ADDED, kinds
from coadjoint_vehicles.files.registry import load_vehicle
from coadjoint_vehicles.files.writing import vehicle_to_toml
from coadjoint_vehicles.logs.measured import LOG_FORMATS, read_log
from test_extending import outside

HERE = Path(__file__).parent / "plugin" / "src"
REGISTRIES: tuple[Registry, ...] = (catalogue, methods.METHODS, LOG_FORMATS, *ADDED.values())


def _forget() -> None:
    for registry in REGISTRIES:
        vars(registry).pop("_entries", None)


@pytest.fixture(autouse=True)
def plugin(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The package as if it were installed: its module is named, and tables are read again."""
    monkeypatch.syspath_prepend(str(HERE))
    monkeypatch.setattr(coadjoint, "EXTENSIONS", [*coadjoint.EXTENSIONS, "drifters.extension"])
    _forget()
    yield
    _forget()


def test_a_run_file_names_a_model_and_a_method_of_the_package(tmp_path: Path) -> None:
    """A pendulum: after a period of the exact solution it is where it began, to the order of the method."""
    file = tmp_path / "float.toml"
    file.write_text('[system]\nmodel = "swinging_float"\n[method]\nname = "ends"\n[run]\ndt = 0.05\nsteps = 40\n')
    read = run_file.read(file)
    setup, method = read.set_up(), methods.method(read.method)
    assert type(method).__name__ == "Ends"
    period = 4 * ellipk(np.sin(0.1) ** 2) * np.sqrt(2.0 / 5.0)
    run = coadjoint.simulate(setup.system, setup.start, dt=period / 40, steps=40, method=method)
    np.testing.assert_allclose(run.final.a, setup.start.a, atol=0.003)
    assert run.relative_change("kelvin_noether") < 1e-12


def test_a_vehicle_file_has_a_sensor_of_the_package() -> None:
    text = vehicle_to_toml(load_vehicle("ellipsoid"))
    vehicle = vehicle_from_text(f'{text}\n[sensors.water]\nkind = "thermometer"\nrate = {{ value = 1, unit = "Hz" }}\n')
    assert [type(sensor).__name__ for sensor in vehicle.sensors] == ["Thermometer"]
    assert 'kind = "thermometer"' in vehicle_to_toml(vehicle)


def test_a_log_is_read_by_the_reader_of_the_package(tmp_path: Path) -> None:
    log = tmp_path / "dive.drift"
    log.write_text("drift 1\n0 1.0\n1 2.0\n")
    np.testing.assert_array_equal(read_log(log, density=512.5).columns["depth"], [2.0, 4.0])
    with pytest.raises(ArgumentError, match=r"^The reader of \.drift has no option `topics`: leave it out\.$"):
        read_log(log, topics=["a"])
    with pytest.raises(FileError, match=r"^There is no log "):
        read_log(tmp_path / "absent.drift")


def test_a_kind_that_is_taken_or_named_otherwise_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ADDED, "sensors", Registry("NONE", {"dvl": "drifters.sensor:Thermometer"}))
    with pytest.raises(ArgumentError, match="as the kind 'dvl', which exists already"):
        kinds("sensors")
    monkeypatch.setitem(ADDED, "sensors", Registry("NONE", {"heat": "drifters.sensor:Thermometer"}))
    with pytest.raises(ArgumentError, match="as the kind 'heat', which is 'thermometer' in the class"):
        kinds("sensors")


def test_the_package_imports_public_names_and_the_extension_api_alone() -> None:
    for path in HERE.rglob("*.py"):
        tree = ast.parse(path.read_text("utf-8"))
        assert not outside(tree, "drifters"), path
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("coadjoint_vehicles"):
                listed = import_module(str(node.module)).__all__ if str(node.module).count(".") < 2 else ()
                assert {alias.name for alias in node.names} <= set(listed), f"{path}: {node.module}"
