"""Many runs of one file, on one machine or a cluster: `coadjoint sweep` and `co.sweep`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.lazy import lazy

if TYPE_CHECKING:
    from coadjoint.sweeps.results import SweepResults as SweepResults
    from coadjoint.sweeps.results import load_sweep as load_sweep

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
