"""Kalman filters on the group: errors that are invariant under it, with steps of the model between measurements.

process = co.estimation.ModelProcess(system, start, noise={"torque": 0.1, "force": 0.5})
filter = co.estimation.Filter(process, start, measurements={"depth": depth}, deviations={"g": 0.1, "q": 1.0})
found = filter.run({"depth": (times, values)}, dt=0.1)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.lazy import lazy

if TYPE_CHECKING:
    from coadjoint.estimation.drifts import Drift as Drift
    from coadjoint.estimation.drifts import GaussMarkov as GaussMarkov
    from coadjoint.estimation.drifts import RandomWalk as RandomWalk
    from coadjoint.estimation.filter import Filter as Filter
    from coadjoint.estimation.filtered import Consistency as Consistency
    from coadjoint.estimation.filtered import Filtered as Filtered
    from coadjoint.estimation.inertial_state import InertialState as InertialState
    from coadjoint.estimation.innovation import Innovation as Innovation
    from coadjoint.estimation.measurements import Measurement as Measurement
    from coadjoint.estimation.model import ModelProcess as ModelProcess
    from coadjoint.estimation.process import Process as Process
    from coadjoint.estimation.saved_filter import SavedFilter as SavedFilter
    from coadjoint.estimation.saved_filter import load_filter as load_filter
    from coadjoint.estimation.smoother import smoothed as smoothed
    from coadjoint.estimation.strapdown import StrapdownProcess as StrapdownProcess

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
