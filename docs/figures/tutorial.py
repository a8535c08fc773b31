"""The figure of the tutorial, which its own blocks draw.

Run as: python docs/figures/tutorial.py; it writes docs/figures/leaf.png
"""

import os
import re
import shutil
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
here = Path(__file__).parent
text = (here.parent / "tutorial.md").read_text(encoding="utf-8")
with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    namespace: dict[str, object] = {}
    for block in re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        exec(block, namespace)
    shutil.copyfile("leaf.png", here / "leaf.png")
    os.chdir(here)
