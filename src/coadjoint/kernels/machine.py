"""Machine code from LLVM assembly, and the functions in it."""

from __future__ import annotations

import ctypes
import threading
from typing import Any

import llvmlite.binding as llvm

_lock = threading.Lock()
_ready = False


def _target() -> llvm.TargetMachine:
    """This machine's processor, at the highest level of optimisation."""
    global _ready
    with _lock:
        if not _ready:
            llvm.initialize_native_target()
            llvm.initialize_native_asmprinter()
            # Elementary functions come from the C library's libm; NumPy has loaded it already.
            _ready = True
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=3, jit=True
    )


def object_code(assembly: str) -> bytes:
    """Optimised machine code of a module."""
    machine = _target()
    module = llvm.parse_assembly(assembly)
    module.triple = machine.triple
    module.data_layout = str(machine.target_data)
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.slp_vectorization = False
    options.loop_unrolling = False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return machine.emit_object(module)


def machine(assembly: str) -> Machine:
    """A module, compiled and loaded."""
    return Machine(object_code(assembly))


class Machine:
    """Machine code in memory; its functions live as long as this object."""

    def __init__(self, code: bytes) -> None:
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()

    def function(self, name: str, *arguments: type) -> Any:
        """A void function by its name; calling it lets other threads run."""
        return ctypes.CFUNCTYPE(None, *arguments)(self._engine.get_function_address(name))
