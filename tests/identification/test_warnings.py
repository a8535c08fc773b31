"""Sentences on what a log does not tell."""

from __future__ import annotations

import numpy as np

from coadjoint.identification.diagnostics import hidden, vague
from coadjoint.identification.result import Estimate


def test_a_name_in_a_sentence_is_one_of_the_three_strongest():
    names = [f"mass[{i}]" for i in range(9)]
    estimates = {name: Estimate(name, 1.0, -np.inf, np.inf, np.inf, 1.0) for name in names}
    V = np.array([[0.1, 0.1, 0.8, 0.1, 0.5, 0.1, 0.3, 0.1, 0.0]])
    told = hidden(estimates, np.abs(V[0]) > 0, V, np.array([True]))
    assert told == [
        "The log cannot separate mass[2] and mass[4] and mass[6], with 5 others: keep one of them at its known value, "
        "or take a log in which their effects differ, as by commands that change separately."
    ]


def test_what_is_nothing_beside_where_the_search_began_is_well_known():
    """An effectiveness of 0 ± 0.001 that was 1; of one of 0 ± 0.1 it is told, and of one whose search began at 0."""
    lost, vague_one = Estimate("lost", 0.0, -0.001, 0.001, 5e-4, 1.0), Estimate("v", 0.0, -0.1, 0.1, 0.05, 1.0)
    found = vague({"lost": lost, "v": vague_one, "none": Estimate("none", 0.0, -0.001, 0.001, 5e-4, 0.0)})
    assert [sentence.split(" from zero")[0] for sentence in found] == [
        "The log does not distinguish v", "The log does not distinguish none"
    ]  # fmt: skip


def test_an_interval_around_zero_is_told_without_a_percentage():
    told = vague({"a": Estimate("a", 0.24, -0.1, 0.58, 0.17, 0.0), "b": Estimate("b", 1.0, 0.3, 1.7, 0.35, 1.0)})
    assert told[0] == "The log does not distinguish a from zero: its interval is -0.1 to 0.58."
    assert told[1] == "The log hardly excites b: its interval is ±70%."
