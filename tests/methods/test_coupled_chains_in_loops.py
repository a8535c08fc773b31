"""Chains of links on springs, and rods, in native code that loops over their links."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.emit.link_check import require_links
from coadjoint.kernels.emit.link_plan import plan_links
from coadjoint.kernels.emit.plan import specialised
from coadjoint.kernels.newton.coupled import Coupled
from coadjoint.kernels.packing import pack
from coadjoint.kernels.run import native
from coadjoint.kernels.untraceable import NotLinked
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.models import rods
from coadjoint.simulation import configuration
from coadjoint.simulation.plan import Plan
from coadjoint.simulation.steppers.engines import LinkedEngine

QUIET = {"monitors": False, "accuracy": False}
WEIGHTS = np.array([1.0, 2.0, 1.5])


def chain(xi, a, p):
    """Rigid bodies on springs that turn a body back to where the one before it points."""
    return 0.5 * jnp.sum(WEIGHTS * xi * xi) + jnp.sum(p.stiffness * jnp.trace(a, axis1=1, axis2=2))


def bodies(count, lagrangian=chain, coupling="chain", **more):
    """A chain whose springs differ in stiffness."""
    system = co.System(
        co.Power(co.SO3(), count, coupling), lagrangian, advected=co.spaces.RelativePoses(),
        parameters={"stiffness": np.linspace(1.0, 2.0, count - 1 + (coupling == "ring"))}, **more,
    )  # fmt: skip
    s = np.linspace(0, np.pi, count)
    return system, system.state(xi=np.stack([np.sin(s), 0.5 * np.cos(s), 0.2 + 0 * s], axis=1))


def begun(system, start, method=None):
    """The program of a step, its constants, and the state that it starts from."""
    program = StepProgram(replace_parameters(system, None), method or co.Midpoint())
    return program, Constants(system.parameters, None), program.method.begin(system, start, 0.05)


def planned(system, start):
    """The plan of loops over the links, compared with all links."""
    program, constants, state = begun(system, start)
    stage = program.linked(state)
    assert stage is not None
    plan = plan_links(stage, constants, state, specialised(pack(constants)[1]))
    require_links(plan, stage, constants, state)
    return plan


def apart(one, other):
    """The largest difference of the leaves of two states, relative to the largest number of each."""
    pairs = [pair for pair in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True) if np.size(pair[0])]
    return max(np.max(np.abs(x - y)) / (1e-3 + np.max(np.abs(y))) for x, y in pairs)


def test_loops_run_chains_on_springs_from_twelve_links_on():
    for count, looped in ((11, False), (12, True), (31, True)):
        how = Coupled(count, (3,), co.Power(co.SO3(), count).pairs)
        assert how.looped is looped and how.native is (count < 31)


def test_the_code_of_a_chain_on_springs_is_that_of_its_first_inner_and_last_links():
    plan = planned(*bodies(12, verify=False))
    assert plan.reach == 1 and plan.base == 0 and plan.joint == 3 and not plan.jointed
    assert (1, 12) in plan.state.spans  # the first link has no pose to one before
    assert plan.parameters.spans == [(1, 12)] and plan.parameters.size == 11


def test_a_spring_that_is_not_like_the_others_is_no_loop():
    def odd(xi, a, p):
        extra = jnp.where(np.arange(len(xi) - 1) == 7, 0.3, 0.0)
        return chain(xi, a, p) + jnp.sum(extra * jnp.trace(a, axis1=1, axis2=2))

    with pytest.raises(NotLinked, match="not all alike"):
        planned(*bodies(12, odd, verify=False))


def on_seven(strength):
    """A torque on link 7 alone, of a strength (N, 3) or (1, 3)."""

    def push(m, p):
        there = (jnp.arange(len(m.xi)) == 7)[:, None]
        return co.Force(torque=jnp.where(there, strength(m, p) * jnp.ones_like(m.xi), 0.0))

    return {"forces": {"push": push}}


@pytest.mark.parametrize(
    "strength",
    [
        pytest.param(lambda m, p: jnp.where(m.t > 2.0, 1.0, 0.0), id="late"),
        pytest.param(lambda m, p: -m.xi * jnp.maximum(0.0, jnp.abs(m.xi) - 4.0), id="fast", marks=pytest.mark.long),
    ],
)
def test_a_force_on_one_link_is_seen_where_the_start_does_not_show_it(strength):
    """A kernel serves any time, state and parameters."""
    with pytest.raises(NotLinked, match="not all alike"):
        planned(*bodies(12, verify=False, **on_seven(strength)))


@pytest.mark.long
def test_an_input_that_acts_on_one_link_later_moves_it():
    system, start = bodies(12, **on_seven(lambda m, p: m.inputs.u * np.array([1.0, 0.5, 0.3])))
    later, never = (co.Held([0.0, 0.5], [0.0, value]) for value in (1.0, 0.0))
    runs = [co.simulate(system, start, dt=0.05, steps=40, inputs={"u": u}, **QUIET) for u in (later, never)]
    assert np.max(np.abs(runs[0].final.xi - runs[1].final.xi).reshape(12, 3)[7]) > 0.1


@pytest.mark.long
def test_a_run_ends_where_links_turn_out_to_be_unlike():
    """A push within a window of time that no comparison meets: observed steps do not solve the equations."""
    system, start = bodies(12, **on_seven(lambda m, p: jnp.where((m.t > 1.0) & (m.t < 1.2), 1.0, 0.0)))
    with pytest.raises(ArgumentError, match="does not solve the equations of all links"):
        co.simulate(system, start, dt=0.05, steps=40, accuracy=False)
    assert co.simulate(system, start, dt=0.05, steps=40, accuracy=False, backend="xla").good_steps == 40


def rod(ends, elements=12, planar=True, **more):
    """A rod, bent where its ends allow it."""
    stiff = {"EI": 1.0, "EA": 100.0, "GA": 100.0, "mass": 1.0}
    if planar:
        found = rods.planar(elements=elements, length=1.0, inertia=0.01, ends=ends, **stiff, **more)
        return found, rods.planar_start(found, curvature=0.3 if ends != "both clamped" else None)
    found = rods.cosserat(elements=elements, length=1.0, GJ=0.8, inertia=(0.02, 0.01, 0.01), ends=ends, **stiff, **more)
    return found, rods.start(found, curvature=(0.0, 0.3, 0.2), angular_velocity=(0.2, 0.3, 0.1))


@pytest.mark.long
@pytest.mark.parametrize("ends", ["free", "clamped", "both clamped"])
def test_rods_in_loops_move_as_xla(ends):
    system, start = rod(ends, 16, gravity=9.81)
    runs = [co.simulate(system, start, dt=0.005, steps=40, backend=kind, **QUIET) for kind in ("native", "xla")]
    assert native.linked(*begun(system, start)[::2]) is not None and planned(system, start).joint == 3
    assert apart(runs[0].final, runs[1].final) < 1e-10


@pytest.mark.long
def test_a_long_rod_is_in_loops_as_no_pair_of_its_sections_is_compared_near_a_half_turn():
    assert planned(*rod("free", elements=199, planar=False)).count == 200


@pytest.mark.long
def test_a_rod_with_a_load_at_its_end_is_in_loops_too():
    system, start = rod("clamped", 16, load=(0.0, -1.0))
    runs = [co.simulate(system, start, dt=0.005, steps=40, backend=kind, **QUIET) for kind in ("native", "xla")]
    assert planned(system, start).joint == 3 and apart(runs[0].final, runs[1].final) < 1e-10


@pytest.mark.long
def test_a_rod_in_space_keeps_its_momentum_and_energy_in_loops():
    system, start = rod("free", planar=False)
    run = co.simulate(system, start, dt=0.005, steps=400, accuracy=False)
    assert run.plan.backend == "native" and run.position.iterations_max < 8
    assert run.largest("balance") < 1e-14 and run.largest("newton_residual") < 1e-14
    energy = run.dataset.energy.values
    assert np.max(np.abs(energy - energy[0])) < 1e-3 * energy[0]


@pytest.mark.long
@pytest.mark.parametrize("method", [co.Midpoint(), co.LeftRectangle(), co.Suzuki4(co.Midpoint())])
def test_chains_on_springs_in_loops_move_as_xla(method):
    system, start = bodies(40)
    given = {"dt": 0.05, "steps": 60, "method": method, "accuracy": False}
    ours, theirs = (co.simulate(system, start, backend=kind, **given) for kind in ("auto", "xla"))
    assert ours.plan.backend == "native"
    assert apart(ours.final, theirs.final) < 1e-12
    assert apart(dict(ours.monitors), dict(theirs.monitors)) < 1e-8
    assert ours.largest("balance") < 1e-14 and ours.largest("newton_residual") < 1e-14


@pytest.mark.long
def test_steppers_of_chains_on_springs_step_as_runs_to_the_bit():
    system, start = bodies(12)
    run = co.simulate(system, start, dt=0.05, steps=40, save_every=10, **QUIET)
    stepper = co.Stepper(system, start, dt=0.05, accuracy=False)
    assert isinstance(stepper._engine, LinkedEngine) and run.plan.backend == "native"
    for _ in range(40):
        stepper.step()
    assert np.array_equal(stepper.state.mu, run.final.mu) and np.array_equal(stepper.state.a, run.final.a)


def test_the_identity_of_runs_has_the_form_of_loops_without_joints(monkeypatch):
    program, constants, state = begun(*bodies(12, verify=False))
    by_loops, by_xla = (Plan(kind, program, constants, 0.05, 1, 1, False) for kind in ("native", "xla"))
    monkeypatch.setattr(configuration, "loops", lambda *given: True)
    form = configuration._loops_over_links
    assert form(by_loops, constants, state) and not form(by_xla, constants, state)
    assert native.linked(program, state) is not None
    members = replace(by_loops, members=2)
    assert native.written(program) and not form(members, constants, state)
    monkeypatch.setattr(configuration, "written", lambda program: False)
    assert form(members, constants, state) == form(by_loops, constants, state)
    monkeypatch.setattr(configuration, "loops", lambda *given: False)
    assert not form(by_loops, constants, state)
