"""A run's fingerprint: what must be the same for a continued run to be the same run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from coadjoint.kernels.program import FLOOR, MAX_ITERATIONS, STALLED, TOLERANCE
from coadjoint.kernels.run import disk_cache, plans
from coadjoint.kernels.trace.digest import digest
from coadjoint.kernels.trace.jaxprs import jaxpr_of
from coadjoint.mechanics.state import State
from coadjoint.mechanics.traced_once import Traced, tracing_once
from coadjoint.methods.program import Constants
from coadjoint.simulation.plan import Plan

TRACING = "2"
"""How equations are traced for a fingerprint: those of other numbers cannot be compared."""


def fingerprint(
    plan: Plan, state: State, one: tuple[Constants, State] | None = None, known: Traced | None = None
) -> dict[str, str]:
    """Digests of the equations as they are traced, of the numbers in them, and of the grid.

    Equal in every process with the same versions of Python's packages; names of functions do not count. `one` member
    of an ensemble is what its equations are traced for; known: what was traced of them for the kernel.
    """
    constants, start = (plan.constants, state) if one is None else one
    name = plans.name(plan.program, constants, start, "fingerprint", plan.watches, plan.constants.monitors)
    traced = disk_cache.find(name)
    if traced is None:
        with tracing_once(known):
            traced = _traced(plan, constants, start)
        disk_cache.keep(name, traced)
    directions = [event.direction for _, event in plan.events]
    return {
        "tracing": TRACING,
        "equations": traced["equations"],
        "parameters": digest(named(plan.constants.system)),
        "start": digest(jax.tree.leaves(state)),
        "monitors": traced["monitors"],
        "grid": digest(plan.h, plan.steps, plan.save_every, plan.monitors, plan.backend, directions),
    }


def _traced(plan: Plan, constants: Constants, state: State) -> dict[str, str]:
    """The digests of the equations, and of the monitors with what they observe with."""
    program, h, whole = plan.program, np.float64(plan.h), np.float64(1.0)
    different = {stage.step: stage for stage in program.stages}
    functions: list[tuple[Callable, tuple]] = [(program.prepare, (constants, state, h))]
    for stage in different.values():
        z = np.zeros(sum(stage.blocks))
        functions += [
            (stage.guess, (constants, state, h)),
            (stage.residual, (constants, state, h, z)),
            (stage.chart, (constants, state, h, z)),
            (stage.advance, (constants, state, h, z, whole)),
        ]
    certificates = [
        (stage.certificate, (constants, state, h, np.zeros(sum(stage.blocks)), state)) for stage in different.values()
    ]
    observed = [(program.monitors, (constants, state, h)), *certificates] if plan.watches else []
    order = {step: i for i, step in enumerate(different)}
    parts = [(order[stage.step], stage.fraction, stage.blocks, stage.tolerant) for stage in program.stages]
    stages = [program.substeps, *parts]
    newton = (TOLERANCE, FLOOR, STALLED, MAX_ITERATIONS)
    return {
        "equations": digest(newton, stages, *(jaxpr_of(function, *given)[0] for function, given in functions)),
        "monitors": digest(
            named(plan.constants.monitors), *(jaxpr_of(function, *given)[0] for function, given in observed)
        ),
    }


def named(tree: Any) -> list[Any]:
    """The leaves of a PyTree with their names."""
    return [[jax.tree_util.keystr(path), leaf] for path, leaf in jax.tree_util.tree_leaves_with_path(tree)]
