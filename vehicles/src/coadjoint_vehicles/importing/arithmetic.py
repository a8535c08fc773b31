"""Arithmetic of ${…} in xacro files: numbers, names, + - * / % **, one comparison, some functions; never a program."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from coadjoint.errors import ArgumentError

LONGEST, DEEPEST = 1000, 32
"""The most characters of an expression, and the most parentheses within each other."""

_WORD = re.compile(
    r"\s*(?:(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)|(?:math\.)?([A-Za-z_]\w*)|(\*\*|[-+*/%(),]))"
)
_COMPARISON = re.compile(r"([^=!<>]+)(==|!=|<=|>=|<|>)([^=!<>]+)")
CONSTANTS = {"pi": math.pi, "M_PI": math.pi, "e": math.e, "inf": math.inf, "True": 1.0, "False": 0.0}
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": math.sin, "cos": math.cos, "tan": math.tan, "asin": math.asin, "acos": math.acos, "atan": math.atan,
    "atan2": math.atan2, "sqrt": math.sqrt, "radians": math.radians, "degrees": math.degrees, "abs": abs,
    "min": min, "max": max, "exp": math.exp, "log": math.log, "floor": math.floor, "ceil": math.ceil, "float": float,
    "int": int, "round": round, "pow": math.pow,
}  # fmt: skip


def value_of(text: str, held: Callable[[str], str | None]) -> float | str:
    """The value of an expression: a number, or a text.

    held: the text of a name, None for an unknown name. Raises ArgumentError for text that is not arithmetic.
    """
    if len(text) > LONGEST:
        raise ArgumentError(f"the expression is longer than {LONGEST} characters")
    bare = text.strip()
    if bare.isidentifier() and (alone := held(bare)) is not None:
        return alone
    compared = _COMPARISON.fullmatch(bare)
    if compared is not None:
        left, sign, right = compared.groups()
        return float(_compared(value_of(left, held), sign, value_of(right, held)))
    if len(bare) >= 2 and bare[0] == bare[-1] and bare[0] in "'\"" and bare[0] not in bare[1:-1]:
        return bare[1:-1]
    found = _Reader(text, held)
    value = found.sum()
    if found.words:
        raise ArgumentError(f"`{found.words[0][1]}` is not expected in ${{{text}}}")
    if math.isnan(value):
        raise ArgumentError(f"${{{text}}} is not a number")
    return value


def _compared(left: float | str, sign: str, right: float | str) -> bool:
    """Whether two values compare so: as numbers where both are, else as texts."""
    with suppress(ValueError):
        left, right = float(left), float(right)
    if sign in ("==", "!="):
        return (left == right) == (sign == "==")
    if isinstance(left, str) or isinstance(right, str):
        raise ArgumentError(f"{left!r} {sign} {right!r} compares a value that is not a number")
    return {"<": left < right, "<=": left <= right, ">": left > right, ">=": left >= right}[sign]


class _Reader:
    """The words of an expression that are still to be read, from left to right."""

    def __init__(self, text: str, held: Callable[[str], str | None]):
        self.text, self.held, self.depth = text, held, 0
        self.words = self._words()

    def _words(self) -> list[tuple[str, str]]:
        words, at, text = [], 0, self.text.rstrip()
        while at < len(text):
            found = _WORD.match(text, at)
            if found is None:
                left = text[at:].strip()
                raise ArgumentError(
                    f"${{{self.text}}} is not arithmetic of numbers and properties: `{left[:20]}` is not read, and no "
                    "Python is run"
                )
            number, name, sign = found.groups()
            words.append(("number", number) if number else ("name", name) if name else ("sign", sign))
            at = found.end()
        if not words:
            raise ArgumentError("${} is empty")
        return words

    def _next(self, *signs: str) -> str | None:
        """The sign that comes next, if it is one of these."""
        if self.words and self.words[0][0] == "sign" and self.words[0][1] in signs:
            return self.words.pop(0)[1]
        return None

    def sum(self) -> float:
        self.depth += 1
        if self.depth > DEEPEST:
            raise ArgumentError(f"${{{self.text[:40]}…}} has more than {DEEPEST} parentheses within each other")
        value = self._product()
        while sign := self._next("+", "-"):
            other = self._product()
            value = value + other if sign == "+" else value - other
        self.depth -= 1
        return value

    def _product(self) -> float:
        value = self._signed()
        while sign := self._next("*", "/", "%"):
            other = self._signed()
            if sign != "*" and other == 0:
                raise ArgumentError(f"${{{self.text}}} divides by zero")
            value = value * other if sign == "*" else value / other if sign == "/" else value % other
        return value

    def _signed(self) -> float:
        signs = 0
        while sign := self._next("+", "-"):
            signs += sign == "-"
        value = self._power()
        return -value if signs % 2 else value

    def _power(self) -> float:
        base = self._atom()
        if not self._next("**"):
            return base
        self.depth += 1
        if self.depth > DEEPEST:
            raise ArgumentError(f"${{{self.text[:40]}…}} has more than {DEEPEST} powers within each other")
        exponent = self._signed()
        self.depth -= 1
        return self._called(math.pow, (base, exponent))

    def _atom(self) -> float:
        if not self.words:
            raise ArgumentError(f"${{{self.text}}} ends where a number is expected")
        kind, word = self.words.pop(0)
        if kind == "number":
            return float(word)
        if kind == "name":
            return self._function(word) if self._next("(") else self._property(word)
        if word == "(":
            value = self.sum()
            self._closed()
            return value
        raise ArgumentError(f"`{word}` is not expected in ${{{self.text}}}")

    def _function(self, name: str) -> float:
        if name not in FUNCTIONS:
            raise ArgumentError(
                f"${{{self.text}}} calls `{name}`, which is none of {', '.join(sorted(FUNCTIONS))}; no Python is run"
            )
        given = [self.sum()]
        while self._next(","):
            given.append(self.sum())
        self._closed()
        return self._called(FUNCTIONS[name], tuple(given))

    def _called(self, function: Callable[..., float], given: tuple[float, ...]) -> float:
        try:
            return float(function(*given))
        except (ValueError, TypeError, ArithmeticError) as error:
            raise ArgumentError(f"${{{self.text}}} has no value: {error}") from None

    def _property(self, name: str) -> float:
        held = self.held(name)
        if held is None:
            if name in CONSTANTS:
                return CONSTANTS[name]
            raise ArgumentError(f"there is no property `{name}`, which ${{{self.text}}} needs")
        try:
            return float(held)
        except ValueError:
            raise ArgumentError(f"the property `{name}` is {held!r}, no number, in ${{{self.text}}}") from None

    def _closed(self) -> None:
        if not self._next(")"):
            raise ArgumentError(f"${{{self.text}}} lacks a closing parenthesis")
