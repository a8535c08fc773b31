"""Sea trials: the figures of merit of standard manoeuvres, from runs and from measured tracks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.trials.analysis import TrialResult as TrialResult
    from coadjoint_vehicles.trials.analysis import analyse as analyse
    from coadjoint_vehicles.trials.nomoto import nomoto as nomoto
    from coadjoint_vehicles.trials.track import Track as Track

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
