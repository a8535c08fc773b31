"""Digests of numbers, names and traced functions: equal in every process where the functions do the same."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping
from typing import Any
from weakref import WeakKeyDictionary

import jax
import numpy as np

from coadjoint.errors import LagrangianError
from coadjoint.kernels.trace import jaxprs
from coadjoint.kernels.trace.parameters import NAMES_ONLY

_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
TRACED_OUTSIDE = (
    "The Lagrangian, or another function of the system, uses a value from outside that JAX is tracing: "
    "put it into co.Parameters and set it with system.replace."
)
"""The error for a function that closes over a tracer: its program could serve one transformation only."""


def digest(*values: object) -> str:
    """A hash of the values of numbers, names and jaxprs, independent of their addresses in memory."""
    hasher = hashlib.sha256()
    _Feed(hasher.update).value(values)
    return hasher.hexdigest()[:32]


def opaque(jaxpr: object) -> bool:
    """Whether a jaxpr holds opaque Python functions: custom derivatives of a user, and callbacks."""
    for equation in jaxprs.equations(jaxpr):
        hidden = equation.name.startswith(("custom_jvp", "custom_vjp")) or "callback" in equation.name
        functions = [one for one in equation.parameters.values() if callable(one) and not isinstance(one, type)]
        if hidden or functions or any(map(opaque, jaxprs.inner_jaxprs(equation.parameters))):
            return True
    return False


_written: WeakKeyDictionary[Any, list[bytes]] = WeakKeyDictionary()
"""The bytes that nested jaxprs feed to a hash. JAX caches those of its own functions, which every trace contains
again."""


class _Feed:
    """Feeds values to a hash; variables of a jaxpr count by the order in which they appear."""

    def __init__(self, update: Callable[[bytes], None]):
        self.update = update
        self.order: dict[Any, int] = {}
        self.constant = False
        """Whether arrays that a jaxpr within holds have been fed."""

    def word(self, *parts: object) -> None:
        text = "\x1f".join(map(str, parts))
        self.update((_ADDRESS.sub("", text) if " at 0x" in text else text).encode() + b"\x1e")

    def value(self, value: object) -> None:
        if isinstance(value, jaxprs.Tracer):
            raise LagrangianError(TRACED_OUTSIDE)
        if jaxprs.is_jaxpr(value):
            constants = jaxprs.constants(value)
            self.constant = self.constant or bool(constants)
            self.value(constants)
            self.within(jaxprs.opened(value))
        elif isinstance(value, (np.ndarray, np.generic, jax.Array)):
            array = np.asarray(value)
            self.word("array", array.dtype, array.shape)
            self.update(array.tobytes())
        elif isinstance(value, Mapping):
            self.word("mapping", len(value))
            for key in sorted(value, key=str):
                if key not in NAMES_ONLY:
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

    def within(self, jaxpr: object) -> None:
        """A jaxpr with its own variables; its bytes are cached, unless it holds arrays, which may change."""
        parts = _written.get(jaxpr)
        if parts is None:
            parts = []
            feed = _Feed(parts.append)
            feed.jaxpr(jaxpr)
            self.constant = self.constant or feed.constant
            if not feed.constant:
                _written[jaxpr] = parts = [b"".join(parts)]
        for part in parts:
            self.update(part)

    def jaxpr(self, jaxpr: object) -> None:
        variables = jaxprs.variables(jaxpr)
        for group in (variables.constants, variables.inputs):
            self.word("inputs", *map(self.atom, group))
        for equation in jaxprs.equations(jaxpr):
            self.word(equation.name, *map(self.atom, equation.inputs))
            self.value(equation.parameters)
            self.word("gives", *map(self.atom, equation.outputs))
        self.word("outputs", *map(self.atom, variables.outputs))

    def atom(self, atom: jaxprs.Atom) -> str:
        value = jaxprs.number(atom)
        if value is not None:
            return f"{value.dtype}{value.shape}{value.tobytes().hex()}"
        return f"{self.order.setdefault(atom, len(self.order))}:{jaxprs.type_name(atom)}"
