"""Chains of joints in native code that loops over links: the code of three links is that of all."""

from __future__ import annotations

from collections import OrderedDict

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.emit.link_check import require_links
from coadjoint.kernels.emit.link_plan import plan_links
from coadjoint.kernels.emit.plan import specialised
from coadjoint.kernels.packing import pack
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import backend, native, observed
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.untraceable import NotLinked
from coadjoint.mechanics import reactions
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods import rattle
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.methods.rattle import Reactions
from coadjoint.simulation import monitors

H = 0.01
QUIET = {"monitors": False, "accuracy": False}


def joints(n, a, p):
    """q_i − q_{i−1} less the rod, in a plane."""
    places = jnp.stack([jnp.sum(a.x * n, axis=1), jnp.sum(a.y * n, axis=1)], axis=1)
    ends = jnp.stack([a.x[:, 0], a.y[:, 0]], axis=1)
    return jnp.ravel(places - ends - jnp.concatenate([jnp.zeros((1, 2)), places[:-1]]))


def bobs(count, rows=joints):
    """Rods of unit length in a plane that hang from the origin, each by its end on the centre of the one before."""

    def lagrangian(xi, n, nu, a, p):
        return 0.05 * jnp.sum(xi**2) + 0.5 * jnp.sum(p.masses @ nu**2) - 9.81 * p.masses @ jnp.sum(n * a.y, axis=1)

    return co.System(
        co.Power(co.SO2(), count),
        lagrangian,
        additional=co.Defining(),
        advected={"x": co.Defining(), "y": co.Defining()},
        parameters={"masses": np.linspace(1.0, 2.0, count)},
        constraints={"joints": co.Holonomic(rows)},
    )


def leaning(system):
    """The chain at rest, straight, along the first axis."""
    count = system.group.count
    axes = {"x": np.tile([1.0, 0.0], (count, 1)), "y": np.tile([0.0, 1.0], (count, 1))}
    g = np.broadcast_to(np.eye(2), (count, 2, 2))
    return system.state(g=g, q=[(i + 1.0, 0.0) for i in range(count)], a0=axes)


def stage_of(system):
    """What loops over links run, with its constants and a state that was begun."""
    program = StepProgram(replace_parameters(system, None), co.Midpoint())
    state = program.method.begin(system, leaning(system), H)
    stage = program.linked(state)
    assert stage is not None
    return stage, Constants(system.parameters, {}), state


def planned(system):
    """The plan of loops over its links, compared with all links."""
    stage, constants, state = stage_of(system)
    plan = plan_links(stage, constants, state, specialised(pack(constants)[1]))
    require_links(plan, stage, constants, state)
    return plan


def differences(one, other):
    """The largest difference of each leaf, relative to the largest number of it."""
    pairs = zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    return [np.max(np.abs(x - y)) / (1e-3 + np.max(np.abs(y))) for x, y in pairs]


def gap(system, state):
    """The largest |φ| of a state."""
    return np.abs(evaluate(lambda s: system.constraints[0].value(system, reactions.site(s)), state)).max()


def test_loops_run_chains_that_are_too_long_to_write_out(monkeypatch):
    system = bobs(41)
    program = StepProgram(replace_parameters(system, None), co.Midpoint())
    state = leaning(system).replace(memory=Reactions(np.zeros(82), np.zeros(82), None))
    assert native.loops(program, state)
    monkeypatch.setattr(observed, "run", lambda *given: "observed")
    assert backend.run("native", program, None, state, H, 1, 1) == "observed"
    composed = StepProgram(program.skeleton, co.Suzuki4(co.Midpoint()))
    assert not native.loops(composed, state)
    short = StepProgram(replace_parameters(bobs(20), None), co.Midpoint())
    assert not native.loops(short, state) and all(stage.structure.native for stage in short.stages)


def late(system, step, record, h, constants):
    """Not finite after 0.055 s."""
    return {"late": jnp.where(record.t < 0.055, record.n, jnp.nan)}


