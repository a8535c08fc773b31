"""A repeated command finds everything in the cache and loads neither JAX nor xarray."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROGRAM = """
import sys
from coadjoint.cli import start
from coadjoint.postponed import loaded
sys.argv = ["coadjoint", *sys.argv[1:]]
status = start.run()
print("loaded:", *(name for name in ("dask", "jax", "pandas", "xarray") if sys.modules.get(name) and loaded(name)))
sys.exit(status)
"""
TOP = """
[system]
model = "heavy_top"
[run]
dt = 1e-3
duration = 0.1
save_every = 10
"""
REMUS = """
[vehicle]
name = "remus_100"
[mission]
time_s = [0, 5]
depth_m = [0.5, 2.0]
heading_deg = [0, 10]
speed_m_s = 1.5
[initial]
position_m = [0, 0, 0.5]
speed_m_s = 1.5
[run]
dt = 0.05
duration = 5.0
"""


def files(folder: Path) -> dict[str, bytes]:
    """The files of a folder of results that hold no times of the clock."""
    timed = {"manifest.json", "summary.json", "report.md"}
    found = (path for path in folder.iterdir() if path.name not in timed and path.suffix not in (".nc", ".html"))
    return {path.name: path.read_bytes() for path in found}


@pytest.mark.long
@pytest.mark.parametrize("what", ["heavy top", "REMUS 100", "square", "reproduce"])
def test_a_repeated_command_loads_neither_jax_nor_xarray(what, tmp_path):
    for name, text in (("top.toml", TOP), ("remus.toml", REMUS)):
        (tmp_path / name).write_text(text)
    given = {"heavy top": ["run", tmp_path / "top.toml"], "REMUS 100": ["run", tmp_path / "remus.toml"]}
    given |= {"square": ["run", ROOT / "examples" / "square.toml"], "reproduce": ["reproduce"]}
    environment = {**os.environ, "COADJOINT_CACHE": str(tmp_path / "cache")}
    said = []
    for out in ("first", "second"):
        command = [sys.executable, "-c", PROGRAM, *map(str, given[what]), "--out", str(tmp_path / out)]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        assert done.returncode == 0, done.stderr
        said.append(done.stdout.splitlines()[-1])
    assert said == ["loaded: jax", "loaded:"]
    assert files(tmp_path / "first") == files(tmp_path / "second")
