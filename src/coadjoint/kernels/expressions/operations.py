"""The operations of expressions by name, their values by NumPy, and the tables of constants that they look up."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from importlib import import_module

import numpy as np

from coadjoint.arrays import PyTree


def special(name: str) -> Callable[[PyTree], PyTree]:
    """A function of scipy.special, which takes longer to load than most set-ups."""
    return lambda x: getattr(import_module("scipy.special"), name)(x)


UNARY: dict[str, Callable] = {
    **{name: getattr(np, name) for name in ("abs", "sign", "floor", "ceil", "sqrt", "cbrt", "exp", "exp2", "log")},
    **{name: getattr(np, name) for name in ("log2", "expm1", "log1p", "sin", "cos", "tan", "sinh", "cosh", "tanh")},
    "neg": np.negative,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "asinh": np.arcsinh,
    "acosh": np.arccosh,
    "atanh": np.arctanh,
    "erf": special("erf"),
    "erfc": special("erfc"),
    "is_finite": np.isfinite,
    "not": np.invert,
    "round_even": np.rint,
    "round_away": lambda x: np.trunc(x + np.copysign(0.49999999999999994, x)),
    "truncate": np.trunc,
}
"""Elementary functions of one scalar."""

BINARY: dict[str, Callable] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "pow": np.power,
    "atan2": np.arctan2,
    "rem": np.fmod,
    "min": np.minimum,
    "max": np.maximum,
    "lt": np.less,
    "le": np.less_equal,
    "gt": np.greater,
    "ge": np.greater_equal,
    "eq": np.equal,
    "ne": np.not_equal,
    "and": np.bitwise_and,
    "or": np.bitwise_or,
    "xor": np.bitwise_xor,
}
"""Functions of two scalars."""


class Table:
    """Constant numbers in a row, known by their digest: those of an array in the order of its elements."""

    __slots__ = ("digest", "numbers")

    def __init__(self, array: np.ndarray) -> None:
        self.numbers = np.array(array, np.float64).reshape(-1)
        self.digest = hashlib.sha256(self.numbers.tobytes()).hexdigest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Table) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        return f"table of {len(self.numbers)}"
