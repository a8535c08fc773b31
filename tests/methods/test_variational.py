"""A discrete Lagrangian in algebra form gives the step of the rule that it encodes."""

from __future__ import annotations

import numpy as np
import pytest

import action
import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from stepping import Stepper
from systems import MAPS, RULES, flat, random_system

H = 0.15
ROUND_OFF = 1e-12
"""Of 1 + the largest entry; both Newton iterations end within 1e-13 of the same solution."""

CASES = [
    ("SO3", "cayley", "left", True),
    ("SE3", "exponential", "left", False),
    ("SL2", "cayley", "right", False),
    ("SE2", "bent", "right", False),
    ("SO3", "exponential", "midpoint", False),
    ("Heisenberg", "cayley", "midpoint", False),
    ("SO4", "squared", "trapezoidal", False),
    ("SO3xSE2", "cayley", "trapezoidal", False),
    ("SO3 on a sphere", "cayley", "left", False),
    ("SO3 on a sphere", "exponential", "trapezoidal", False),
]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("world", "tau", "rule", "forced"), CASES)
def test_discrete_lagrangian_of_a_rule_gives_its_step(world, tau, rule, forced):
    """Forces enter at the left node, so forced runs compare with the left rule."""
    system, start = random_system(world, forced)
    step = RULES[rule](MAPS[tau])
    Q, V = system.additional, system.advected

    def discrete(xi, *rest, t):
        nothing = np.zeros(0)
        n, s = rest[:2] if Q.ambient(system.group) else (nothing, nothing)
        a = rest[-3] if V.ambient(system.group) else nothing
        return action.discrete_lagrangian(system, step, xi, flat(n), flat(s), flat(a), rest[-1], t)

    given = co.System(
        system.group,
        discrete_lagrangian=discrete,
        additional=Q,
        advected=V,
        forces=system.forces,
        parameters=system.parameters,
    )
    increment = co.difference_maps.Squared(MAPS[tau]) if rule == "midpoint" else MAPS[tau]
    (ours,) = Stepper(given, co.Variational(increment)).run(start.replace(from_velocities=False), H, 1)
    (theirs,) = Stepper(system, step).run(start, H, 1)
    pairs = {
        name: (getattr(ours.after, name), getattr(theirs.after, name)) for name in ("g", "n", "a", "mu", "pi", "t")
    }
    pairs["g"] = tuple(evaluate(system.group.matrix, g) for g in pairs["g"])
    if not forced:
        pairs["energy"] = (
            evaluate(lambda r: co.Variational(increment).energy(given, r, H), ours.record),
            evaluate(lambda r: step.energy(system, r, H), theirs.record),
        )
    for name, (found, expected) in pairs.items():
        size = 1 + np.max(np.abs(expected), initial=0.0)
        np.testing.assert_allclose(found, expected, rtol=0, atol=ROUND_OFF * size, err_msg=name)
