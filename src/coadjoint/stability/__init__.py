"""Steady motions of any system, and whether they are stable.

motion = co.stability.steady_motion(system, guess)
print(co.stability.stability(motion))
"""

from coadjoint.stability.analysis import Stability, stability
from coadjoint.stability.multipliers import StepModes, step_modes
from coadjoint.stability.reduced import Reduced
from coadjoint.stability.second_variation import EnergyCasimir, energy_casimir
from coadjoint.stability.spectrum import Linearisation, Mode, linearised
from coadjoint.stability.steady import Search, SteadyMotion, steady_motion

__all__ = [
    "EnergyCasimir",
    "Linearisation",
    "Mode",
    "Reduced",
    "Search",
    "Stability",
    "SteadyMotion",
    "StepModes",
    "energy_casimir",
    "linearised",
    "stability",
    "steady_motion",
    "step_modes",
]
