"""REMUS 100 with changes, for tests of vehicles."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import coadjoint_vehicles as vehicles
from coadjoint_vehicles import Vehicle


def remus(**changes: Any) -> Vehicle:
    return replace(vehicles.load("remus_100"), **changes)
