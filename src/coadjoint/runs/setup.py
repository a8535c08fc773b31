"""The set-up of a run file: a system with its start, and the inputs and events of its run."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from coadjoint.arrays import PyTree
from coadjoint.texts import Table

if TYPE_CHECKING:
    from coadjoint.mechanics.state import State
    from coadjoint.mechanics.system import System


@dataclass(frozen=True)
class Setup:
    """A system, its start, the inputs and the event of its run; `attributes` go into the dataset.

    warnings: doubtful settings of the file, one sentence each.
    """

    system: System
    start: State
    inputs: PyTree = None
    until: Any = None
    attributes: Table = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
