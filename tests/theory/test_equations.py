"""The printed equations hold on runs to round-off, and the check sees runs in which they do not."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache, partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
import pinned
from coadjoint import theory
from coadjoint.methods.rattle import Reactions
from discrete import moser_veselov, random_group_system
from systems import MAPS, RULES, flat, random_system

H, STEPS = 0.1, 12
ROUND_OFF = 2e-13
"""Of each equation's own scale: the momenta, levers and points in it."""

SPATIAL = {"P38 F", "P38 s", "P39", "P43", "P44", "P42 μ", "P42 π", "P50", "P52"}
MOMENTA = {"F⁻ μ", "F⁻ π", "F⁺ μ", "F⁺ π"}


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("world", "tau", "rule"),
    [
        ("SO3", "exponential", "left"),
        ("SE2", "cayley", "midpoint"),
        ("R3", "cayley", "right"),
        ("SL2", "cayley", "trapezoidal"),
        ("SO3 on a sphere", "cayley", "midpoint"),
    ],
)
def test_the_equations_of_theorems_6_and_7_hold_on_runs_of_every_rule(world, tau, rule):
    system, start = random_system(world)
    run = co.simulate(system, start, dt=H, steps=STEPS, method=RULES[rule](MAPS[tau]))
    found = theory.printed_equations(run)
    assert {row.equation for row in found} == SPATIAL | MOMENTA | {"P47"}
    assert found.worst.largest < ROUND_OFF, str(found)


def sleigh_on_a_blade() -> co.System:
    blade = co.Nonholonomic(lambda: [[0, 0, 1]])
    return co.System(co.SE2(), lambda xi: 0.5 * xi @ xi + 0.3 * xi[0] * xi[2], constraints={"blade": blade})


def test_reactions_act_at_both_ends_of_a_step_as_half_of_its_impulse():
    sleigh = sleigh_on_a_blade()
    memory = Reactions(np.array([[3.0], [5.0]]), np.array([[7.0], [11.0]]), None, None)
    two = jax.tree.map(lambda leaf: np.stack([leaf, leaf]), sleigh.state(xi=[1, 0, 0])).replace(memory=memory)
    forces = theory.slopes.Impulse(*(np.full((2, size), 1.0) for size in (3, 0, 3, 0)))
    found = theory.constraints.with_reactions(sleigh, two, forces, h=0.2)
    assert found.torque == pytest.approx(np.array([[1, 1, 1.3], [1, 1, 1.5]]))
    assert found.torque_next[0] == pytest.approx([1, 1, 2.1])


@pytest.mark.long
def test_the_equations_of_a_sleigh_have_the_reaction_of_its_blade():
    sleigh = sleigh_on_a_blade()
    run = co.simulate(sleigh, sleigh.state(xi=[1.2, -0.5, 0]), dt=H, steps=3, monitors=False, accuracy=False)
    found = theory.printed_equations(run)
    assert {row.equation for row in found} == SPATIAL | MOMENTA | {"P47", "A"}
    assert found.worst.largest < ROUND_OFF, str(found)


@pytest.mark.long
@pytest.mark.parametrize("rule", [co.LeftRectangle(), co.Midpoint(), co.Trapezoidal()])
def test_the_equations_of_a_pinned_body_have_its_reaction_and_see_another(rule):
    body = pinned.pinned()
    run = co.simulate(body, pinned.start(body), dt=0.02, steps=STEPS, method=rule)
    found = theory.printed_equations(run)
    assert {row.equation for row in found} == SPATIAL | MOMENTA | {"P47", "A", "φ"}
    assert found.worst.largest < ROUND_OFF, str(found)
    memory = replace(run.records.memory, step=1.001 * run.records.memory.step)
    wrong = theory.equations_of(body, rule, run.records.replace(memory=memory, n=run.records.n + 1e-3), 0.02)
    for row in ("P42 μ", "P42 π", "φ", "A"):
        assert wrong[row].largest > 1e-6, row


