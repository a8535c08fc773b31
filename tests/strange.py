"""Values that nobody should hand in, and doors through which they may come."""

from __future__ import annotations

import datetime
import decimal
import fractions
import pathlib
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import coadjoint as co


class Refusing:
    """An object whose every conversion raises."""

    def __array__(self, *given, **named):
        raise RuntimeError("no array\nof this")

    def __float__(self):
        raise RuntimeError("no number")

    def __bool__(self):
        raise RuntimeError("neither true nor false")

    def __len__(self):
        raise RuntimeError("no length")

    def __iter__(self):
        raise RuntimeError("no parts")

    def __eq__(self, other):
        raise RuntimeError("not comparable")

    __hash__ = object.__hash__


class Silent:
    def __repr__(self):
        raise RuntimeError("no words")


def generator():
    yield 1.0


VALUES: dict[str, Any] = {
    "None": None,
    "True": True,
    "False": False,
    "zero": 0,
    "negative zero": -0.0,
    "one": 1,
    "minus one": -1,
    "small": 1e-300,
    "large": 1e300,
    "huge whole": 10**400,
    "minus huge whole": -(10**400),
    "whole beyond 64 bits": 2**64,
    "nan": float("nan"),
    "inf": float("inf"),
    "complex": 1 + 1j,
    "complex array": np.ones(3) * 1j,
    "text": "fast",
    "digits": "0.01",
    "empty text": "",
    "NUL": "a\x00b",
    "bytes": b"0.01",
    "empty list": [],
    "nested": [[[1.0]]],
    "ragged": [1.0, [2.0]],
    "list of text": ["1", "2", "3"],
    "list with None": [1.0, None, 2.0],
    "tuple": (1.0, 2.0, 3.0),
    "dict": {"a": 1.0},
    "empty dict": {},
    "dict of whole keys": {1: 2.0},
    "set": {1.0, 2.0},
    "vector": np.array([0.1, 0.2, 0.3]),
    "truth values": np.array([True, False, True]),
    "matrix": np.eye(3),
    "reflection": -np.eye(3),
    "singular": np.zeros((3, 3)),
    "3-D": np.ones((2, 2, 2)),
    "no rows": np.zeros((0, 3)),
    "float32": np.float32(0.01),
    "float16 array": np.ones(3, np.float16),
    "longdouble": np.longdouble(0.01),
    "whole array": np.arange(3),
    "nan array": np.array([0.0, np.nan, 1.0]),
    "object array": np.array([1.0, None, "x"], dtype=object),
    "array of huge": np.array([10**400, 1, 2], dtype=object),
    "masked": np.ma.masked_array([1.0, 2.0, 3.0], mask=[False, True, False]),
    "masked scalar": np.ma.masked,
    "unmasked": np.ma.masked_array([1.0, 2.0, 3.0]),
    "structured": np.zeros(3, dtype=[("x", float)]),
    "dates": np.array(["2026-01-01"], dtype="datetime64[D]"),
    "seconds": np.timedelta64(1, "s"),
    "date": datetime.datetime(2026, 1, 1),
    "Decimal": decimal.Decimal("0.01"),
    "Fraction": fractions.Fraction(1, 100),
    "Decimal nan": decimal.Decimal("NaN"),
    "float32 of JAX": jnp.ones(3),
    "refusing": Refusing(),
    "list of refusing": [Refusing()],
    "silent": Silent(),
    "object": object(),
    "class": dict,
    "function": np.sin,
    "lambda": lambda *_: None,
    "raising": lambda *_: 1 / 0,
    "generator": generator,
    "range": range(3),
    "path": pathlib.Path("nowhere"),
    "each": co.each([1.0, 2.0]),
    "group": co.SO3(),
    "space": co.Defining(),
    "map": co.Cayley(),
    "method": co.Midpoint(),
    "signal": co.Linear([0.0, 1.0], [0.0, 1.0]),
    "Parameters": co.Parameters(a=1.0),
    "shape": jax.ShapeDtypeStruct((3,), np.float64),
    "slice": slice(None),
    "ellipsis": ...,
    "memory": memoryview(b"abc"),
}


def spin():
    """A number that is another each time."""
    COUNT.append(1)
    return float(len(COUNT))


COUNT: list[int] = []


def _custom(value):
    @jax.custom_jvp
    def f(x):
        return x

    return f(value)  # without a rule


def _deep(value):
    return _deep(value)


