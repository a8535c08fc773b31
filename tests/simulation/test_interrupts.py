"""Ctrl-C: machine code runs in pieces that change no number, and what was computed is kept."""

import threading
import time
from typing import Any, NamedTuple, cast
from unittest.mock import Mock

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_store import stopped_after

import coadjoint as co
from coadjoint.kernels.packing import pack
from coadjoint.kernels.run import batch, ensemble, interruptible, native
from coadjoint.mechanics.work_balance import with_ledger
from coadjoint.simulation.event_driver import EventDriver
from coadjoint.simulation.plan import Position

STEPS, EVERY = 300, 20
AT = {"dt": 0.01, "progress": False}


def top(**changes):
    values = {"inertia": np.diag([5.0, 5.0, 1.0]), "weight": 20.0, **changes}
    body = co.System(
        co.SO3(),
        lambda xi, a, p: 0.5 * xi @ p.inertia @ xi - p.weight * a[2],
        advected=co.Defining(),
        parameters=co.Parameters(**values),
    )
    return body, body.state(g=co.attitude.zyx(0, 0, 0.3), xi=[0.1, 0.2, 20], a0=[0, 0, 1])


def failing():
    """A body that meets the logarithm of a negative number at t = 1.005 s; of three, the second one at 0.5 s."""
    body = co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ p.inertia @ xi,
        parameters={"inertia": np.diag([1.0, 2.0, 3.0]), "until": co.each([1.005, 0.505, 99.0])},
        forces=lambda motion, p: co.Force(torque=0.01 * motion.xi * jnp.log(p.until - motion.t)),
    )
    return body, body.state(xi=[0.1, 0.2, 0.3])


@pytest.fixture
def cut(monkeypatch):
    """Calls in pieces of so many steps."""

    def into(steps):
        monkeypatch.setattr(interruptible.PieceLength, "took", lambda *_: None)
        monkeypatch.setattr(
            interruptible.PieceLength, "steps", property(lambda self: steps, lambda self, value: None), raising=False
        )

    return into


def interrupt(monkeypatch, laps):
    """Interrupt after so many pieces."""
    left = iter(range(laps))

    def lap(self, steps):
        if next(left, None) is None:
            raise KeyboardInterrupt

    monkeypatch.setattr(interruptible.Clock, "lap", lap)


def assert_same(one, other):
    for a, b in zip(leaves(one), leaves(other), strict=True):
        np.testing.assert_array_equal(a, b)


def leaves(chunk):
    names = ("records", "final", "steps", "code", "iterations", "iterations_max", "monitors", "extrema")
    return jax.tree.leaves([getattr(chunk, name) for name in names])


@pytest.mark.cases(2)
@pytest.mark.parametrize(("records", "every", "length"), [(40, 1, 7), (8, 5, 7), (8, 5, 13), (1, 40, 3), (3, 17, 17)])
def test_machine_code_in_pieces_gives_the_same_bits(monkeypatch, cut, records, every, length):
    system, start = top()
    plan = co.simulate(system, start, **AT, steps=1).plan
    begun = with_ledger(system, co.Midpoint().begin(system, start, plan.h), True)
    given = (plan.program, plan.constants, begun, plan.h, records, every)
    cut(10**6)
    whole = native.run(*given)
    calls = []
    call = native._call
    monkeypatch.setattr(native, "_call", lambda *a: (calls.append(a), call(*a)))
    cut(length)
    assert_same(native.run(*given), whole)
    assert len(calls) >= records * every / max(length, every)


def test_a_step_that_fails_in_a_later_piece_ends_the_call_there(cut):
    system, start = failing()
    system = system.replace(until=1.005)
    plan = co.simulate(system, start, **AT, steps=1).plan
    begun = with_ledger(system, co.Midpoint().begin(system, start, plan.h), True)
    given = (plan.program, plan.constants, begun, plan.h, 40, 3)
    cut(10**6)
    whole = native.run(*given)
    assert whole.code and 90 < whole.steps < 120
    cut(7)
    assert_same(native.run(*given), whole)


@pytest.mark.long
def test_xla_in_pieces_gives_the_same_bits(cut):
    system, start = top()
    found = []
    for length in (7, 60):
        cut(length)
        found.append(co.trajectory(system, start, dt=0.01, steps=60, save_every=5, backend="xla"))
    np.testing.assert_array_equal(found[0].records.xi, found[1].records.xi)
    np.testing.assert_array_equal(found[0].iterations, found[1].iterations)
    by_machine = co.trajectory(system, start, dt=0.01, steps=60, save_every=5, backend="native")
    np.testing.assert_allclose(found[0].records.xi, by_machine.records.xi, rtol=1e-10)


