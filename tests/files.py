"""Run files for tests."""

from __future__ import annotations

import shutil
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
