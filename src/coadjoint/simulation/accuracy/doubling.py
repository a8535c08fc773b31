"""The local error of single steps of a run, from its records."""

from __future__ import annotations

import jax
import numpy as np

from coadjoint.kernels.run.probe import Probe
from coadjoint.mechanics.state import State
from coadjoint.methods.program import INPUTS_HELD, Constants
from coadjoint.simulation.accuracy.parts import PartsOfSteps
from coadjoint.simulation.accuracy.ruler import course_of, numbered, ruler_of
from coadjoint.simulation.plan import Plan


class Doubling(PartsOfSteps):
    """Judges steps of a plan from records, whose inputs are held over a step."""

    probe: Probe

    def __init__(self, plan: Plan, state: State):
        self.plan, constants = plan, plan.constants
        if constants.renewal is not None:
            constants = Constants(constants.system, constants.monitors, INPUTS_HELD)
        probe = Probe(plan.backend, plan.program, constants, state, plan.watches, plan.axes, plan.members or 1)
        method, system = plan.program.method, plan.program.skeleton
        self.places = numbered(probe.layout)
        memory = jax.tree.leaves(self.places.memory) if method.variable else []
        numbers = [int(i) for leaf in memory for i in np.ravel(leaf)]
        course = course_of(probe.layout, system.internal)
        super().__init__(probe, ruler_of(probe.layout, state.places), course, method.order, numbers)