@pytest.mark.long
def test_records_observed_together_give_the_monitors_of_every_step(monkeypatch):
    monkeypatch.setattr(observed, "MOST", 4)
    system = bobs(4)
    program = StepProgram(replace_parameters(system, None), co.Midpoint(), (monitors.constraint_gap, late))
    state = program.method.begin(system, leaning(system), H)
    given = program, Constants(system.parameters, {}), state, H, 3, 5
    together, alone = observed.run(*given), native.run(*given)
    assert together.code == alone.code == Code.NOT_FINITE and together.steps == alone.steps == 6
    assert together.monitors["late"].shape == (2, 8) and together.iterations == alone.iterations
    for name in ("records", "final", "monitors", "extrema"):
        assert max(differences(getattr(together, name), getattr(alone, name))) < 1e-11, name


@pytest.mark.long
def test_default_runs_in_loops_report_what_xla_reports():
    system = bobs(41)
    start, runs = leaning(system), []
    for chosen in ("auto", "xla"):
        fall = co.Event(lambda s: s.t + s.n[1] - 0.123)
        runs.append(co.simulate(system, start, dt=H, steps=40, save_every=8, events={"fall": fall}, backend=chosen))
    assert [run.plan.backend for run in runs] == ["native", "xla"]
    assert max(differences(dict(runs[0].monitors), dict(runs[1].monitors))) < 1e-8
    assert runs[0].extrema.keys() == runs[1].extrema.keys() >= {"balance", "constraint_gap", "energy"}
    for name in ("energy", "discrete_energy"):
        assert max(differences(runs[0].extrema[name], runs[1].extrema[name])) < 1e-8
    assert all(
        run.extrema[name][1] < 1e-12 for run in runs for name in ("balance", "newton_residual", "constraint_gap")
    )
    lines = [[line.split("  ")[0] for line in run.certificate.long().splitlines()] for run in runs]
    assert lines[0] == [line for line in lines[1] if line != "solved"]
    assert abs(runs[0].events["fall"].t[0] - runs[1].events["fall"].t[0]) < 1e-10


@pytest.mark.long
def test_the_code_of_three_links_is_that_of_all():
    plan = planned(bobs(13))
    assert plan.count == 13 and plan.base == 3 and plan.joint == 2 and plan.parameters.links.shape == (13, 1)


@pytest.mark.long
def test_a_joint_that_is_not_like_the_others_is_left_to_xla():
    def bent(n, a, p):
        rows = joints(n, a, p)
        return rows + 0.1 * jnp.where(np.arange(len(rows)) == 24, n[12, 0] - n[11, 0] - 1, 0.0)

    with pytest.raises(NotLinked, match="not all alike"):
        planned(bobs(13, rows=bent))


@pytest.mark.long
def test_loops_move_as_xla_and_keep_the_joints():
    system = bobs(41)
    start, runs = leaning(system), []
    for chosen in ("auto", "xla"):
        runs.append(co.simulate(system, start, dt=H, steps=40, save_every=8, backend=chosen, **QUIET))
    assert [run.plan.backend for run in runs] == ["native", "xla"]
    assert max(differences(runs[0].records, runs[1].records)) < 1e-8
    assert gap(system, runs[0].final) < 1e-13 * 41


@pytest.mark.long
def test_loops_move_as_written_code(monkeypatch):
    system = bobs(13)
    start = leaning(system)
    written = co.simulate(system, start, dt=H, steps=40, **QUIET)
    monkeypatch.setattr(rattle, "WRITTEN", 0)
    monkeypatch.setattr(native, "_kernels", OrderedDict())
    looped = co.simulate(bobs(13), start, dt=H, steps=40, **QUIET)
    assert written.plan.backend == looped.plan.backend == "native"
    assert max(differences(looped.records, written.records)) < 1e-8


@pytest.mark.long
def test_a_thousand_links_stay_together():
    system = bobs(1000)
    run = co.simulate(system, leaning(system), dt=H, steps=50, save_every=50, **QUIET)
    assert run.plan.backend == "native" and run.position.iterations < 5 * 50
    assert gap(system, run.last_record) < 10 * np.finfo(float).eps * 1000


@pytest.mark.long
def test_gradients_through_a_chain_in_loops_are_those_of_xla():
    system = bobs(41)
    start = leaning(system)

    def height(weight):
        moved = system.replace(masses=weight * np.linspace(1.0, 2.0, 41))
        return co.trajectory(moved, start, dt=H, steps=3).final.n[::2].sum()

    with co.float64():
        slope = jax.grad(height)(1.0)
    assert abs(slope - (height(1.01) - height(0.99)) / 0.02) < 1e-3 * abs(slope)
