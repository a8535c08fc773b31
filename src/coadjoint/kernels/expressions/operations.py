"""The operations of expressions by name, and their values by NumPy."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np


def special(name: str) -> Callable[[Any], Any]:
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
