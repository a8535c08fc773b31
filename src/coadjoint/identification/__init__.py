"""Parameters of a system from a logged trajectory.

    log = co.vehicles.logs.read_log("zigzag.csv")
    found = co.identification.identify(vehicle, log, start=start, parameters=["damping", "added_mass"])
    print(found)

`Log` for what was measured, `identify` for the estimates with their intervals; `co.vehicles.logs` reads CSV files.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

_HOME_OF = {
    "Estimate": "findings",
    "Identification": "findings",
    "Log": "log",
    "identify": "estimation",
    "seen": "channels",
    "synthetic_log": "synthetic",
}

__all__ = [*_HOME_OF]  # pyright: ignore[reportUnsupportedDunderAll]

if TYPE_CHECKING:
    from coadjoint.identification.channels import seen as seen
    from coadjoint.identification.estimation import identify as identify
    from coadjoint.identification.findings import Estimate as Estimate
    from coadjoint.identification.findings import Identification as Identification
    from coadjoint.identification.log import Log as Log
    from coadjoint.identification.synthetic import synthetic_log as synthetic_log


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"coadjoint.identification has no `{name}`; it has: {', '.join(sorted(_HOME_OF))}.")
    value = getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
    globals()[name] = value
    return value
