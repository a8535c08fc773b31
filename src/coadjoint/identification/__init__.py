"""Parameters of a system from a logged trajectory.

    log = identification.read_log("zigzag.csv")
    found = identification.identify(vehicle, log, start=start, parameters=["damping", "added_mass"])
    print(found)

`read_log` and `write_log` for CSV files, `Log` for what they hold, `identify` for the estimates with their intervals.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

_HOME_OF = {
    "Estimate": "findings",
    "Identification": "findings",
    "Log": "log",
    "identify": "estimation",
    "read_log": "csv_files",
    "seen": "channels",
    "synthetic_log": "synthetic",
    "write_log": "csv_files",
}

__all__ = [*_HOME_OF]  # pyright: ignore[reportUnsupportedDunderAll]

if TYPE_CHECKING:
    from coadjoint.identification.channels import seen as seen
    from coadjoint.identification.csv_files import read_log as read_log
    from coadjoint.identification.csv_files import write_log as write_log
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
