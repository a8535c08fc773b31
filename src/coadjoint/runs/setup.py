"""What a run file leads to: a system with its start, and what drives and ends its run."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from coadjoint.mechanics.state import State
    from coadjoint.mechanics.system import System


@dataclass(frozen=True)
class Setup:
    """A system, its start, the inputs and the event of its run; `told` goes into the attributes of the dataset.

    warnings: what is doubtful about what the file states, one sentence each.
    """

    system: System
    start: State
    inputs: Any = None
    until: Any = None
    told: dict[str, Any] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
