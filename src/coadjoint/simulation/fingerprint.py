"""A run's fingerprint: what must be the same for a continued run to be the same run."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np
from jax.extend import core

from coadjoint.kernels.interpreter import jaxpr_of
from coadjoint.kernels.program import FLOOR, MAX_ITERATIONS, TOLERANCE
from coadjoint.mechanics.state import State
from coadjoint.simulation.driver import Plan

_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
_NAMES_ONLY = {"name", "jvp_jaxpr_fun", "jvp_jaxpr_thunk", "fwd_jaxpr_thunk", "bwd", "debug_info", "ctx_mesh"}


def fingerprint(plan: Plan, state: State) -> dict[str, str]:
    """Digests of the equations as they are traced, of the numbers in them, and of the grid.

    Equal in every process with the same versions of Python's packages; names of functions do not count.
    """
    program, constants = plan.program, plan.constants
    z, h = np.zeros(program.skeleton.unknowns), np.float64(plan.h)
    different = {stage.step: stage for stage in program.stages}
    functions: list[tuple[Callable, tuple]] = [(program.prepare, (constants, state))]
    for stage in different.values():
        functions += [
            (stage.guess, (constants, state, h)),
            (stage.residual, (constants, state, h, z)),
            (stage.chart, (constants, state, h, z)),
            (stage.advance, (constants, state, h, z)),
        ]
    certificates = [(stage.certificate, (constants, state, h, z, state)) for stage in different.values()]
    observed = [(program.monitors, (constants, state, h)), *certificates] if plan.monitors else []
    order = {step: i for i, step in enumerate(different)}
    stages = [(order[stage.step], stage.fraction) for stage in program.stages]
    newton = (TOLERANCE, FLOOR, MAX_ITERATIONS)
    return {
        "equations": digest(newton, stages, *(traced(function, *given) for function, given in functions)),
        "parameters": digest(named(constants.system)),
        "start": digest(jax.tree.leaves(state)),
        "monitors": digest(named(constants.monitors), *(traced(function, *given) for function, given in observed)),
        "grid": digest(plan.h, plan.steps, plan.save_every, plan.monitors, plan.backend),
    }


def named(tree: Any) -> list[Any]:
    """The leaves of a PyTree beside their names."""
    return [[jax.tree_util.keystr(path), leaf] for path, leaf in jax.tree_util.tree_leaves_with_path(tree)]


def traced(function: Callable, *args: Any) -> core.ClosedJaxpr:
    """The jaxpr of a function."""
    return jaxpr_of(function, *args)[0]


def digest(*values: Any) -> str:
    """A hash of numbers, names and jaxprs that depends on what they are, not on where they are in memory."""
    hasher = hashlib.sha256()
    _Feed(hasher.update).value(values)
    return hasher.hexdigest()[:32]


class _Feed:
    """Feeds values to a hash; variables of a jaxpr count by the order in which they appear."""

    def __init__(self, update: Callable[[bytes], None]):
        self.update = update
        self.order: dict[Any, int] = {}

    def word(self, *parts: Any) -> None:
        self.update("\x1f".join(_ADDRESS.sub("", str(part)) for part in parts).encode() + b"\x1e")

    def value(self, value: Any) -> None:
        if isinstance(value, core.ClosedJaxpr):
            self.value(list(value.consts))
            _Feed(self.update).jaxpr(value.jaxpr)
        elif isinstance(value, core.Jaxpr):
            _Feed(self.update).jaxpr(value)
        elif isinstance(value, (np.ndarray, np.generic, jax.Array)):
            array = np.asarray(value)
            self.word("array", array.dtype, array.shape)
            self.update(array.tobytes())
        elif isinstance(value, Mapping):
            self.word("mapping", len(value))
            for key in sorted(value, key=str):
                if key not in _NAMES_ONLY:
                    self.word(key)
                    self.value(value[key])
        elif isinstance(value, (tuple, list)):
            self.word("sequence", len(value))
            for item in value:
                self.value(item)
        elif callable(value) and not isinstance(value, type):
            self.word("function")
        else:
            self.word(type(value).__name__, repr(value))

    def jaxpr(self, jaxpr: Any) -> None:
        for variables in (jaxpr.constvars, jaxpr.invars):
            self.word("inputs", *(self.atom(v) for v in variables))
        for equation in jaxpr.eqns:
            self.word(equation.primitive.name, *(self.atom(v) for v in equation.invars))
            self.value(equation.params)
            self.word("gives", *(self.atom(v) for v in equation.outvars))
        self.word("outputs", *(self.atom(v) for v in jaxpr.outvars))

    def atom(self, atom: Any) -> str:
        if isinstance(atom, core.Literal):
            value = np.asarray(atom.val)
            return f"{value.dtype}{value.shape}{value.tobytes().hex()}"
        return f"{self.order.setdefault(atom, len(self.order))}:{atom.aval.str_short()}"
