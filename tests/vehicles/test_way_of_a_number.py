"""From the file to the force: which files a fin's area passes through, and its one name."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np

import coadjoint_vehicles
from coadjoint.spaces.named import Named
from coadjoint_vehicles.files.file import vehicle_from_text
from coadjoint_vehicles.files.registry import vehicle_text
from coadjoint_vehicles.model.craft import Craft

AREA = 0.013312345
VEHICLES = Path(str(coadjoint_vehicles.__file__)).parent
PASSED_ON = "made"
"""The constructor of vehicles that passes its arguments on."""
PAGE = Path(__file__).parents[2] / "CONTRIBUTING.md"


def holds(value: Any) -> bool:
    """Whether this is the area, alone or among other numbers."""
    if isinstance(value, Named):
        return holds(getattr(value, "_values", None))
    if isinstance(value, dict):
        return any(map(holds, value.values()))
    if isinstance(value, (list, tuple)):
        return any(map(holds, value))
    return isinstance(value, (float, np.ndarray)) and np.ndim(value) == 0 and float(value) == AREA


def test_a_number_goes_from_the_file_to_the_force_through_eight_files_that_the_page_names() -> None:
    passed = set()

    def look(frame: Any, event: str, given: Any) -> None:
        for here in (frame, frame.f_back):  # what calls others holds numbers for a moment only
            file = here.f_code.co_filename if here is not None else ""
            if here is not None and here.f_code.co_name == PASSED_ON:
                continue
            if file.startswith(str(VEHICLES)) and any(map(holds, [given, *here.f_locals.values()])):
                passed.add(Path(file).relative_to(VEHICLES).as_posix())

    sys.setprofile(look)
    try:
        craft = Craft(vehicle_from_text(vehicle_text("remus_100").replace("0.0133", repr(AREA)), "remus_100.toml"))
    finally:
        sys.setprofile(None)
    assert float(craft.parameters.rudder.area) == AREA
    given = PAGE.read_text(encoding="utf-8").split("### The way of a number")[1].split("###")[0]
    named = re.findall(r"^\d\. `coadjoint_vehicles/(\S+)`", given, re.M)
    assert len(named) <= 8
    assert {"files/data/remus_100.toml", "parts/fin.py", *passed} == set(named)
