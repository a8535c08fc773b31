from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.lazy import lazy

if TYPE_CHECKING:
    from coadjoint.simulation.run import Ensemble as Ensemble
    from coadjoint.simulation.run import Run as Run
    from coadjoint.simulation.steppers.fmu import save_fmu as save_fmu
    from coadjoint.simulation.steppers.stepper import Stepper as Stepper

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
