"""Bags: logs as robots record them, messages of ROS in MCAP files and others, read and written."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from coadjoint_vehicles.axes import Axes
    from coadjoint_vehicles.logs.bags.bag import Bag, TopicLog


class BagFormat(NamedTuple):
    """A format of files: the module and the function that reads it, and the axes of its messages where none are given.

    The function is called by (path, wanted, partial): the file, whether the messages of a (topic, type) are wanted, and
    whether the complete part of a file that was not closed is read. It raises FileError for a file that is damaged.
    """

    module: str
    function: str
    axes: Axes = "ENU/FLU"

    def read(self, path: Path, wanted: Callable[[str, str], bool], partial: bool) -> Bag | TopicLog:
        """The contents of a file of this format."""
        return getattr(import_module(self.module), self.function)(path, wanted, partial)


BAG_FORMATS = {
    ".mcap": BagFormat("coadjoint_vehicles.logs.bags.mcap_file", "read_mcap"),
    ".db3": BagFormat("coadjoint_vehicles.logs.bags.sqlite_file", "read_sqlite"),
    ".bag": BagFormat("coadjoint_vehicles.logs.bags.ros1_file", "read_ros1"),
    ".bin": BagFormat("coadjoint_vehicles.logs.bags.dataflash_file", "read_dataflash", "NED/FRD"),
    ".tlog": BagFormat("coadjoint_vehicles.logs.bags.tlog_file", "read_tlog", "NED/FRD"),
}
"""By the suffixes of the files that robots record."""
