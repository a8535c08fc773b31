"""Machine code from LLVM assembly, and the functions in it."""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import llvmlite.binding as llvm

from coadjoint.kernels import store
from coadjoint.kernels.emit import FEW_PASSES
from coadjoint.kernels.untraceable import Untraceable

_RECIPE = "1"
"""Changes whenever `object_code` would make other code of the same assembly."""

LONG = 10_000_000
"""Characters of assembly from which code is made in a fifth of the time, which takes three times as long to run."""

PASSES = ("sroa", "reassociate", "instruction_combine", "simplify_cfg", "dead_store_elimination")
"""The passes of LLVM for a module marked `FEW_PASSES`, in their order."""

Made = TypeVar("Made")

_lock = threading.Lock()
_ready = False


def optimised() -> bool:
    """Whether LLVM optimises: it does unless COADJOINT_OPTIMIZE is 0, for many programs that take few steps each."""
    return os.environ.get("COADJOINT_OPTIMIZE") != "0"


def _target(plain: bool = False, triple: str = "", cpu: str = "") -> llvm.TargetMachine:
    """This machine's processor, at the highest level of optimisation or at none, as for `plain` instructions.

    triple, cpu: for linkers, of this machine or of another, by default for memory of this process.
    """
    global _ready
    with _lock:
        if not _ready:
            llvm.initialize_native_target()
            llvm.initialize_native_asmprinter()
            _ready = True
    level = 3 if optimised() and not plain else 0
    features = llvm.get_host_cpu_features().flatten() if cpu or not triple else ""
    if triple:
        return llvm.Target.from_triple(triple).create_target_machine(cpu, features, opt=level, reloc="pic")
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=level, jit=True)


def object_code(assembly: str, triple: str = "", cpu: str = "") -> bytes:
    """Machine code of a module; a long one gets plain instructions, since choosing the best would take a minute.

    triple, cpu: as of `_target`.
    """
    machine = _target(len(assembly) > LONG, triple, cpu)
    module = llvm.parse_assembly(assembly if optimised() else _as_written(assembly))
    module.triple = machine.triple
    module.data_layout = str(machine.target_data)
    if not optimised():
        return machine.emit_object(module)
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    # Grouping scalars of one trajectory into vectors takes most of the compilation and gains nothing.
    options.slp_vectorization = False
    options.loop_unrolling = False
    builder = llvm.create_pass_builder(machine, options)
    if FEW_PASSES in assembly:
        passes = llvm.create_new_function_pass_manager()
        for name in PASSES:
            getattr(passes, f"add_{name}_pass")()
        for function in module.functions:
            if not function.is_declaration:
                passes.run(function, builder)
    else:
        builder.getModulePassManager().run(module, builder)
    return machine.emit_object(module)


def _as_written(assembly: str) -> str:
    """The assembly without leave to fuse or reorder operations: LLVM would still fuse some, depending on the others."""
    for flag in ("contract", "reassoc", "nsz"):
        assembly = assembly.replace(f" {flag} ", " ")
    return assembly


def machine(assembly: str) -> Machine:
    """A module, compiled or taken from the store, and loaded."""
    try:
        return _aside(lambda: Machine(compiled(assembly), name_of(assembly)))
    except RuntimeError as error:
        raise Untraceable("step", f"LLVM refused its code ({str(error).splitlines()[0]})") from None


def kept_machine(name: str) -> Machine | None:
    """The module of this name from the store, loaded, or None."""
    code = store.fetch(name)
    return None if code is None else _aside(lambda: Machine(code, name))


def name_of(assembly: str) -> str:
    """The name of a module's machine code in the store."""
    return store.key(_RECIPE, *processor(), assembly)


def _aside(make: Callable[[], Made]) -> Made:
    """The result or the error of `make`, in a separate thread if this is the main one.

    An interrupt reaches the main thread only. Between a call of LLVM and the record in Python of the owner of its
    result, it would leave memory that is freed twice. The thread continues to its end.
    """
    if threading.current_thread() is not threading.main_thread():
        return make()
    made: list[Made] = []
    failed: list[BaseException] = []

    def run() -> None:
        try:
            made.append(make())
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=run, name="coadjoint compiles")
    thread.start()
    thread.join()
    if failed:
        raise failed[0]
    return made[0]


def compiled(assembly: str) -> bytes:
    """The machine code of a module for this processor, compiled or taken from the store."""
    name = name_of(assembly)
    code = store.fetch(name)
    if code is None:
        code = object_code(assembly)
        store.keep(name, code)
    return code


@cache
def processor() -> tuple[str, ...]:
    """What machine code depends on in addition to the assembly: LLVM, the kind of machine, its features, and the level
    of optimisation where it is not the highest."""
    version = ".".join(map(str, llvm.llvm_version_info))
    features = llvm.get_host_cpu_features().flatten()
    level = () if optimised() else ("not optimised",)
    return version, llvm.get_process_triple(), llvm.get_host_cpu_name(), features, *level


def lanes() -> int:
    """The number of doubles in the widest vectors of this processor."""
    features = llvm.get_host_cpu_features()
    if features.get("avx512f"):
        return 8
    return 4 if features.get("avx") else 2


def is_for_this_machine(code: bytes) -> bool:
    """Whether the head of an object file names this machine; LLVM loads that of any other, too."""
    return _named(code) == _own_name()


@cache
def _own_name() -> bytes:
    return _named(object_code(""))


def _named(code: bytes) -> bytes:
    """The format, and the number of the machine, in the head of ELF, Mach-O or COFF."""
    if code[:4] == b"\x7fELF":
        return code[:6] + code[18:20]
    return code[:8] if code[1:4] == b"\xfa\xed\xfe" else code[:2]


class Machine:
    """Machine code in memory; its functions live as long as this object.

    Elementary functions come from the C library's libm, which NumPy has loaded.
    """

    def __init__(self, code: bytes, name: str = "") -> None:
        """name: that of the code in the store, if it is there."""
        self.name = name
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()

    def function(self, name: str, *arguments: type, result: type | None = None) -> Any:
        """A function by its name, void unless it has a result; calling it lets other threads run."""
        return ctypes.CFUNCTYPE(result, *arguments)(self._engine.get_function_address(name))
