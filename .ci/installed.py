"""Tries an installation from the wheels alone: the paper, a mission, files of earlier versions, a package above.

python .ci/installed.py FOLDER          in an environment with coadjoint, coadjoint-vehicles and tests/plugin
"""

from __future__ import annotations

import json
import os
import sys
import tarfile
from pathlib import Path

import numpy as np

import coadjoint as co
from coadjoint.cli.main import main

ROOT = Path(__file__).resolve().parents[1]


def command(*words: object) -> None:
    """Run a command of `coadjoint`, which must succeed."""
    print("coadjoint", *words, flush=True)
    if (status := main([str(word) for word in words])) != 0:
        sys.exit(f"exit status {status}")


def earlier(archive: Path, folder: Path) -> None:
    """Read the files that a version wrote, and compare some numbers with those that it read."""
    with tarfile.open(archive) as packed:
        packed.extractall(folder, filter="data")
    found = folder / archive.name.removesuffix(".tar.gz")
    expected = json.loads((found / "expected.json").read_text("utf-8"))
    for name in ("run.nc", "folder"):
        np.testing.assert_allclose(co.load(found / name).dataset.mu[-1], expected[name]["mu"], rtol=1e-12)
        command("verify" if name == "folder" else "info", found / name)
    np.testing.assert_allclose(
        co.sweeps.load_sweep(found / "sweep").dataset.final_mu, expected["sweep"]["mu"], rtol=1e-12
    )
    stepped = co.load_stepper(found / "body.step").step({"torque": [0.1, 0.2, 0.3]}, n=10)
    np.testing.assert_allclose(stepped["mu"], expected["body.step"]["mu"], rtol=1e-12)


def plugin() -> None:
    """The model and the method of tests/plugin by a run file, its sensor in a vehicle, and its log."""
    Path("float.toml").write_text(
        '[system]\nmodel = "swinging_float"\n[method]\nname = "Ends"\n[run]\ndt = 0.05\nduration = 2\n', "utf-8"
    )
    command("run", "float.toml", "--out", "float")
    text = co.vehicles.files.vehicle_to_toml(co.vehicles.load("ellipsoid"))
    Path("warm.toml").write_text(
        f'{text}\n[sensors.water]\nkind = "thermometer"\nrate = {{ value = 1, unit = "Hz" }}\n', "utf-8"
    )
    assert [one.kind for one in co.vehicles.read("warm.toml").sensors] == ["thermometer"]
    Path("dive.drift").write_text("drift 1\n0 1.0\n1 2.0\n", "utf-8")
    assert co.vehicles.logs.read_log("dive.drift").columns["depth"].tolist() == [1.0, 2.0]


def all_of(folder: Path) -> None:
    """All of it, in a folder."""
    for module in (co, co.vehicles):
        assert Path(str(module.__file__)).is_relative_to(sys.prefix), f"{module.__file__} is not that of the wheel"
    folder.mkdir()
    os.chdir(folder)
    command("reproduce", "--out", "reproduction")
    command("run", ROOT / "examples/square.toml", "--out", "square")
    for archive in sorted((ROOT / "tests/stored").glob("*.tar.gz")):
        earlier(archive, folder)
    plugin()


if __name__ == "__main__":
    all_of(Path(sys.argv[1]).resolve())
