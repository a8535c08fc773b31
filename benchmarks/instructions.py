"""Instructions per step by callgrind, where valgrind exists: the difference of two step counts.

Machine code is made for a processor with AVX2 and FMA, the widest that callgrind knows, by the kernels' own pipeline
and by numba's, and runs alone in a small process.
"""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

PROCESSOR = "haswell"
LANES = 4
SHORT, LONG = 500, 100_500


def _for_callgrind() -> None:
    """Let numba make code for that processor; call before numba is imported."""
    os.environ.update(NUMBA_CPU_NAME=PROCESSOR, NUMBA_CPU_FEATURES="")


def measure(quick: bool) -> dict[str, Any]:
    """Instructions per trajectory and step by name; an empty table with the reason where they cannot be counted."""
    if shutil.which("valgrind") is None:
        return {"rows": {}, "reason": "valgrind is not installed"}
    if platform.machine() not in ("x86_64", "AMD64"):
        return {"rows": {}, "reason": f"there is no recipe for {platform.machine()}"}
    _for_callgrind()
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        tasks = dict(_tasks(Path(folder), quick))
        counts = dict(zip(tasks, pool.map(lambda task: _count(*task), tasks.values()), strict=True))
    by_hand = counts["hand-written, numba: left rule"]
    return {"rows": {name: {"instructions": n, "ratio": n / by_hand} for name, n in counts.items()}}


def _tasks(folder: Path, quick: bool) -> Iterator[tuple[str, tuple[Path, int]]]:
    """(name, (task file, trajectories at once))."""
    import coadjoint as co
    from benchmarks.one import PAPER, H
    from benchmarks.problems import heavy_top, ready, vehicle

    yield "hand-written, numba: left rule", (_by_hand(folder), 1)
    top = heavy_top()
    cases = [
        ("native: left rule", vehicle(), PAPER, H, 1),
        (f"native: left rule, {LANES} lanes", vehicle(), PAPER, H, LANES),
        ("native: midpoint", vehicle(), co.Midpoint(), H, 1),
        ("native: left–right pair", vehicle(), co.methods.LeftRight(), H, 1),
        ("native: trapezoidal", vehicle(), co.Trapezoidal(), H, 1),
        ("native: heavy top, left rule", top, co.LeftRectangle(), 1e-4, 1),
    ]
    for name, problem, method, h, width in cases[:1] if quick else cases:
        yield name, (_native(folder / str(abs(hash(name))), ready(problem, method, h), width), width)


def _native(place: Path, ready: Any, width: int) -> Path:
    """The task of a kernel with `width` lanes that all run the same trajectory."""
    import numpy as np

    from coadjoint.kernels.emit.plan import plan, specialised
    from coadjoint.kernels.emit.stepping import NAME, assemble
    from coadjoint.kernels.packing import pack
    from coadjoint.kernels.run.machine import object_code

    (_, p), (_, s) = pack(ready.constants), pack(ready.state)
    planned = plan(ready.program, ready.constants, ready.state, specialised(p), False)
    with _pretending():
        code = object_code(assemble(planned, width))
    p, s, h = (np.repeat(x, width).tolist() for x in (p, s, [ready.h]))
    record = [0.0] * (len(planned.record) * width)
    arguments = [p, h, s, 1, "steps", record, [], [], [0.0] * 4 * width]
    return _write(place, code, NAME, arguments, [])


@contextmanager
def _pretending() -> Iterator[None]:
    """LLVM told that it runs on the processor that callgrind knows."""
    import llvmlite.binding as llvm

    honest = llvm.get_host_cpu_name, llvm.get_host_cpu_features
    llvm.get_host_cpu_name, llvm.get_host_cpu_features = (lambda: PROCESSOR), (lambda: llvm.FeatureMap())
    try:
        yield
    finally:
        llvm.get_host_cpu_name, llvm.get_host_cpu_features = honest


def _by_hand(folder: Path) -> Path:
    """The task of the hand-written loop, from numba's own machine code."""
    from importlib import import_module

    from benchmarks import kernels_yardstick
    from benchmarks.one import H, hand_written
    from benchmarks.problems import vehicle

    numba: Any = import_module("numba")
    types = numba.types
    array = types.CPointer(types.float64)

    @numba.cfunc(types.void(array, types.float64, array, types.int64, types.int64, array))
    def loop(p, h, s, records, every, out):
        q = numba.carray(p, 10)
        numbers = (q[0], q[1], q[2], q[3], q[4], q[5], q[6], q[7], q[8], q[9])
        kernels_yardstick.run(numbers, h, numba.carray(s, 28), records, every, numba.carray(out, (records, 28)))

    library: Any = loop._library
    unused = re.findall(r"declare [^@]*@((?:NRT|numba|Py)_?\w+)\(", library.get_llvm_str())
    unused += ["PyExc_RuntimeError", "PyExc_StopIteration", "PyExc_SystemError"]
    s = hand_written(vehicle(), 1, 1)()[0][0].tolist()
    arguments = [list(map(float, vehicle().body.numbers)), H, s, 1, "steps", [0.0] * 28]
    return _write(folder / "by_hand", library._get_compiled_object(), loop._wrapper_name, arguments, unused)


def _write(place: Path, code: bytes, name: str, arguments: list[Any], unused: list[str]) -> Path:
    place.with_suffix(".o").write_bytes(code)
    task = {"object": str(place.with_suffix(".o")), "name": name, "arguments": arguments, "unused": unused}
    place.with_suffix(".json").write_text(json.dumps(task), encoding="utf-8")
    return place.with_suffix(".json")


def _count(task: Path, trajectories: int) -> float:
    """Instructions per trajectory and step."""
    short, long = (_instructions(task, steps) for steps in (SHORT, LONG))
    return (long - short) / (LONG - SHORT) / trajectories


def _instructions(task: Path, steps: int) -> int:
    program = [sys.executable, "-S", "-B", str(Path(__file__).with_name("counted.py")), str(task), str(steps)]
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", "--smc-check=all-non-file", *program]
    environment = {**os.environ, "PYTHONHASHSEED": "0", "PYTHONPATH": ":".join(sys.path)}
    found = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300, check=False)
    match = re.search(r"Collected : (\d+)", found.stderr)
    if found.returncode or match is None:
        raise RuntimeError(f"callgrind failed: {found.stderr.strip().splitlines()[-1:]}")
    return int(match.group(1))
