"""A row of the table of theorems: one declaration for the page, the measurement and the mutation test."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import jax
import numpy as np

ROUND_OFF = 5e-13
"""The bound of a row whose statement is evaluated once, not iterated."""

Cases = Callable[[], Iterator[float]]


@dataclass(frozen=True)
class Row:
    """A numbered statement of a paper.

    `domain`: the systems that it holds for.
    `functions`: what computes it, by names under coadjoint; `tests`: what else checks it; `cases`: the residuals of
    the statement on random systems, one after another, relative to their terms; `bound`: what they stay below.
    `equivalent`: of mutations (function, mutation) that leave the statement as it is, the reason.
    """

    number: str
    statement: str
    domain: str
    functions: tuple[str, ...]
    tests: tuple[str, ...]
    cases: Cases
    bound: float = ROUND_OFF
    equivalent: Mapping[tuple[str, str], str] = field(default_factory=dict)

    def residual(self) -> float:
        """The largest residual over all cases."""
        return max(self.cases())


class Rows(list[Row]):
    """The rows of a part of the table, in its order; each is added by the function that measures it.

    domain: that of the rows that name none.
    """

    def __init__(self, domain: str):
        super().__init__()
        self.domain = domain

    def add(
        self,
        number: str,
        statement: str,
        functions: tuple[str, ...],
        tests: tuple[str, ...],
        domain: str = "",
        **more: Any,
    ):
        """Make a row of the decorated generator of residuals."""

        def keep(cases: Cases) -> Row:
            self.append(Row(number, statement, domain or self.domain, functions, tests, cases, **more))
            return self[-1]

        return keep


def largest(*trees: Any) -> float:
    """The largest entry in size, infinite where one is not a number."""
    found = np.max([np.max(np.abs(leaf), initial=0.0) for leaf in jax.tree.leaves(trees)], initial=0.0)  # NaN stays
    return float(found) if np.isfinite(found) else np.inf


def off(found: Any, expected: Any, scale: Any = None) -> float:
    """max |found − expected| relative to the largest entry of both, or of `scale`."""
    apart = jax.tree.map(lambda x, y: np.asarray(x) - np.asarray(y), found, expected)
    size = largest(*((found, expected) if scale is None else (scale,)))
    assert size > 0, "a residual of nothing proves nothing"
    return largest(apart) / size if np.isfinite(size) else np.inf


def off_each(found: Any, expected: Any) -> float:
    """The largest `off` of the parts of two tuples, each relative to its own size."""
    return max(off(x, y) for x, y in zip(found, expected, strict=True))