def test_a_piece_grows_to_its_time_and_shrinks_with_the_speed():
    pace = interruptible.PieceLength()
    for _ in range(12):
        pace.took(pace.steps, pace.steps * 1e-6)
    assert pace.steps == pytest.approx(interruptible.PIECE / 1e-6, rel=1e-6)
    pace.took(pace.steps, pace.steps * 1e-3)
    assert pace.steps == pytest.approx(interruptible.PIECE / 1e-3, rel=1e-6)
    pace.took(1, 10.0)
    assert pace.steps == 1


# What is kept.


@pytest.mark.cases(1)
@pytest.mark.parametrize("looks", [2, 21, 42])
def test_a_run_in_memory_keeps_what_it_has_computed(monkeypatch, looks):
    monkeypatch.setattr("coadjoint.simulation.driver.PATIENCE", 0.0)
    system, start = top()
    whole = co.simulate(system, start, **AT, steps=STEPS, save_every=EVERY)
    with monkeypatch.context() as patched, pytest.raises(co.errors.Interrupted, match=r"error\.run\.final") as stopped:
        stopped_after(patched, looks)
        co.simulate(system, start, **AT, steps=STEPS, save_every=EVERY)
    run = stopped.value.run
    done = run.good_steps
    assert 0 < done < STEPS and run.steps_saved[-1] == done and f"step {done} of {STEPS}" in str(stopped.value)
    kept = len(run.dataset.time) - 1
    np.testing.assert_array_equal(run.dataset.xi[:kept], whole.dataset.xi[:kept])
    assert "stopped before 300" in str(run)
    more = co.simulate(system, run.final, **AT, steps=STEPS - done)
    np.testing.assert_allclose(more.final.mu, whole.final.mu, rtol=1e-11)


