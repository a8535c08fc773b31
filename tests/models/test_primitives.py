"""Every model of the catalogue speaks the tracer's language, by the rules that fit it."""

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.run import native
from coadjoint.kernels.trace.control import CONTROL
from coadjoint.kernels.trace.jaxprs import jaxpr_of
from coadjoint.kernels.trace.numeric import NUMERIC
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.models import catalogue

RULES = [co.LeftRectangle, co.RightRectangle, co.Midpoint, co.Trapezoidal]


def primitives(jaxpr) -> set[str]:
    """The names of all primitives in a jaxpr and in the jaxprs that it holds."""
    found = set()
    for equation in jaxpr.eqns:
        found.add(equation.primitive.name)
        for value in jax.tree.leaves(equation.params, is_leaf=lambda v: hasattr(v, "eqns") or hasattr(v, "jaxpr")):
            inner = getattr(value, "jaxpr", value)
            if hasattr(inner, "eqns"):
                found |= primitives(inner)
    return found


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", list(catalogue))
def test_a_step_of_a_model_uses_known_primitives_only_and_compiles(name):
    entry = catalogue[name]
    system = entry.make()
    fits_every_rule = entry.method == "Midpoint"
    rule = RULES[list(catalogue).index(name) % len(RULES)] if fits_every_rule else getattr(co, entry.method)
    method = rule(co.Exponential())
    state = method.begin(system, entry.start(system), entry.dt)
    program, constants = StepProgram(replace_parameters(system, None), method), Constants(system.parameters, None)
    stage = program.stages[0]
    z, h = np.zeros(sum(stage.blocks)), np.float64(entry.dt)
    met = set()
    for function, more in ((stage.residual, ()), (stage.advance, (1.0,)), (stage.chart, ())):
        met |= primitives(jaxpr_of(function, constants, state, h, z, *more)[0].jaxpr)
    unknown = met - set(NUMERIC) - set(CONTROL)
    assert not unknown, f"The tracer has no rule for {', '.join(sorted(unknown))}, which {name} needs."
    assert len(met) > 15
    native.compile(program, constants, state, monitors=False)
