"""What the line `accuracy` of the card costs: whole calls of co.simulate with it and without it."""

from __future__ import annotations

from functools import partial
from typing import Any

import coadjoint as co
from benchmarks.clock import Contender, interleaved, table_of
from coadjoint.models import catalogue
from coadjoint.models.paper_tables import PAPER_STEP, paper_start, paper_vehicle

STEPS = 10_000
WITHOUT, WITH = "accuracy=False", "accuracy=True"


def measure(quick: bool) -> dict[str, Any]:
    """Processor time of 10⁴ steps with set-up, code cached, by turns with the line and without."""
    import coadjoint_vehicles as vehicles
    from benchmarks.stepping import COMMANDS, DT
    from coadjoint_vehicles import Craft

    vehicle, top = paper_vehicle(), catalogue["heavy_top"].make()
    craft = Craft(vehicles.load("remus_100"))
    sailing = craft.start(speed=1.5, actuators={"propeller": 15.0})
    cases = {
        "the paper's vehicle": partial(
            co.simulate, vehicle, paper_start(vehicle), dt=PAPER_STEP, method=co.LeftRectangle()
        ),
        "heavy top": partial(co.simulate, top, catalogue["heavy_top"].start(top), dt=0.001),
        "REMUS 100": partial(co.simulate, craft.system, sailing, dt=DT, inputs=COMMANDS),
    }
    return {name: _beside(run, 5 if quick else 15) for name, run in cases.items()}


def _beside(run: Any, repetitions: int) -> dict[str, dict[str, float]]:
    given = {"steps": STEPS, "progress": False}
    contenders = {
        WITHOUT: Contender(lambda: run(**given, accuracy=False)),
        WITH: Contender(lambda: run(**given, accuracy=True)),
    }
    return table_of(interleaved(contenders, repetitions), WITHOUT)
