"""Digests of numbers, names and traced functions: equal in every process where the functions do the same."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np

from coadjoint.errors import LagrangianError
from coadjoint.kernels.trace import jaxprs

_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
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
        if isinstance(value, jaxprs.Tracer):
            raise LagrangianError(TRACED_OUTSIDE)
        if jaxprs.is_jaxpr(value):
            self.value(jaxprs.constants(value))
            _Feed(self.update).jaxpr(value)
        elif isinstance(value, (np.ndarray, np.generic, jax.Array)):
            array = np.asarray(value)
            self.word("array", array.dtype, array.shape)
            self.update(array.tobytes())
        elif isinstance(value, Mapping):
            self.word("mapping", len(value))
            for key in sorted(value, key=str):
                if key not in jaxprs.NAMES_ONLY:
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
        variables = jaxprs.variables(jaxpr)
        for group in (variables.constants, variables.inputs):
            self.word("inputs", *(self.atom(v) for v in group))
        for equation in jaxprs.equations(jaxpr):
            self.word(equation.name, *(self.atom(v) for v in equation.inputs))
            self.value(equation.parameters)
            self.word("gives", *(self.atom(v) for v in equation.outputs))
        self.word("outputs", *(self.atom(v) for v in variables.outputs))

    def atom(self, atom: jaxprs.Atom) -> str:
        value = jaxprs.number(atom)
        if value is not None:
            return f"{value.dtype}{value.shape}{value.tobytes().hex()}"
        return f"{self.order.setdefault(atom, len(self.order))}:{jaxprs.type_name(atom)}"
