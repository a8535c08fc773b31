"""Functions of arrays as LLVM code that XLA's programs call on CPUs, by XLA's foreign function interface.

The addresses are those of `xla/ffi/api/c_api.h`, version 0.1 and later of its stable binary interface.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from llvmlite import ir

from coadjoint.kernels.emit.emitter import Value
from coadjoint.kernels.emit.loops import INT64, Loops

INT32, PLACE = ir.IntType(32), ir.IntType(8).as_pointer()

EXTENSION, STAGE, ARGUMENTS, RESULTS = 8, 32, 72, 112
"""The addresses in a call frame: first extension, stage, buffers of the arguments and of the results."""
DATA, RANK, SIZES = 24, 32, 40
"""Those in a buffer."""
KIND, METADATA, MAJOR = 8, 24, 24
"""Those in an extension, and of the version in the metadata, which asks for the interface that the code is made for."""
EXECUTE, ASKS = 3, 1
"""The stage of a call, and the kind of extension that asks for metadata."""
VERSION = (0, 1)

Emit = Callable[[ir.Module, str], None]
"""Writes a function of this name, with `xla_call`, into a module."""


def xla_call(module: ir.Module, name: str, body: Value, inputs: Sequence[ir.Type], results: Sequence[ir.Type]) -> None:
    """Error* name(CallFrame*): calls body(n, *arrays), n the last size of the first input, and returns no error.

    body: a function of the module. inputs, results: the types of pointers to the numbers of arrays.
    """
    f = Loops(module, name, PLACE, PLACE, inside=False)
    (frame,) = f.args
    asked = _load(f, frame, EXTENSION, PLACE)
    with f.b.if_then(f.b.icmp_unsigned("!=", asked, PLACE(None))):
        with f.b.if_then(f.b.icmp_signed("==", _load(f, asked, KIND, INT32), INT32(ASKS))):
            about = _load(f, asked, METADATA, PLACE)
            for k, number in enumerate(VERSION):
                f.b.store(INT32(number), _place(f, about, MAJOR + 4 * k, INT32))
        f.b.ret(PLACE(None))
    with f.b.if_then(f.b.icmp_signed("!=", _load(f, frame, STAGE, INT32), INT32(EXECUTE))):
        f.b.ret(PLACE(None))
    given, found = (_load(f, frame, at, PLACE) for at in (ARGUMENTS, RESULTS))
    first = _load(f, given, 0, PLACE)
    last = f.b.sub(_load(f, first, RANK, INT64), INT64(1))
    size = f.at(_load(f, first, SIZES, INT64.as_pointer()), last)
    arrays = [
        _load(f, _load(f, buffers, 8 * k, PLACE), DATA, kind)
        for buffers, kinds in ((given, inputs), (found, results))
        for k, kind in enumerate(kinds)
    ]
    f.b.call(body, [size, *arrays])
    f.b.ret(PLACE(None))


def _place(f: Loops, start: Value, offset: int, kind: ir.Type) -> Value:
    return f.b.bitcast(f.b.gep(start, [INT64(offset)]), kind.as_pointer())


def _load(f: Loops, start: Value, offset: int, kind: ir.Type) -> Value:
    return f.b.load(_place(f, start, offset, kind))
