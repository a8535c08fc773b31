"""Functions of a program that XLA compiles, with options for the structure of its steps, kept on disk.

An executable of XLA is found, without a trace, under the identity of its program, as plans of machine code are
(`kernels.run.plans`), and is executed like machine code: files are sealed (`kernels.store`).
"""

from __future__ import annotations

import os
import pickle
import re
import threading
from collections import OrderedDict
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from typing import Any, NamedTuple, TypeVar

import jax
import numpy as np
from jax.experimental import serialize_executable

from coadjoint.arrays import PyTree
from coadjoint.collector import collector_off
from coadjoint.kernels import store
from coadjoint.kernels.program import Program
from coadjoint.kernels.run import plans
from coadjoint.kernels.run.xla_function import PREFIX, ready
from coadjoint.kernels.trace.evaluate import Tabulated, tabulate
from coadjoint.kernels.trace.library import edited

MANY_SMALL = (("xla_cpu_use_fusion_emitters", False),)
"""Options for steps of links, and of one field by iterations of a fixed point: XLA writes each of their some 400 small
loops itself, in place of going through MLIR, which takes two thirds of the time to compile and as long to run. JAX 0.12
has no such option."""

LAPACK = "lapack_"
"""Functions outside of an executable that another process has at its disposal when JAX has loaded LAPACK; the others
are the library's own machine code."""
_CALLED = re.compile(r"custom_call @(\w+)")

Key = tuple[Program, PyTree, tuple[tuple[str, tuple[int, ...]], ...], tuple[tuple[str, Any], ...]]

KEPT = 32
"""The most executables that stay in memory."""

Made = TypeVar("Made")


class _Kept(NamedTuple):
    """An executable as it is stored: the leaves of its result are numbered in `result`.

    called: the names of machine code of the library that it calls. lapack: whether it calls LAPACK.
    """

    executable: bytes
    result: PyTree
    called: tuple[str, ...]
    lapack: bool


class Compiled:
    """`jax.jit` of a function whose first argument is a program, with the options for its steps.

    Called with all `static` arguments by keyword, it finds and keeps executables of programs whose identity is known.
    static: the names of further arguments that are not arrays.
    """

    def __init__(self, function: Callable[..., PyTree], static: tuple[str, ...]):
        self.function, self.static = function, static
        self._version = cache(self._jitted)
        self._ready: OrderedDict[Key, Callable[..., PyTree] | None] = OrderedDict()
        """Executables; None for those that JAX keeps in memory alone."""
        self._by_numpy: OrderedDict[Key, Tabulated] = OrderedDict()
        self._lock = threading.Lock()

    def __call__(self, program: Program, *args: object, **keywords: object) -> Any:
        ready = self._found(program, args, keywords) if keywords.keys() == set(self.static) else None
        if ready is not None:
            return ready(*args)
        return self._version(_options(program))(program, *args, **keywords)

    def _jitted(self, options: tuple[tuple[str, PyTree], ...]) -> Callable[..., PyTree]:
        return jax.jit(self.function, static_argnames=("program", *self.static), compiler_options=dict(options))

    def _found(self, program: Program, args: tuple, keywords: dict[str, Any]) -> Callable[..., PyTree] | None:
        """The executable for arguments of these types; None if the identity of the program is unknown."""
        chosen = tuple(sorted(keywords.items()))
        key = program, jax.tree.structure(args), _types(args), chosen
        return self._once(self._ready, key, lambda: self._executable(key, program, args, keywords))

    def by_numpy(self, program: Program, *args: object) -> PyTree:
        """The function of arrays of NumPy, traced once for their types: for few calls, as each takes some 15 times as
        long as by XLA, which takes seconds to compile."""
        key = program, jax.tree.structure(args), _types(args), ()

        def traced() -> Tabulated:
            name = plans.name(program, args, (), "numpy", self.function.__qualname__, _types(args))
            with collector_off():
                return tabulate(partial(self.function, program), *args, name=name)

        return self._once(self._by_numpy, key, traced)(*args)

    def _once(self, known: OrderedDict[Key, Made], key: Key, make: Callable[[], Made]) -> Made:
        """The value under a key, made at its first use; the oldest ones are dropped."""
        with self._lock:
            if key in known:
                known.move_to_end(key)
                return known[key]
        made = make()
        with self._lock:
            known[key] = made
            while len(known) > KEPT:
                known.popitem(last=False)
        return made

    def _executable(
        self, key: Key, program: Program, args: tuple, keywords: dict[str, PyTree]
    ) -> Callable[..., PyTree] | None:
        chosen = key[3]
        how = self.function.__qualname__, chosen, _options(program), os.environ.get("XLA_FLAGS", "")
        name = plans.name(program, args, (), "xla", *how, _types(args)) if jax.default_backend() == "cpu" else None
        return None if name is None else _loaded(name, args) or self._made(name, program, args, keywords)

    def _made(self, name: str, program: Program, args: tuple, keywords: dict[str, Any]) -> Callable[..., PyTree]:
        """The executable, compiled now, and stored if another process can run it."""
        alone = jax.jit(partial(self.function, program, **keywords), compiler_options=dict(_options(program)))
        with collector_off():
            lowered = alone.lower(*args)
            made = lowered.compile()
        called = set(_CALLED.findall(lowered.as_text()))
        if edited() or not all(name.startswith((LAPACK, PREFIX)) for name in called):
            return made
        with suppress(Exception):  # constants that it holds, or an object without a form in a file
            executable, _, structure = serialize_executable.serialize(made)
            numbered = jax.tree.unflatten(structure, range(structure.num_leaves))
            own = tuple(sorted(name for name in called if name.startswith(PREFIX)))
            lapack = any(name.startswith(LAPACK) for name in called)
            store.keep(name, pickle.dumps(_Kept(executable, numbered, own, lapack)))
        return made


def compiled(*static: str) -> Callable[[Callable[..., PyTree]], Compiled]:
    """Make a function `Compiled`."""
    return lambda function: Compiled(function, static)


def _types(args: tuple) -> tuple[tuple[str, tuple[int, ...]], ...]:
    """Types and shapes of all numbers."""
    leaves = jax.tree.leaves(args)
    return tuple((np.dtype(getattr(leaf, "dtype", type(leaf))).str, np.shape(leaf)) for leaf in leaves)


def _loaded(name: str, args: tuple) -> Callable[..., PyTree] | None:
    """The executable that this user has stored under a name; None if there is none that this process can load."""
    content = store.fetch(name)
    if content is None:
        return None
    try:
        kept = pickle.loads(content)
        if kept.lapack:
            _load_lapack()
        if not all(map(ready, kept.called)):
            return None
        return serialize_executable.deserialize_and_load(
            kept.executable, jax.tree.structure((args, {})), jax.tree.structure(kept.result)
        )
    except Exception:
        return None


@cache
def _load_lapack() -> None:
    """Have JAX load LAPACK, as it does when it first lowers a function of it."""
    jax.jit(jax.lax.linalg.lu).lower(jax.ShapeDtypeStruct((1, 1), np.float64))


def _options(program: Program) -> tuple[tuple[str, PyTree], ...]:
    return MANY_SMALL if any(stage.structure.many_small for stage in program.stages) and _known() else ()


@cache
def _known() -> bool:
    """Whether this version of XLA has these options."""
    try:
        jax.jit(lambda: 0, compiler_options=dict(MANY_SMALL))()
    except Exception:
        return False
    return True
