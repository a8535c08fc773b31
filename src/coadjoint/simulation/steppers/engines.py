"""Engines in machine code: one for all steppers of a program in a process, planned once and then found on disk."""

from __future__ import annotations

import base64
import threading
import zlib
from collections import OrderedDict
from collections.abc import Sequence
from typing import Any

from coadjoint.kernels.emit import online
from coadjoint.kernels.emit.plan import plan
from coadjoint.kernels.packing import layout
from coadjoint.kernels.run import disk_cache, plans
from coadjoint.kernels.trace.digest import digest
from coadjoint.kernels.trace.jaxprs import jaxpr_of
from coadjoint.mechanics.state import State
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.simulation.steppers.native import NativeEngine
from coadjoint.simulation.steppers.observing import Watch

KEPT = 32
"""How many engines stay in memory."""

_engines: OrderedDict[tuple[Any, ...], NativeEngine] = OrderedDict()
_lock = threading.Lock()


def native_engine(
    program: StepProgram, watch: Watch, constants: Constants, begun: State, pattern: tuple[int, ...],
    commanded: Sequence[int], width: int,
) -> NativeEngine:  # fmt: skip
    """The engine of a program; constants and begun give shapes, pattern is that of `plan.specialised`.

    Raises Untraceable, naming the primitive, if program or watch are outside the tracer's language.
    """
    watched = digest(jaxpr_of(watch, constants, begun)[0])
    more = pattern, tuple(commanded), width, watched
    key = program, layout(constants), layout(begun), *more
    with _lock:
        if key in _engines:
            _engines.move_to_end(key)
            return _engines[key]
    name = plans.name(program, constants, begun, "stepper", *more)
    found = disk_cache.find(name)
    if found is None:
        planned = plan(program, constants, begun, pattern, False)
        assembly = online.assemble(planned, online.observed(watch, constants, begun), commanded, width)
        disk_cache.keep(name, {"assembly": base64.b64encode(zlib.compress(assembly.encode())).decode()})
    else:
        assembly = zlib.decompress(base64.b64decode(found["assembly"])).decode()
    made = NativeEngine(assembly, width)
    with _lock:
        _engines[key] = made
        while len(_engines) > KEPT:
            _engines.popitem(last=False)
    return made
