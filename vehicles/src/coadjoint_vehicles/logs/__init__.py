"""Logs of vehicles: a run in the words of engineers, as CSV and as messages of ROS."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.logs.bags.reading import read_bag as read_bag
    from coadjoint_vehicles.logs.bags.writing import write_mcap as write_mcap
    from coadjoint_vehicles.logs.inputs import inputs_from_csv as inputs_from_csv
    from coadjoint_vehicles.logs.measured import read_log as read_log
    from coadjoint_vehicles.logs.measured import write_log as write_log

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
