"""Chains of joints in native code that loops over links: the code of three links is that of all."""

from __future__ import annotations

from collections import OrderedDict

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.emit.link_check import require_links
from coadjoint.kernels.emit.link_plan import plan_links
from coadjoint.kernels.emit.plan import specialised
from coadjoint.kernels.packing import pack
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import backend, linked_members, native, observed
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.untraceable import NotLinked
from coadjoint.mechanics import reactions
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods import coupled_links
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.methods.rattle import Reactions
from coadjoint.simulation import monitors
from coadjoint.simulation.steppers.engines import LinkedEngine

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


def driven(count):
    """Bobs with drag, pushed by inputs, one of all links and one of each, and by an actuator that lags behind."""

    def lagrangian(xi, n, nu, a, p):
        return 0.05 * jnp.sum(xi**2) + 0.5 * jnp.sum(p.masses @ nu**2) - 9.81 * p.masses @ jnp.sum(n * a.y, axis=1)

    def push(motion, p):
        inputs, thrust = motion.inputs, motion.internal.thrust
        return co.Force(
            force=inputs.side * p.masses[:, None] * motion.a.x + (inputs.lift + thrust)[:, None] * motion.a.y
        )

    def lag(motion, h, p):
        late, x, wanted = jnp.exp(-h / p.lag), motion.internal.thrust, 0.2 * jnp.ravel(motion.xi)
        mean = wanted + (x - wanted) * (1 - late) * p.lag / h
        return {"thrust": co.mechanics.Course(wanted + (x - wanted) * late, mean)}

    return co.System(
        co.Power(co.SO2(), count),
        lagrangian,
        additional=co.Defining(),
        advected={"x": co.Defining(), "y": co.Defining()},
        parameters={"masses": np.linspace(1.0, 2.0, count), "lag": 0.3},
        constraints={"joints": co.Holonomic(joints)},
        forces={"drag": lambda motion, p: co.Force(torque=-0.3 * motion.xi, force=-0.3 * motion.nu), "push": push},
        internal=lag,
    )


DRIVE = {"side": lambda m: 0.5 * jnp.cos(5 * m.t), "lift": lambda m: 0.3 * jnp.sin(m.t) - 0.1 * jnp.ravel(m.xi)}


def leaning(system, **more):
    """The chain at rest, straight, along the first axis."""
    count = system.group.count
    axes = {"x": np.tile([1.0, 0.0], (count, 1)), "y": np.tile([0.0, 1.0], (count, 1))}
    g = np.broadcast_to(np.eye(2), (count, 2, 2))
    return system.state(g=g, q=[(i + 1.0, 0.0) for i in range(count)], a0=axes, **more)


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


def of_bobs(count, method=None):
    """The program of a chain of bobs, and a state."""
    nothing = np.zeros(2 * count)
    program = StepProgram(replace_parameters(bobs(count), None), method or co.Midpoint())
    return program, leaning(bobs(count)).replace(memory=Reactions(nothing, nothing, None))


def test_loops_run_chains_that_are_long(monkeypatch):
    program, state = of_bobs(41)
    assert native.linked(program, state) is not None and not native.written(program)
    monkeypatch.setattr(native, "loops", lambda *given: True)
    monkeypatch.setattr(observed, "run", lambda *given, by_numpy: "NumPy" if by_numpy else "XLA")
    given = "native", program, None, state, H, 1, 1
    assert [backend.run(*given, length=steps) for steps in (None, 10, 513)] == ["XLA", "NumPy", "XLA"]
    assert native.linked(*of_bobs(21)) is not None and native.written(of_bobs(21)[0])
    assert native.linked(*of_bobs(20)) is None and native.written(of_bobs(20)[0])


