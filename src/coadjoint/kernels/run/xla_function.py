"""Machine code of the library within XLA's programs on CPUs, beside the same function in JAX everywhere else."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache

import jax
from jax import lax
from llvmlite import ir

from coadjoint.arrays import Array, PyTree
from coadjoint.kernels.emit.xla_call import Emit
from coadjoint.kernels.run.machine import machine
from coadjoint.kernels.trace.control import PLAIN

PREFIX = "coadjoint_"
"""How the names of all such functions begin."""

_emits: dict[str, Emit] = {}
_kept: list[object] = []


class XlaFunction:
    """A function of arrays that XLA's programs run as machine code on CPUs, and as JAX on other platforms.

    name: of letters, with PREFIX. emit: writes the machine code. plain: the same function in JAX, which numbers without
    XLA and derivatives are computed by. Of members the machine code runs one after the other.
    """

    def __init__(self, name: str, emit: Emit, plain: Callable[..., tuple[Array, ...]]):
        self.name, self.plain = PREFIX + name, plain
        _emits[self.name], PLAIN[self.name] = emit, plain

    def __call__(self, *arrays: Array) -> PyTree:
        """The results of `plain`, a tuple; without derivatives."""
        if not ready(self.name):
            return self.plain(*arrays)
        results = jax.eval_shape(self.plain, *arrays)
        native = jax.ffi.ffi_call(self.name, results, vmap_method="sequential")
        return lax.platform_dependent(*arrays, cpu=native, default=self.plain)


@cache
def ready(name: str) -> bool:
    """Whether XLA can call this function: it is emitted, and known to XLA from now on."""
    if name not in _emits:
        return False
    module = ir.Module(name="coadjoint")
    _emits[name](module, name)
    code = machine(str(module))
    _kept.append(code)  # XLA calls it as long as the process lives
    capsule = ctypes.pythonapi.PyCapsule_New
    capsule.restype, capsule.argtypes = ctypes.py_object, (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
    place = ctypes.cast(code.function(name), ctypes.c_void_p)
    try:
        jax.ffi.register_ffi_target(name, capsule(place, None, None), platform="cpu")
    except Exception:  # an XLA with another interface
        return False
    return True