RESULTS: dict[str, Callable[[Any], Any]] = {
    "as it is": lambda y: y,
    "dict": lambda y: {"L": y},
    "list": lambda y: [y],
    "tuple": lambda y: (y,),
    "pair": lambda y: (y, y),
    "None": lambda y: None,
    "text": lambda y: "energy",
    "text of it": lambda y: str(y),
    "class": lambda y: dict,
    "object": lambda y: object(),
    "refusing": lambda y: Refusing(),
    "refusing product": lambda y: y * Refusing(),
    "silent": lambda y: Silent(),
    "masked": lambda y: np.ma.masked,
    "shape": lambda y: jax.ShapeDtypeStruct((), np.float64),
    "named": lambda y: co.Parameters(L=1.0),
    "nan": lambda y: y * np.nan,
    "inf": lambda y: y + np.inf,
    "large": lambda y: 1e308 * y * 1e10,
    "huge whole": lambda y: y * 10**400,
    "complex": lambda y: y + 1j,
    "whole": lambda y: 3,
    "zero": lambda y: 0.0 * y,
    "truth": lambda y: y > 0,
    "float32": lambda y: y.astype(np.float32),
    "float32 constant": lambda y: jnp.float32(5.46) * y,
    "vector": lambda y: y * jnp.ones(3),
    "row": lambda y: jnp.reshape(y, (1, -1)),
    "too many axes": lambda y: y @ y @ y,
    "float()": lambda y: float(y),
    "int()": lambda y: int(y),
    "item": lambda y: y.item(),
    "numpy": lambda y: np.linalg.norm(y),
    "np.array": lambda y: np.array([y]),
    "if": lambda y: y if y > 0 else -y,
    "len": lambda y: len(y),
    "index": lambda y: y[7],
    "attribute": lambda y: y.energy,
    "iterate": lambda y: sum(x for x in y),
    "wrong key": lambda y: y["L"],
    "assert": lambda y: [][int(y)],
    "divide": lambda y: 1 / 0,
    "raise": lambda y: (_ for _ in ()).throw(KeyError("two\nlines")),
    "raise silent": lambda y: (_ for _ in ()).throw(ValueError(Silent())),
    "raise ours": lambda y: (_ for _ in ()).throw(co.errors.ArgumentError("Argument `y` must not be.")),
    "stop": lambda y: next(iter(())),
    "recursion": _deep,
    "memory": lambda y: np.zeros(10**15),
    "square root": lambda y: jnp.sqrt(-1 - y * y),
    "norm at zero": lambda y: y + jnp.linalg.norm(0 * y),
    "log of zero": lambda y: y + jnp.log(0 * y),
    "eigenvalues": lambda y: jnp.sum(jnp.linalg.eigvalsh(y.sum() * jnp.eye(3))),
    "eigenvectors": lambda y: jnp.sum(jnp.linalg.eigh(y.sum() * jnp.eye(3))[1]),
    "eig": lambda y: jnp.sum(jnp.linalg.eig(y.sum() * jnp.eye(3))[0]),
    "svd": lambda y: jnp.sum(jnp.linalg.svd(y.sum() * jnp.eye(3))[1]),
    "inverse": lambda y: jnp.sum(jnp.linalg.inv(0 * y.sum() * jnp.eye(3))),
    "cholesky": lambda y: jnp.sum(jnp.linalg.cholesky(-(y.sum() ** 2) * jnp.eye(3))),
    "while": lambda y: jax.lax.while_loop(lambda x: jnp.sum(x) < 1, lambda x: x + 1, y),
    "fori": lambda y: jax.lax.fori_loop(0, jnp.asarray(3, int), lambda i, x: 1.1 * x, y),
    "scan": lambda y: jax.lax.scan(lambda x, _: (1.1 * x, None), y, None, 3)[0],
    "cond": lambda y: jax.lax.cond(jnp.sum(y) > 0, lambda: y, lambda: -y),
    "branches that differ": lambda y: jax.lax.cond(jnp.sum(y) > 0, lambda: y, lambda: None),
    "callback": lambda y: jax.pure_callback(lambda x: x, jax.ShapeDtypeStruct(y.shape, y.dtype), y),
    "raising callback": lambda y: jax.pure_callback(lambda x: 1 / 0, jax.ShapeDtypeStruct(y.shape, y.dtype), y),
    "custom": _custom,
    "stopped": lambda y: jax.lax.stop_gradient(y),
    "sorted": lambda y: jnp.sort(jnp.ravel(y))[0] + 0 * y,
    "argmax": lambda y: jnp.argmax(y),
    "fft": lambda y: jnp.fft.fft(jnp.ravel(y)),
    "key": lambda y: y + jax.random.normal(jax.random.PRNGKey(0)),
    "key itself": lambda y: jax.random.key(0),
    "impure": lambda y: spin() * y,
    "under jit": lambda y: jax.jit(lambda x: 2 * x)(y),
    "under vmap": lambda y: jax.vmap(lambda x: 2 * x)(jnp.ravel(y)),
    "float0": lambda y: np.zeros(3, dtype=jax.dtypes.float0),
}
"""What a user's function may do with the right result."""
