"""Measured orders of convergence towards the continuous motion, on nonlinear systems with and without forces."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.continuous import reference
from stepping import Stepper
from systems import ALL_RULES, MAPS, RULES, random_system

DURATION = 1.0
PLACES = {
    "SO3-cayley-forced": ("SO3", "cayley", True),
    "SE3-exponential-forced": ("SE3", "exponential", True),
    "SL2-squared": ("SL2", "squared", False),
    "SE2-bent-forced": ("SE2", "bent", True),
    "SE2-pade": ("SE2", "pade", False),
    "SO3-second kind": ("SO3", "second kind", False),
}


@dataclass
class Problem:
    """A random system with its exact motion and steps compiled once."""

    system: co.System
    start: co.State
    tau: co.difference_maps.DifferenceMap

    def __post_init__(self):
        times = [float(self.start.t), float(self.start.t) + DURATION]
        self.exact = self.coordinates(jax.tree.map(lambda row: row[-1], reference(self.system, self.start, times)))

    def coordinates(self, state: co.State) -> np.ndarray:
        matrix = evaluate(self.system.group.matrix, state.g)
        return np.concatenate([np.ravel(matrix), state.n, state.a, state.mu, state.pi])

    def error(self, method: co.methods.Method, steps: int) -> float:
        """|end − exact|∞ relative to |exact|∞."""
        stepper = Stepper(self.system, method, compiled=True)
        end = self.coordinates(stepper.final(self.start, DURATION / steps, steps))
        return np.max(np.abs(end - self.exact)) / np.max(np.abs(self.exact))

    def order(self, method: co.methods.Method, steps: int, factor: float) -> float:
        """log of the ratio of errors at `steps` and factor·steps, over log factor; round-off is far below."""
        coarse, fine = self.error(method, steps), self.error(method, round(factor * steps))
        assert fine > 1e-11, f"{method.title}: {fine:.1e} is at the round-off of the reference solution"
        return np.log(coarse / fine) / np.log(factor)


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=pytest.mark.long if name.startswith("SE3") else ()) for name in PLACES],
)
def problem(request) -> Problem:
    world, tau, forced = PLACES[request.param]
    return Problem(*random_system(world, forced), MAPS[tau])


@pytest.mark.long
@pytest.mark.cases(2)
@pytest.mark.parametrize("rule", ALL_RULES)
def test_rule_has_its_order(problem, rule):
    method = ALL_RULES[rule](problem.tau)
    assert method.order == {"left": 1, "right": 1}.get(rule, 2)
    assert problem.order(method, 40, 2) == pytest.approx(method.order, abs=0.1)


@pytest.mark.long
@pytest.mark.cases(2)
@pytest.mark.parametrize("rule", ["midpoint", "trapezoidal", "pair"])
def test_suzuki_composition_has_order_4(problem, rule):
    method = co.Suzuki4(RULES[rule](problem.tau))
    assert method.order == 4
    assert problem.order(method, 12, 1.5) == pytest.approx(4, abs=0.2)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("rule", ["midpoint", "trapezoidal", "pair"])
def test_velocity_start_costs_the_second_order(problem, rule):
    """The given velocities are then taken at the rule's own node, h/2 off or the like."""
    method = RULES[rule](problem.tau, start="velocity")
    assert problem.order(method, 40, 2) == pytest.approx(1, abs=0.15)


@dataclass(frozen=True)
class Claimed(co.Variational):
    """A discrete Lagrangian that claims to be symmetric of order 2, and is not asked whether it is."""

    symmetric: bool = True

    def remember(self, system, state):
        return state


@pytest.mark.long
def test_a_rule_that_is_not_truly_symmetric_is_exposed_by_composition():
    """Λ of the midpoint rule with H = cay(hξ/2): order 4 with F = H², order 3 with F = cay(hξ), whose half H is not."""
    world, start = random_system("SL2")
    group, Q, V = world.places

    def midpoint(xi, n, s, a, p, h):
        back = group.inverse(co.Cayley().tau(group, 0.5 * h * xi))
        first, last = Q.act(group, back, n), Q.act(group, back, s)
        return h * world.reduced_lagrangian(xi, (first + last) / 2, (last - first) / h, V.act(group, back, a))

    system = co.System(
        group, world.lagrangian, additional=Q, advected=V, parameters=world.parameters, discrete_lagrangian=midpoint
    )
    problem = Problem(system, start, co.Cayley())
    assert problem.order(co.Suzuki4(Claimed(co.difference_maps.Squared(co.Cayley()))), 12, 1.5) == pytest.approx(
        4, abs=0.2
    )
    assert problem.order(co.Suzuki4(Claimed(co.Cayley())), 12, 1.5) == pytest.approx(3, abs=0.2)


@pytest.mark.long
@pytest.mark.cases(1)
def test_the_energy_momentum_method_has_order_2(problem):
    tau = co.Exponential() if problem.tau == co.Exponential() else co.Cayley()
    method = co.EnergyMomentum(tau, points=1)
    assert method.order == 2
    assert problem.order(method, 40, 2) == pytest.approx(2, abs=0.1)
