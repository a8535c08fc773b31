"""Parameters of a system from a logged trajectory.

    log = co.vehicles.logs.read_log("zigzag.csv")
    found = co.identification.identify(vehicle, log, start=start, parameters=["damping", "added_mass"])
    print(found)

`Log` for measurements, `identify` for estimates with their intervals; `co.vehicles.logs` reads CSV files.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.lazy import lazy

if TYPE_CHECKING:
    from coadjoint.identification.channels import seen as seen
    from coadjoint.identification.estimation import identify as identify
    from coadjoint.identification.log import Log as Log
    from coadjoint.identification.log import merged as merged
    from coadjoint.identification.result import Identification as Identification
    from coadjoint.identification.synthetic import synthetic_log as synthetic_log
    from coadjoint.identification.unknowns import Estimate as Estimate

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
