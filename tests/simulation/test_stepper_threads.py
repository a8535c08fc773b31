"""Threads, forks and interrupts: one thread at a time has a stepper's memory, and nothing hangs or is torn."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import StepError
from driven_body import BODY, OBSERVE, REST, SEED, H, same, stepper

THREADS = 8


@pytest.fixture(scope="module")
def single() -> co.Stepper:
    return stepper()


@pytest.fixture(scope="module")
def many() -> co.Stepper:
    spins = np.random.default_rng(SEED).normal(size=(67, 3))
    start = BODY.state(xi=co.each(spins), inputs=REST, internal={"brake": 0.1})
    return co.Stepper(BODY, start, dt=H, inputs=REST, observe=OBSERVE)


def at_once(call) -> list:
    """The results of call(index) by eight threads that begin together."""
    barrier = threading.Barrier(THREADS)

    def begin(index):
        barrier.wait()
        return call(index)

    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(begin, range(THREADS)))


@pytest.mark.long
def test_eight_threads_step_clones_of_their_own_to_the_same_bits(many):
    spins = np.random.default_rng(SEED).normal(size=(200, many.face.count))
    many.reset()
    clones = [many.clone() for _ in range(THREADS)]

    def go(body):
        for spin in spins:
            body.step({"spin": spin})

    at_once(lambda index: go(clones[index]))
    alone = many.clone()
    alone.threads = 3
    go(alone)
    assert all(same(body.state, alone.state) for body in clones)


@pytest.mark.long
def test_eight_threads_on_one_stepper_step_or_are_told_to_take_a_clone(single):
    body, calls = single.clone(), 300
    body.reset()

    def go(index):
        done = 0
        for k in range(calls):
            try:
                if k % 50 == 49:
                    body.change(lag=0.3 + 0.01 * index)
                else:
                    body.step({"spin": 0.1}, n=20)
                    done += 20
            except StepError as error:
                assert "give each thread a clone()" in str(error)
        return done

    done = at_once(go)
    assert body.steps == sum(done) > 0
    assert body.t == pytest.approx(H * body.steps, rel=1e-12)


def test_copies_and_states_are_never_torn_while_another_thread_steps(many):
    """All members are the same, and a state that is read shows them so."""
    start = jax.tree.map(lambda leaf: np.broadcast_to(leaf[:1], leaf.shape).copy(), many.state)
    body, going = many.clone(), True
    body.restore(start)

    def go():
        while going:
            body.step(n=10)

    worker = threading.Thread(target=go)
    worker.start()
    try:
        other = many.clone()
        for _ in range(40):
            other.restore(body)
            for state in (body.state, body.clone().state, other.state):
                assert len(set(state.t)) == 1
                assert np.array_equal(state.mu, np.broadcast_to(state.mu[0], state.mu.shape))
    finally:
        going = False
        worker.join()


def test_two_that_are_restored_to_each_other_do_not_wait_for_ever(single):
    pair = single.clone(), single.clone()

    def go(index):
        for _ in range(200):
            with contextlib.suppress(StepError):
                pair[index % 2].restore(pair[1 - index % 2])

    at_once(go)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork.*")
def test_a_fork_steps_with_threads_of_its_own(many):
    body = many.clone()
    body.reset()
    body.threads = 2
    body.step(n=3)  # the threads of this process are there
    body._turn.lock.acquire()
    child = []

    def fork():
        child.append(os.fork())
        if child[0] == 0:
            code = 1
            try:
                body.step(n=4)
                code = 0 if body.steps[0] == 7 else 2
            finally:
                os._exit(code)

    # The thread that had the lock does not live in the fork.
    worker = threading.Thread(target=fork)
    worker.start()
    worker.join()
    body._turn.lock.release()
    for _ in range(600):
        ended, status = os.waitpid(child[0], os.WNOHANG)
        if ended:
            break
        time.sleep(0.05)
    else:
        os.kill(child[0], 9)
        os.waitpid(child[0], 0)
        pytest.fail("the fork hangs")
    assert os.waitstatus_to_exitcode(status) == 0


def test_after_an_interrupt_no_thread_is_left_in_the_memory(monkeypatch):
    start = BODY.state(
        xi=co.each(np.random.default_rng(SEED).normal(size=(67, 3))), inputs=REST, internal={"brake": 0.1}
    )
    body = co.Stepper(BODY, start, dt=H, inputs=REST, observe=OBSERVE, threads=2, accuracy=False)
    engine, inside, calls = body._engine, [], []
    function = engine._function

    def slow(context, first, last, steps):
        calls.append(first)
        if first == 0:
            raise KeyboardInterrupt
        inside.append(1)
        time.sleep(0.3)
        told = function(context, first, last, steps)
        inside.pop()
        return told

    monkeypatch.setattr(engine, "_function", slow)
    with pytest.raises(KeyboardInterrupt):
        body.step()
    assert len(calls) == 2 and not inside
    monkeypatch.undo()
    body.reset()
    body.step()
    assert np.all(body.steps == 1)
