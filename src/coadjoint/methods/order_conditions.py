"""The order of a symmetric composition, from its coefficients alone."""

from __future__ import annotations

from functools import lru_cache
from itertools import product
from math import factorial

import numpy as np

HIGHEST = 12
"""Orders are searched up to this one."""

ROUNDING = 1e-11
"""A condition off by less, relative to the size of its terms, is met: coefficients are given to 16 digits or more."""

Word = tuple[int, ...]


@lru_cache
def composed_order(coefficients: tuple[float, ...], base: int) -> int:
    """The order of Φ_{γ_s h} ∘ … ∘ Φ_{γ_1 h} for every symmetric Φ of order `base`.

    Φ_h = exp(hA₁ + h^{p+1}A_{p+1} + h^{p+3}A_{p+3} + …) with operators A that do not commute. The composition has
    order q where its series agrees with exp(hA₁) in all words of degree ≤ q in the letters A; a symmetric one has even
    order, so that odd degrees decide.
    """
    reached = base
    for degree in range(base + 1, HIGHEST + 1, 2):
        if any(_error(word, coefficients) > ROUNDING for word in _words(degree, base)):
            return reached
        reached = degree + 1
    return reached


def _words(degree: int, base: int) -> list[Word]:
    """The words in the letters 1, p+1, p+3, … whose degrees add up to `degree`."""
    letters = (1, *range(base + 1, degree + 1, 2))
    found: list[list[Word]] = [[()]]
    for total in range(1, degree + 1):
        found.append([(letter, *word) for letter in letters if letter <= total for word in found[total - letter]])
    return found[degree]


def _error(word: Word, coefficients: tuple[float, ...]) -> float:
    """The coefficient of a word in the composition less that in exp(hA₁), relative to the sum of its terms' sizes.

    exp(γ…) gives a word w of k letters the coefficient γ^{|w|}/k!; in a product the word is split over the factors.
    """
    exact = 1 / factorial(len(word)) if set(word) <= {1} else 0.0
    size = _coefficient(word, np.abs(coefficients))
    return abs(_coefficient(word, np.array(coefficients)) - exact) / max(size, 1.0)


def _coefficient(word: Word, gamma: np.ndarray) -> float:
    sums = np.cumsum((0, *word))
    row = np.zeros(len(word) + 1)
    row[0] = 1.0
    for g in gamma:
        new = row.copy()
        for start, end in product(range(len(word)), range(1, len(word) + 1)):
            if start < end:
                new[end] += row[start] * g ** (sums[end] - sums[start]) / factorial(end - start)
        row = new
    return float(row[-1])
