"""Writes tests/stored/VERSION.tar.gz: small files as this version writes them, with the numbers that it reads back.

python .ci/stored.py
"""

from __future__ import annotations

import json
import os
import sys
import tarfile
import tempfile
from pathlib import Path

import numpy as np

import coadjoint as co
from coadjoint.cli.main import main

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests/simulation")]
from test_files_of_earlier_versions import READERS  # noqa: E402

TOP = """\
[system]
model = "simo_wong_top"
[initial]
euler_zyx_deg = [0, 10, 0]
angular_velocity_rpm = [0, 0, 400]
[run]
dt = 0.001
steps = 20
"""
SWEEP = """\
[sweep]
run = "top.toml"
sampling = "list"
[results]
variables = ["mu"]
[vary.parameters]
mass = { values = [4.0, 5.0, 6.0] }
"""
DIVE = """\
[vehicle]
name = "remus_100"
[mission]
depth_m = 0.1
heading_deg = 10
speed_m_s = 1.5
[initial]
speed_m_s = 1.5
[run]
dt = 0.05
duration = 1
[output]
mcap = true
figures = false
"""


def lagrangian(xi, a, p):
    return 0.5 * xi @ p.inertia @ xi - p.weight * p.center @ a


def kinetic(xi, p):
    return 0.5 * xi @ p.inertia @ xi


def motor(motion, p):
    return co.Force(motion.inputs.torque)


def write(folder: Path) -> None:
    """All files, and expected.json, in a new folder."""
    os.chdir(folder)
    p = co.Parameters(inertia=np.diag([5.0, 5.0, 1.0]), weight=20.0, center=[0.0, 0.0, 1.0])
    top = co.System(co.SO3(), lagrangian, advected=co.Defining(), parameters=p)
    start = top.state(g=co.attitude.zyx(0, 0, 0.3), xi=[0.0, 0.1, 20.0], a0=[0, 0, 1])
    co.simulate(top, start, dt=0.01, steps=20).save("run.nc")
    co.simulate(top, start, dt=0.01, steps=20, store="folder")
    body = co.System(co.SO3(), kinetic, parameters={"inertia": np.diag([1.0, 2.0, 3.0])}, forces={"motor": motor})
    stepper = co.Stepper(
        body, body.state(xi=[0.1, -0.2, 0.4]), dt=0.1, inputs={"torque": np.zeros(3)}, observe={"mu": lambda s: s.mu}
    )
    stepper.save("body.step")
    for name, text in (("top.toml", TOP), ("sweep.toml", SWEEP), ("dive.toml", DIVE)):
        Path(name).write_text(text, "utf-8")
    assert main(["sweep", "sweep.toml", "--out", "sweep"]) == 0
    assert main(["run", "dive.toml", "--out", "dive"]) == 0
    next(Path("dive").glob("*.mcap")).rename("log.mcap")
    for name in ("dive", "dive.toml", "sweep.toml"):
        _remove(Path(name))
    read = {name: reader(Path(name)) for name, reader in READERS.items()}
    found = {name: {key: np.asarray(x).tolist() for key, x in numbers.items()} for name, numbers in read.items()}
    Path("expected.json").write_text(json.dumps(found, indent=1), "utf-8")


def _remove(path: Path) -> None:
    for inner in path.iterdir() if path.is_dir() else ():
        _remove(inner)
    path.rmdir() if path.is_dir() else path.unlink()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as home:
        folder = Path(home) / co.__version__
        folder.mkdir()
        write(folder)
        os.chdir(ROOT)
        with tarfile.open(ROOT / f"tests/stored/{co.__version__}.tar.gz", "w:gz", compresslevel=9) as archive:
            archive.add(folder, co.__version__)