def test_an_interrupt_before_the_first_step_keeps_no_run(monkeypatch):
    monkeypatch.setattr("coadjoint.simulation.driver.Driver.drive", Mock(side_effect=KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt) as stopped:
        co.simulate(*top(), **AT, steps=STEPS, accuracy=False, monitors=False)
    assert stopped.type is KeyboardInterrupt


def test_an_interrupt_while_records_are_taken_up_leaves_whole_nodes(monkeypatch):
    system, start = top()
    monkeypatch.setattr("coadjoint.simulation.driver.PATIENCE", 0.0)
    advance, seen = Position.advance, []

    def stop(self, *given):
        seen.append(1)
        if len(seen) == 30:
            raise KeyboardInterrupt
        advance(self, *given)

    with monkeypatch.context() as patched, pytest.raises(co.errors.Interrupted) as stopped:
        patched.setattr("coadjoint.simulation.plan.Position.advance", stop)
        co.simulate(system, start, **AT, steps=STEPS)
    run = stopped.value.run
    assert np.array_equal(run.steps_saved, np.arange(run.good_steps + 1))


@pytest.mark.long
def test_an_ensemble_with_long_blocks_stops_within_one_and_keeps_all_members(monkeypatch):
    monkeypatch.setattr("coadjoint.simulation.driver.PATIENCE", 0.0)
    system, start = failing()
    given: Any = {**AT, "steps": 200, "save_every": 150}
    whole: Any = co.simulate(system, start, **given)
    with monkeypatch.context() as patched:
        patched.setattr("coadjoint.simulation.driver.PATIENCE", 1e9)
        at_once: Any = co.simulate(system, start, **given)
    for name in ("xi", "mu", "energy"):
        np.testing.assert_array_equal(whole.dataset[name], at_once.dataset[name])
    np.testing.assert_array_equal(whole.steps_done, at_once.steps_done)
    np.testing.assert_array_equal(whole.iterations, at_once.iterations)
    with monkeypatch.context() as patched, pytest.raises(co.errors.Interrupted) as stopped:
        stopped_after(patched, 20)
        co.simulate(system, start, **given)
    run = stopped.value.run
    done = run.position.steps
    assert 0 < done < 150 and list(run.steps_saved) == [0, done] and f"{done} steps of 0.01 s each, stopped" in str(run)
    part = co.simulate(system, start, **AT, steps=done)
    np.testing.assert_array_equal(run.final.mu, part.final.mu)


@pytest.mark.long
def test_events_beyond_the_interrupt_are_forgotten(monkeypatch):
    system, start = top()
    given = {**AT, "steps": STEPS, "events": {"section": lambda state: state.xi[0]}}
    monkeypatch.setattr("coadjoint.simulation.driver.PATIENCE", 0.0)
    whole = co.simulate(system, start, **given, monitors=False)
    take, seen = EventDriver._take, []

    def stop(self, *given):
        seen.append(1)
        if len(seen) == 100:
            raise KeyboardInterrupt
        take(self, *given)

    with monkeypatch.context() as patched, pytest.raises(co.errors.Interrupted) as stopped:
        patched.setattr("coadjoint.simulation.event_driver.EventDriver._take", stop)
        co.simulate(system, start, **given, monitors=False)
    run = stopped.value.run
    end = float(run.final.t)
    expected = [t for t in whole.events["section"].t if t <= end]
    assert 0 < len(expected) < len(whole.events["section"].t)
    np.testing.assert_array_equal(run.events["section"].t, expected)


@pytest.mark.cases(1)
@pytest.mark.parametrize("many", [False, pytest.param(True, marks=pytest.mark.long)], ids=["one", "members"])
def test_a_run_on_disk_writes_a_checkpoint_and_goes_on_to_the_same_bits(monkeypatch, tmp_path, many):
    monkeypatch.setattr("coadjoint.simulation.driver.PATIENCE", 0.0)
    system, start = top(**({"weight": co.each([20.0, 21.0, 22.0])} if many else {}))
    given = {**AT, "steps": STEPS, "save_every": EVERY}
    whole = co.simulate(system, start, **given)
    with monkeypatch.context() as patched, pytest.raises(co.errors.Interrupted, match=r"co\.resume\('.*run', system\)"):
        stopped_after(patched, 30)
        co.simulate(system, start, **given, store=tmp_path / "run")
    assert len(co.load(tmp_path / "run").dataset.time) > 1, "none was due"
    run = co.resume(tmp_path / "run", system)
    for name in ("xi", "mu", "energy", "step"):
        np.testing.assert_array_equal(run.dataset[name], whole.dataset[name])


@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_a_trajectory_keeps_its_nodes(monkeypatch, cut, backend):
    system, start = top()
    given = {"dt": 0.01, "steps": 60, "save_every": 5, "backend": backend}
    cut(7)
    whole = co.trajectory(system, start, **given)
    with monkeypatch.context() as patched, pytest.raises(co.errors.Interrupted, match="of 60") as stopped:
        interrupt(patched, 3)
        co.trajectory(system, start, **given)
    part = stopped.value.run
    rows = len(part.records.t)
    assert 2 < rows < 12 and part.final.t > part.records.t[-1]
    np.testing.assert_array_equal(part.records.xi, whole.records.xi[:rows])
    left = 60 - round(float(part.final.t) / 0.01)
    more = co.trajectory(system, part.final, dt=0.01, steps=left, backend=backend)
    np.testing.assert_allclose(more.final.mu, whole.final.mu, rtol=1e-11)


@pytest.mark.cases(1)
@pytest.mark.parametrize(("members", "threads"), [(None, 1), (40, 1), (40, 2)])
def test_a_stepper_stands_where_all_members_have_come_to(monkeypatch, cut, members, threads):
    system, start = top()
    stepper = co.Stepper(system, start, dt=0.01, members=members) if members else co.Stepper(system, start, dt=0.01)
    stepper.threads = threads
    cut(10**6)
    stepper.step(n=100)
    whole = stepper.state
    stepper.reset()
    cut(17)
    stepper.step(n=100)
    assert_states(stepper.state, whole)
    stepper.reset()
    with (
        monkeypatch.context() as patched,
        pytest.raises(co.errors.Interrupted, match="after 51 of 100 steps") as stopped,
    ):
        interrupt(patched, 2)
        stepper.step(n=100)
    assert "step(n=49)" in str(stopped.value) and np.all(stepper.steps == 51)
    stepper.step(n=49)
    assert_states(stepper.state, whole)


def assert_states(one, other):
    np.testing.assert_array_equal(one.xi, other.xi)
    np.testing.assert_array_equal(one.mu, other.mu)


def test_groups_of_members_end_with_the_one_that_they_are_at(monkeypatch):
    called, main = [], threading.get_ident()

    class Slow(NamedTuple):
        pace: Any = None

        def function(self, *_):
            called.append(threading.get_ident() != main)
            time.sleep(0.02)

    def waits(pool, run, firsts):
        for first in firsts:
            pool.submit(run, first)
        time.sleep(0.03)
        raise KeyboardInterrupt

    monkeypatch.setattr(ensemble.ThreadPoolExecutor, "map", waits)
    result = ensemble.LaneArrays(*[np.zeros((100, 4, 1))] * 5)
    with pytest.raises(KeyboardInterrupt):
        ensemble._launch(cast(Any, Slow()), (np.zeros((100, 1)),) * 3, result, 1, 1, 2)
    assert 0 < len(called) < 10


def test_tangents_in_pieces_are_the_same_to_the_bit(cut):
    system, start = top()
    plan = co.simulate(system, start, **AT, steps=1).plan
    begun = with_ledger(system, co.Midpoint().begin(system, start, plan.h), True)
    code = batch.driven(plan.program, plan.constants, begun, [0])
    p, s = pack(plan.constants)[1], pack(begun)[1]
    starts = np.stack([s, s])
    table = batch.grouped(np.zeros((40, 2, 0)))
    path = batch.run(code, p, plan.h, starts, np.zeros(0, int), table)
    found = []
    for length in (10**6, 7):
        cut(length)
        found.append(batch.push(code, p, plan.h, path, np.ones((1, 1)), np.zeros((2, 1, s.size))))
    np.testing.assert_array_equal(*found)
    assert np.any(found[0])
