"""Loads machine code and calls it once, nothing else: the program that callgrind watches.

    python counted.py TASK.json STEPS

It imports neither NumPy nor JAX, so that starting costs little under callgrind.
"""

from __future__ import annotations

import ctypes
import json
import sys

import llvmlite.binding as llvm


def _nothing() -> None:
    """Stands for symbols that are linked but never called."""


def main(task: str, steps: int) -> None:
    """Call the function of the task with `steps` in the place of "steps"."""
    with open(task, encoding="utf-8") as file:
        given = json.load(file)
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    unused = ctypes.CFUNCTYPE(None)(_nothing)
    for name in given["unused"]:
        llvm.add_symbol(name, ctypes.cast(unused, ctypes.c_void_p).value)
    machine = llvm.Target.from_default_triple().create_target_machine(jit=True)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_path(given["object"]))
    engine.finalize_object()
    kinds, values = [], []
    for value in given["arguments"]:
        if value == "steps" or isinstance(value, int):
            kinds.append(ctypes.c_int64)
            values.append(steps if value == "steps" else value)
        elif isinstance(value, float):
            kinds.append(ctypes.c_double)
            values.append(value)
        else:
            kinds.append(ctypes.c_void_p)
            values.append((ctypes.c_double * max(len(value), 1))(*value))
    ctypes.CFUNCTYPE(None, *kinds)(engine.get_function_address(given["name"]))(*values)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