@pytest.mark.parametrize("by_xla", [True, False])
def test_what_xla_compiles_to_observe_records_counts_as_set_up(monkeypatch, by_xla):
    calls = []

    def ran(which, program, constants, state, h, records, every, watches, length):
        calls.append((records, every))
        return native.run(program, constants, state, h, records, every, watches)

    monkeypatch.setattr(backend, "run", ran)
    monkeypatch.setattr(backend, "observed_by_xla", lambda *given: by_xla)
    free = co.System(co.SO2(), lambda xi: 0.5 * xi @ xi)
    co.simulate(free, free.state(xi=[1.0]), dt=H, steps=5, accuracy=False)
    assert calls == [(1, 1)] * by_xla + [(5, 1), (1, 1)]


def test_a_chain_whose_links_differ_is_written_out_if_it_is_short_enough(monkeypatch):
    program, state = of_bobs(21)
    constants = Constants(bobs(21).parameters, {})

    def unlike(*given):
        raise NotLinked("its links are not all alike")

    monkeypatch.setattr(native, "_kernels", OrderedDict())
    monkeypatch.setattr(native, "_load_links", unlike)
    monkeypatch.setattr(native, "plan", lambda *given: None)
    monkeypatch.setattr(native, "load", lambda *given: native.Kernel(None, None, None, {}, (), None))
    assert not native.compile(program, constants, state).looped and not native.loops(program, constants, state)
    with pytest.raises(NotLinked, match="not all alike"):
        native.compile(of_bobs(41)[0], Constants(bobs(41).parameters, {}), of_bobs(41)[1])


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


def test_loops_run_chains_that_are_driven_and_compositions():
    program, state = of_bobs(41, co.Suzuki4(co.Midpoint()))
    begun = state.replace(
        inputs={"lift": np.ones(41), "side": 1.0}, internal={"thrust": np.ones((41, 2))}, ledger=np.zeros((2, 43))
    )
    stage = program.linked(begun)
    assert stage is not None and stage.driving == (True, False, True)
    links, shared = stage.rows(begun)
    assert len(jax.tree.leaves(links)) == len(jax.tree.leaves(program.linked(state).rows(state)[0])) + 2
    assert [np.shape(leaf) for leaf in jax.tree.leaves(shared)] == [(), (), (), (2, 43)]
    assert stage.short_state(begun, 5).inputs["lift"].shape == (5,)


@pytest.mark.long
@pytest.mark.parametrize("method", [co.Midpoint(), co.Suzuki4(co.Midpoint(), negative_substeps="allow")])
def test_driven_chains_in_loops_report_what_xla_reports(method):
    system, runs = driven(41), []
    start = leaning(system, internal={"thrust": np.zeros(41)})
    how = {"dt": H, "steps": 40, "save_every": 8, "method": method, "inputs": DRIVE}
    for chosen in ("auto", "xla"):
        runs.append(co.simulate(system, start, backend=chosen, **how))
    assert [run.plan.backend for run in runs] == ["native", "xla"]
    assert {"work_drag", "work_push", "energy_budget"} <= set(runs[0].monitors)
    assert max(differences(runs[0].records, runs[1].records)) < 1e-8
    assert max(differences(dict(runs[0].monitors), dict(runs[1].monitors))) < 1e-7
    assert max(differences(runs[0].extrema["work_drag"], runs[1].extrema["work_drag"])) < 1e-8
    assert all(run.extrema[name][1] < 1e-12 for run in runs for name in ("balance", "constraint_gap"))


@pytest.mark.long
def test_chains_in_loops_count_the_jumps_of_tables_in_the_lagrangian():
    def lagrangian(xi, n, nu, a, p, *, inputs):
        weight = inputs.gravity * p.masses @ jnp.sum(n * a.y, axis=1)
        return 0.05 * jnp.sum(xi**2) + 0.5 * jnp.sum(p.masses @ nu**2) - weight

    plain = bobs(41)
    system = co.System(
        plain.group, lagrangian, additional=plain.additional, advected=plain.advected, parameters=plain.parameters,
        constraints={"joints": co.Holonomic(joints)},
    )  # fmt: skip
    inputs = {"gravity": co.Held([0.0, 0.2], [9.81, 3.0])}
    run = co.simulate(system, leaning(system, inputs={"gravity": 9.81}), dt=H, steps=40, inputs=inputs, accuracy=False)
    assert run.plan.backend == "native"
    places = np.reshape(run.records.q, (41, 41, 2))  # nodes, links
    work, height = run.monitors["work_inputs"], places[20, :, 1] @ np.linspace(1.0, 2.0, 41)
    assert np.all(work[:20] == 0) and work[20:] == pytest.approx((3.0 - 9.81) * height, rel=1e-9)
    assert abs(height) > 1 and run.summary()["energy_budget_error_max"] < 1e-3


