"""Machine code is made aside from the main thread, which alone is interrupted."""

from __future__ import annotations

import signal
import threading

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.emit import FEW_PASSES
from coadjoint.kernels.run import machine as module
from coadjoint.kernels.run import native
from coadjoint.kernels.untraceable import Untraceable
from pinned import body, pinned, start

NINE = "define i64 @nine() { ret i64 9 }"


def test_an_interrupt_leaves_llvm_to_its_end(monkeypatch):
    """It would find objects that LLVM and Python both think they own, and free them twice."""
    went_on, who, compiled = threading.Event(), [], module.compiled

    def slow(assembly: str) -> bytes:
        who.append(threading.current_thread())
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
        went_on.wait(20.0)
        return compiled(assembly)

    monkeypatch.setattr(module, "compiled", slow)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background command ignores it
    try:
        with pytest.raises(KeyboardInterrupt):
            module.machine(NINE)
    finally:
        signal.signal(signal.SIGINT, before)
    went_on.set()
    who[0].join(20.0)
    assert who[0] is not threading.main_thread() and not who[0].is_alive()
    monkeypatch.undo()
    assert module.machine(NINE).function("nine", result=module.ctypes.c_int64)() == 9


def test_what_llvm_refuses_is_told_from_any_thread():
    with pytest.raises(Untraceable, match="LLVM refused"):
        module.machine("no assembly")
    found = []
    thread = threading.Thread(target=lambda: found.append(module.machine(NINE)))
    thread.start()
    thread.join()
    assert found[0].function("nine", result=module.ctypes.c_int64)() == 9


def test_code_that_is_not_optimised_gives_the_same_and_has_another_name(monkeypatch):
    """Both levels keep the order of operations; products and sums may fuse in optimised code."""
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ (jnp.array([1.0, 2.0, 3.0]) * xi))
    found, names = [], []
    for level in ("1", "0"):
        monkeypatch.setenv("COADJOINT_OPTIMIZE", level)
        module.processor.cache_clear()
        names.append(module.name_of(NINE))
        run = co.simulate(body, body.state(xi=[0.3, 1.0, 0.2]), dt=0.1, steps=50, monitors=False, backend="native")
        found.append(run.records.g)
    module.processor.cache_clear()
    np.testing.assert_allclose(*found, atol=1e-13)
    assert len(set(names)) == 2


def test_a_module_marked_for_few_passes_runs():
    assert module.machine(f"{NINE}\n!{FEW_PASSES} = !{{}}").function("nine", result=module.ctypes.c_int64)() == 9


@pytest.mark.long
def test_steps_with_multipliers_are_compiled_by_few_passes_to_the_same_motion(monkeypatch):
    texts, compiled, made = [], module.object_code, []
    monkeypatch.setattr(module, "object_code", lambda text: (texts.append(text), compiled(text))[1])
    for system in (body(), pinned()):
        made.append(co.simulate(system, start(system), dt=0.01, steps=50, monitors=False, accuracy=False).final)
    assert [FEW_PASSES in text for text in texts] == [False, True]
    monkeypatch.setattr(module, "FEW_PASSES", "no such mark")
    thorough = module.Machine(compiled(texts[1]))
    monkeypatch.setattr(native, "machine", lambda text: thorough)
    native._kernels.clear()
    system = pinned()
    again = co.simulate(system, start(system), dt=0.01, steps=50, monitors=False, accuracy=False).final
    assert np.max(np.abs(again.mu - made[1].mu)) < 1e-13 and np.max(np.abs(again.n - made[1].n)) < 1e-14