@pytest.mark.long
@pytest.mark.parametrize(
    ("world", "more"),
    [("SO3", set()), ("SO3xSE2", set()), ("SO3 alone", {"B19", "B25"}), ("SO2", {"B13 f", "B13 u"})],
)
def test_the_equations_of_both_papers_hold_on_runs_in_group_form(world, more):
    system, start = random_group_system(world)
    run = co.simulate(
        system, start, dt=H, steps=STEPS, method=co.methods.GroupVariational(co.Exponential(), "velocity")
    )
    found = theory.printed_equations(run)
    assert {row.equation for row in found} == SPATIAL | MOMENTA | {"P37", "B8 g", "B8 q"} | more
    assert found.worst.largest < ROUND_OFF, str(found)
    if "B13 f" in more:  # the balance of the same momenta as in (P42), in other variables
        assert found["B13 f"].scale == found["P42 μ"].scale


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", [co.Variational(), co.methods.AdjointVariational()], ids=lambda m: type(m).__name__)
def test_the_equations_of_theorem_6_hold_for_a_discrete_lagrangian_and_for_its_adjoint(method):
    inertia, center = np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 1.5])
    top = co.System(
        co.SO3(),
        discrete_lagrangian=lambda xi, a, h: h * (0.5 * xi @ (inertia * xi) - center @ a),
        advected=co.Defining(),
    )
    start = top.state(xi=[0.3, 0.2, 1.5], a0=[0, 0, 1]).replace(mu=np.array([0.3, 0.4, 4.5]), from_velocities=False)
    run = co.simulate(top, start, dt=H, steps=STEPS, method=method)
    found = theory.printed_equations(run)
    assert found.worst.largest < ROUND_OFF, str(found)


@pytest.mark.long
def test_a_momentum_that_was_changed_on_the_way_is_seen():
    """Two runs after one another, the second with μ off by a millionth."""
    system, start = random_group_system("SO3 alone")
    method = co.methods.GroupVariational(co.Exponential(), "velocity")
    first = co.simulate(system, start, dt=H, steps=STEPS, method=method)
    pushed = first.final.replace(mu=first.final.mu * (1 + 1e-6))
    second = co.simulate(system, pushed, dt=H, steps=STEPS, method=method)
    assert theory.printed_equations(first).worst.largest < ROUND_OFF
    joined = jax.tree.map(lambda x, y: np.concatenate([x[:-1], y]), first.records, second.records)
    found = theory.equations_of(system, method, joined, H)
    assert found["P42 μ"].largest > 1e-8
    assert found["B19"].largest > 1e-8
    assert found["P44"].largest < ROUND_OFF


def test_a_run_that_ends_inside_a_step_raises_no_false_alarm():
    system, start = random_system("SO3 alone")
    run = co.simulate(system, start, dt=H, steps=STEPS, until=lambda s: s.t - 0.92, monitors=False)
    assert len(run.records.t) < STEPS
    found = theory.printed_equations(run)
    assert found.worst.largest < ROUND_OFF, str(found)


@pytest.mark.long
def test_a_wrong_difference_map_is_seen():
    """Records of a run whose unknowns are said to be those of another map."""
    system, start = random_system("SO3 alone")
    run = co.simulate(system, start, dt=H, steps=STEPS, method=co.LeftRectangle(co.Cayley()))
    found = theory.equations_of(system, co.LeftRectangle(co.Exponential()), run.records, H)
    assert found["P38 F"].largest > 1e-6
    assert found["P42 μ"].largest > 1e-6


@pytest.mark.long
def test_an_unreduced_lagrangian_of_another_body_is_seen():
    system, other = moser_veselov(np.diag([1.0, 2.0, 3.5])), moser_veselov(np.diag([1.0, 2.0, 3.0]))
    start = system.state(xi=[0.3, 0.2, 0.6])
    run = co.simulate(system, start, dt=0.5, steps=5, method=co.methods.GroupVariational(co.Exponential(), "velocity"))
    found = theory.printed_equations(run, unreduced=theory.unreduce(other))
    assert found["P37"].largest > 1e-3
    assert found["B8 g"].largest > 1e-3


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "options", "says"),
    [
        (co.methods.LeftRight(), {}, "one discrete Lagrangian a step"),
        (co.Midpoint(), {"save_every": 2}, "consecutive"),
    ],
)
def test_runs_without_one_discrete_lagrangian_a_step_are_refused(method, options, says):
    system, start = random_system("SO3 alone")
    run = co.simulate(system, start, dt=H, steps=4, method=method, **options)
    with pytest.raises(co.errors.ArgumentError, match=says):
        theory.printed_equations(run)


FORCED = {
    **RULES, "simpson": co.Simpson, "galerkin": partial(co.Galerkin, degree=2), "variational": co.Variational,
    "adjoint": co.methods.AdjointVariational,
}  # fmt: skip


