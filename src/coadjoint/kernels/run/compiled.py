"""Functions of a program that XLA compiles, with options for the structure of its steps."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from typing import Any

import jax

from coadjoint.arrays import PyTree
from coadjoint.kernels.program import Program

MANY_SMALL = (("xla_cpu_use_fusion_emitters", False),)
"""Options for steps of links: XLA writes each of their some 400 small loops itself, in place of going through MLIR,
which takes two thirds of the time to compile and as long to run. JAX 0.12 has no such option."""


def compiled(*static: str) -> Callable[[Callable], Callable]:
    """`jax.jit` of a function whose first argument is a program, with the options for its steps.

    static: the names of further arguments that are not arrays.
    """

    def made(function: Callable) -> Callable:
        @cache
        def version(options: tuple[tuple[str, PyTree], ...]) -> Callable:
            return jax.jit(function, static_argnames=("program", *static), compiler_options=dict(options))

        @wraps(function)
        def call(program: Program, *args: object, **keywords: object) -> Any:
            return version(_options(program))(program, *args, **keywords)

        return call

    return made


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
