"""Digests of numbers, names and traced functions: equal in every process where the functions do the same."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np
from jax.core import Tracer
from jax.extend import core

from coadjoint.errors import LagrangianError

_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
_NAMES_ONLY = {"name", "jvp_jaxpr_fun", "jvp_jaxpr_thunk", "fwd_jaxpr_thunk", "bwd", "debug_info", "ctx_mesh"}


TRACED_OUTSIDE = (
    "The Lagrangian, or another function of the system, uses a value from outside that JAX is tracing: "
    "put it into co.Parameters and set it with system.replace."
)
"""What is said of a function that closes over a tracer: its program could serve one transformation only."""


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
        if isinstance(value, Tracer):
            raise LagrangianError(TRACED_OUTSIDE)
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