@lru_cache
def forced_system(world: str, rule: str) -> tuple[co.System, co.State]:
    """A system with time and dissipative forces; its Λ for the methods of Λ: that of the left rule, a little bent."""
    system, start = random_system(world, forced=True)
    if rule not in ("variational", "adjoint"):
        return system, start
    Q, V = system.additional.ambient(system.group), system.advected.ambient(system.group)

    def discrete(xi, *rest, t):
        h, n, s = rest[-1], *map(flat, rest[:2] if Q else (np.zeros(0),) * 2)
        a = flat(rest[-3]) if V else np.zeros(0)
        return h * system.reduced_lagrangian(xi, 0.7 * n + 0.3 * s, (s - n) / h, a, t + 0.4 * h)

    made = co.System(
        system.group, discrete_lagrangian=discrete, additional=system.additional, advected=system.advected,
        forces=system.forces, parameters=system.parameters,
    )  # fmt: skip
    return made, start.replace(from_velocities=False)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("world", "rule"),
    [
        ("SO3", "left"),
        ("SL2", "right"),
        ("SE2", "trapezoidal"),
        ("SO3 on a sphere", "midpoint"),
        ("SE2", "simpson"),
        ("SO3", "galerkin"),
        ("SE2", "variational"),
        ("SO3", "adjoint"),
    ],
)
def test_the_equations_of_lagrange_and_d_alembert_hold_on_forced_runs(world, rule):
    """With dissipation, and ℓ and forces of t: the forces' covectors are those of the virtual work of the nodes."""
    system, start = forced_system(world, rule)
    run = co.simulate(system, start, dt=H, steps=6, method=FORCED[rule](co.Cayley()), monitors=False)
    found = theory.printed_equations(run)
    assert found.worst.largest < ROUND_OFF, str(found)
    free = theory.equations_of(system.unforced, run.method, run.records, H)
    assert min(free[row].largest for row in ("P42 μ", "P52", "F⁺ μ" if rule in ("right", "adjoint") else "F⁻ μ")) > 1e-3


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("part", ["mu", "pi"])
@pytest.mark.parametrize("form", ["algebra", "group"])
def test_records_whose_momenta_were_overwritten_are_seen(form, part):
    system, start = random_system("SO3") if form == "algebra" else random_group_system("SO3")
    method = co.Midpoint() if form == "algebra" else co.methods.GroupVariational(co.Exponential(), "velocity")
    run = co.simulate(system, start, dt=H, steps=STEPS, method=method, monitors=False)
    values = getattr(run.records, part).copy()
    values[5] *= 1 + 1e-6
    found = theory.equations_of(system, method, run.records.replace(**{part: values}), H)
    sign = "μ" if part == "mu" else "π"
    for row in (f"F⁻ {sign}", f"F⁺ {sign}"):
        assert found[row].largest > 1e-8
        assert np.sum(found[row].values > 1e-8 * found[row].scale) == 1


def test_what_is_no_run_is_refused():
    with pytest.raises(co.errors.ArgumentError, match=r"must be a run of co\.simulate"):
        theory.printed_equations(3)


def test_an_equation_whose_residual_is_no_number_holds_least_well():
    rows = [theory.Residual(name, "", np.array([0.0, value]), 1.0) for name, value in (("one", 1e-3), ("two", np.nan))]
    for order in (rows, rows[::-1]):
        worst = theory.Equations(tuple(order)).worst
        assert worst.equation == "two" and worst.largest == np.inf


@pytest.mark.long
@pytest.mark.parametrize("method", [co.Midpoint(co.Cayley()), co.LeftRectangle(co.Exponential())], ids=repr)
def test_the_equations_hold_on_runs_of_chains(method):
    """Links that see each other, and each of which has a point of its own in a field."""

    def lagrangian(xi, n, nu, a):
        field = jnp.sum(n * a.field) - 0.2 * jnp.sum(n**2)
        return 0.5 * jnp.sum(xi**2 * np.array([1.0, 2.0, 1.5])) + 0.5 * jnp.sum(nu**2) + field + 0.3 * a.joint[0, 0, 1]

    spaces = {"field": co.Defining(), "joint": co.spaces.RelativePoses()}
    chain = co.System(co.Power(co.SO3(), 2), lagrangian, additional=co.Defining(), advected=spaces)
    values = np.cos(np.arange(6.0))
    a0 = {"field": values[::-1], "joint": None}
    start = chain.state(xi=0.4 * values, q=values, qdot=-values, a0=a0)
    run = co.simulate(chain, start, dt=0.05, steps=6, method=method, accuracy=False)
    assert theory.printed_equations(run).worst.largest < 1e-12
