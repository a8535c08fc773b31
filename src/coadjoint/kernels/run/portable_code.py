"""Modules of LLVM assembly as one, and machine code that leaves the process: position-independent, also for others."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from functools import cache

import llvmlite.binding as llvm

from coadjoint.errors import ArgumentError, shown
from coadjoint.kernels.run.machine import object_code

_lock = threading.Lock()


def linked(parts: Mapping[str, tuple[str, str]]) -> str:
    """One module with a function for each name, from name → (assembly, the name of the function in it).

    All other functions become internal. Functions call each other by addresses only, so that each runs the instructions
    that it runs alone.
    """
    joined = llvm.parse_assembly("")
    for name, (assembly, entry) in parts.items():
        module = llvm.parse_assembly(assembly)
        for function in module.functions:
            if function.name == entry:
                function.name = name
            elif not function.is_declaration:
                function.linkage = "internal"
        joined.link_in(module)
    return str(joined)


def exported_code(assembly: str, target: str | None = None) -> bytes:
    """An object file of a module, for linkers: for this processor, or for the oldest of another target.

    target: a triple such as "aarch64-linux-gnu". Raises ArgumentError for one that LLVM does not know.
    """
    if target is None:
        return object_code(assembly, llvm.get_process_triple(), llvm.get_host_cpu_name())
    _know_all()
    try:
        llvm.Target.from_triple(target)
    except RuntimeError:
        raise ArgumentError(
            f'Argument `target` must be a triple that LLVM knows, such as "aarch64-linux-gnu", but is {shown(target)}.'
        ) from None
    return object_code(assembly, target)


@cache
def _know_all() -> None:
    with _lock:
        llvm.initialize_all_targets()
        llvm.initialize_all_asmprinters()
