"""Run files for tests."""

from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path

HERE = Path(__file__).parent

TOP = """
[system]
factory = "top.py:top"
[initial]
euler_zyx_deg = [0, 10, 0]
angular_velocity_rpm = [0, 0, 400]
a0 = [0, 0, 1]
[run]
dt = 0.001
steps = 20
"""

TOP_OF_CATALOGUE = """
[system]
model = "simo_wong_top"
[run]
dt = 0.001
steps = 20
[output]
figures = ["energy"]
"""


def write(folder: Path, text: str, name: str = "top.toml") -> Path:
    """A run file in a folder, with the user's Python file beside it."""
    shutil.copy(HERE / "top.py", folder)
    file = folder / name
    file.write_text(text)
    return file


def rewritten(path, target, of="stepper", **changes):
    """The file of a stepper or a filter with other members; of `header`, some entries."""
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    header = {**json.loads(parts[f"{of}.json"]), **changes.pop("header", {})}
    parts = {**parts, f"{of}.json": json.dumps(header).encode(), **changes}
    with zipfile.ZipFile(target, "w") as archive:
        for name, content in parts.items():
            if content is not None:
                archive.writestr(name, content)
    return target
