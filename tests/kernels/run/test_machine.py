"""Machine code is made aside from the main thread, which alone is interrupted."""

from __future__ import annotations

import signal
import threading

import pytest

from coadjoint.kernels.run import machine as module
from coadjoint.kernels.untraceable import Untraceable

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