def test_members_in_loops_are_gathered_with_what_they_have():
    def chunk(rows, code):
        limits = {"e": (np.array(-1.0), np.array(2.0))}
        seen = {"e": np.arange(float(rows))}
        return Chunk(np.ones((rows, 2)), np.full(2, rows), rows, code, 3 * rows, 3, seen, limits)

    found = linked_members._gathered([chunk(3, Code.CONVERGED), chunk(1, Code.NOT_CONVERGED)], 3)
    assert found.records.shape == (2, 3, 2) and list(found.rows) == list(found.steps) == [3, 1]
    assert np.array_equal(np.isnan(found.monitors["e"]), [[False] * 3, [False, True, True]])
    assert list(found.code) == [0, 1] and found.extrema["e"][1].shape == (2,) and found.final.shape == (2, 2)
    assert backend._of_members(of_bobs(41)[0]) is linked_members


@pytest.mark.long
def test_ensembles_of_chains_in_loops_report_what_xla_reports():
    masses = co.each([np.linspace(1, 2, 41), np.linspace(2, 1, 41), np.ones(41)])
    system, runs = bobs(41).replace(masses=masses), []
    for chosen in ("auto", "xla"):
        fall = co.Event(lambda s: s.t + s.n[1] - 0.123)
        start = leaning(bobs(41))
        runs.append(co.simulate(system, start, dt=H, steps=40, save_every=8, events={"fall": fall}, backend=chosen))
    assert [run.plan.backend for run in runs] == ["native", "xla"]
    assert max(differences(runs[0].records, runs[1].records)) < 1e-8
    assert max(differences(dict(runs[0].monitors), dict(runs[1].monitors))) < 1e-8
    assert max(differences(runs[0].extrema["energy"], runs[1].extrema["energy"])) < 1e-8


@pytest.mark.long
@pytest.mark.parametrize("members", [None, 2])
def test_steppers_of_chains_in_loops_move_as_xla(members):
    system, seen = driven(41), []
    start = leaning(system, internal={"thrust": np.zeros(41)})
    factor = 1.0 if members is None else np.array([1.0, -1.0])
    for chosen in ("auto", "xla"):
        stepper = co.Stepper(
            system, start, dt=H, inputs={"side": 0.0, "lift": np.zeros(41)}, members=members, backend=chosen,
            observe={"end": lambda s: s.n[-2:], "turning": lambda s: s.xi[0]}, accuracy=False,
        )  # fmt: skip
        found = [stepper.step({"side": factor * np.sin(k)}) for k in range(10)]
        seen.append([np.concatenate([np.ravel(x) for x in each.values()]) for each in found])
        assert isinstance(stepper._engine, LinkedEngine) == (chosen == "auto")
    assert np.max(np.abs(np.array(seen[0]) - seen[1])) < 1e-11
    with pytest.raises(co.errors.ArgumentError, match="cannot be saved"):
        stepper.save("never.stepper")


@pytest.mark.long
def test_a_composed_step_that_fails_leaves_the_state_of_its_node(monkeypatch):
    system = bobs(21)
    program = StepProgram(replace_parameters(system, None), co.Suzuki4(co.Midpoint()))
    state = program.method.begin(system, leaning(system), H)
    given = program, Constants(system.parameters, {})
    good = native.run(*given, state, H, 30, 1, monitors=False)
    failed = native.run(*given, good.final, 40.0, 3, 1, monitors=False)
    assert failed.code and failed.steps == failed.iterations == 0
    assert max(differences(failed.final, good.final)) == 0


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
    monkeypatch.setattr(coupled_links, "LOOPED", 0)
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
