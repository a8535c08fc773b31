"""Ctrl-C that is lost where it comes, as in a callback of the garbage collector, ends a call all the same."""

from __future__ import annotations

import gc
import shutil
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.interrupts import deferred_interrupts, look
from coadjoint.kernels.run import ensemble, interruptible, native
from coadjoint.simulation.steppers.interface import NativeEngine

STEPS = 300
AT = {"dt": 0.01, "steps": STEPS, "progress": False}


@pytest.fixture(autouse=True)
def _ctrl_c():
    """Ctrl-C as a shell in the foreground gives it; a process in the background starts with none."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def body(**changes):
    system = co.System(
        co.SO3(), lambda xi, p: 0.5 * p.scale * xi @ (np.array([1.0, 2.0, 3.0]) * xi), parameters={"scale": 1.0}
    ).replace(**changes)
    return system, system.state(xi=[0.1, 0.2, 0.3])


def ignored_interrupt() -> None:
    """Collect garbage, in a callback of which an interrupt comes."""

    def callback(phase: str, info: Any) -> None:
        if phase == "start":
            signal.raise_signal(signal.SIGINT)

    gc.callbacks.append(callback)
    try:
        gc.collect()
    finally:
        gc.callbacks.remove(callback)


def dropped_interrupt() -> None:
    """An interrupt comes where another library drops it."""
    with suppress(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def after(calls: int, run: Callable[..., Any], lose: Callable[[], None]) -> Callable[..., Any]:
    """`run`, before which an interrupt is lost at one of its calls."""
    left = iter(range(calls + 1))

    def called(*given: Any, **options: Any) -> Any:
        if next(left, None) == calls:
            lose()
        return run(*given, **options)

    return called


@pytest.mark.long
@pytest.mark.cases(4)
@pytest.mark.parametrize("lose", [ignored_interrupt, dropped_interrupt])
@pytest.mark.parametrize("call", ["simulate", "store", "members", "trajectory", "stepper"])
def test_it_ends_the_call_and_keeps_what_was_computed(monkeypatch, tmp_path, capfd, call, lose):
    system, start = body(**({"scale": co.each([1.0, 1.5, 2.0])} if call == "members" else {}))
    stepper = co.Stepper(system, start, dt=0.01) if call == "stepper" else None
    monkeypatch.setattr("coadjoint.simulation.driver.PATIENCE", 0.0)
    monkeypatch.setattr(interruptible.PieceLength, "took", lambda *_: None)
    runs: dict[str, Callable[[], Any]] = {
        "simulate": lambda: co.simulate(system, start, **AT),
        "members": lambda: co.simulate(system, start, **AT),
        "store": lambda: co.simulate(system, start, **AT, store=tmp_path / "run"),
        "trajectory": lambda: co.trajectory(system, start, dt=0.01, steps=STEPS),
        "stepper": lambda: stepper and stepper.step(n=STEPS),
    }
    runs[call]()
    shutil.rmtree(tmp_path / "run", ignore_errors=True)
    before = sys.unraisablehook
    monkeypatch.setattr(native, "_call", after(9, native._call, lose))
    monkeypatch.setattr(ensemble, "_launch", after(9, ensemble._launch, lose))
    monkeypatch.setattr(NativeEngine, "advance", after(9, NativeEngine.advance, lose))
    with pytest.raises(co.errors.Interrupted) as stopped:
        runs[call]()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert sys.unraisablehook is before and "ignored" not in capfd.readouterr().err
    if call != "stepper":
        assert 0 < np.max(stopped.value.run.final.t) < 0.01 * STEPS
    runs[call]()  # which nothing interrupts


@pytest.mark.long
@pytest.mark.parametrize("at", [0, 1], ids=["system", "state"])
def test_it_ends_what_reads_a_lagrangian(at):
    armed = [False]

    def lagrangian(xi):
        if armed[0]:
            armed[0] = False
            ignored_interrupt()
        return 0.5 * xi @ xi

    armed[0] = at == 0
    with pytest.raises(KeyboardInterrupt):
        system = co.System(co.SO3(), lagrangian)
        armed[0] = True
        system.state(xi=[0.1, 0.2, 0.3])
    assert not armed[0], "it was not read"


@pytest.mark.long
def test_it_is_told_at_the_end_of_a_call_that_does_not_look_and_not_in_the_next():
    with pytest.raises(KeyboardInterrupt), deferred_interrupts():
        ignored_interrupt()
    look()
    with pytest.raises(ValueError, match="another"), deferred_interrupts():
        ignored_interrupt()
        raise ValueError("another")
    look()
    with deferred_interrupts(), pytest.raises(KeyboardInterrupt), deferred_interrupts():
        ignored_interrupt()
        look()


def test_what_else_python_ignores_is_told_as_before(monkeypatch):
    told = []
    monkeypatch.setattr(sys, "unraisablehook", lambda it: told.append(it.exc_type))

    class Failing:
        def __del__(self):
            raise ValueError

    with deferred_interrupts():
        Failing()
    assert told == [ValueError]


def test_a_handler_of_the_caller_stays(monkeypatch):
    came = []
    before = signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    try:
        with deferred_interrupts():
            signal.raise_signal(signal.SIGINT)
        look()
    finally:
        signal.signal(signal.SIGINT, before)
    assert came == [signal.SIGINT]
