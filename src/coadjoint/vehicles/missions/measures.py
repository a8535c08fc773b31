"""What parameters of a vehicle and fields of its pilot measure, by which the unit at the end of a key is checked."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from coadjoint.runs.run_file import MEASURES as OF_BODY
from coadjoint.units import Dimension
from coadjoint.vehicles.missions.water import KINDS as OF_WATER


def measures(names: Iterable[str], vehicle: Any) -> dict[str, Dimension | None]:
    """What each parameter measures, by name: the body's, `<part>_<field>`, `water_<field>`, `pilot_<field>`."""
    from coadjoint.vehicles.files.kinds import PARTS, kind_of

    found = {**OF_BODY, **{f"water_{name}": what for name, what in OF_WATER.items()}}
    for part in vehicle.parts:
        _, fields = PARTS.get(kind_of(part), ("", {}))
        found |= {f"{part.name}_{key}": field.dimension for key, field in fields.items()}
    found |= {f"pilot_{name}": what for name, what in pilot_measures().items()}
    return {name: found.get(name) for name in names}


def pilot_measures(names: Iterable[str] = ()) -> dict[str, Dimension | None]:
    """What fields of pilots measure; of `names` that are gains and the like that no unit does."""
    from coadjoint.vehicles.files.kinds import PILOT_FIELDS

    return {**dict.fromkeys(names), **PILOT_FIELDS}
